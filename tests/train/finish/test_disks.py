"""Cutting into disks: prisms and tubes with known cuts, solids of every genus, real meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.topology import (
    boundary_loops,
    components,
    edge_table,
    euler_characteristic,
    is_manifold,
    split_non_manifold_vertices,
)
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.disks import cut_open, disk_cuts

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

TRIANGLE = np.array([[0, 1, 2]])
TETRAHEDRON = Surface(
    np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]),
    np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]),
)


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def without(surface: Surface, dropped: NDArray[np.bool_]) -> Surface:
    """The surface less some faces."""
    used, index = np.unique(surface.faces[~dropped], return_inverse=True)
    return Surface(surface.vertices[used], index.reshape(-1, 3).astype(np.int64))


def pierced(surface: Surface, points: list[list[float]], radius: float) -> Surface:
    """The surface with a hole at each point."""
    centre = surface.triangles.mean(axis=1)
    return without(surface, np.any([np.linalg.norm(centre - point, axis=1) < radius for point in points], axis=0))


def square_tube() -> Surface:
    """The sides of a cube: a prism open above and below, of height 1, with four creases."""
    cube = sample("cube", 24)
    return without(cube, np.abs(cube.face_normals()[:, 2]) > 0.5)


def cut(surface: Surface, crease_discount: float = 0.0) -> tuple[Surface, float]:
    """The surface opened by its disk cuts, and their length."""
    table = edge_table(surface.faces)
    mask = disk_cuts(surface, table, SeamPrices(crease_discount))
    ends = surface.vertices[table.edges[mask]]
    faces, old = cut_open(surface.faces, mask, table)
    assert np.array_equal(old[faces], surface.faces)  # the same triangles, only taken apart
    return Surface(surface.vertices[old], faces), float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def assert_disk(surface: Surface) -> None:
    assert euler_characteristic(surface.faces) == 1
    assert components(surface.faces).max() == 0
    assert len(boundary_loops(surface.faces)) == 1
    assert is_manifold(surface.faces)


def test_one_triangle_needs_no_cut() -> None:
    surface = Surface(np.eye(3), TRIANGLE)
    assert not disk_cuts(surface, edge_table(TRIANGLE), SeamPrices()).any()


@pytest.mark.parametrize("name", ["cloth", "cone"])
def test_a_disk_needs_no_cut(name: str) -> None:
    surface = sample(name, 16)
    assert not disk_cuts(surface, edge_table(surface.faces), SeamPrices()).any()


@pytest.mark.parametrize("discount", [0.0, 0.8])
@pytest.mark.parametrize("name", ["sphere", "torus", "trefoil", "tube", "cube", "gyroid", "bracket"])
def test_any_solid_becomes_one_disk(name: str, discount: float) -> None:
    if name in ("gyroid", "bracket"):
        pytest.importorskip("manifold3d")
    assert_disk(cut(sample(name, 24), discount)[0])


@pytest.mark.parametrize("first", [0, 6, 51, 174])
def test_no_cut_through_handles_has_a_dead_end(first: int) -> None:
    """Wherever the vertex at which all loops begin may lie: on a bracket, loops share a crease on their way out."""
    pytest.importorskip("manifold3d")
    bracket = sample("bracket", 24)
    order = np.roll(np.arange(len(bracket.vertices)), -first)
    surface = Surface(bracket.vertices[order], np.argsort(order)[bracket.faces])
    table = edge_table(surface.faces)
    assert (np.bincount(table.edges[disk_cuts(surface, table, SeamPrices())].reshape(-1)) != 1).all()
    assert_disk(cut(surface, 0.8)[0])


def test_the_smallest_closed_surface_becomes_a_disk() -> None:
    assert_disk(cut(TETRAHEDRON)[0])


@pytest.mark.parametrize("holes", [1, 2, 3, 6])
def test_a_sphere_with_holes_becomes_one_disk(holes: int) -> None:
    directions = np.concatenate([np.eye(3), -np.eye(3)])[:holes]
    surface = pierced(sample("sphere", 40), directions.tolist(), 0.3)
    assert len(boundary_loops(surface.faces)) == holes
    opened, length = cut(surface)
    assert_disk(opened)
    assert (length > 0.0) == (holes > 1)
    assert length <= (holes - 1) * np.pi / 2.0 * 1.1


def test_a_torus_with_two_holes_becomes_one_disk() -> None:
    assert_disk(cut(pierced(sample("torus", 40), [[1.0, 0, 0], [-0.7, 0, 0.3]], 0.15))[0])


def test_the_cut_of_a_tube_is_as_long_as_the_tube() -> None:
    assert cut(sample("tube", 32))[1] == pytest.approx(2.0)


def test_the_cut_of_a_torus_is_two_short_loops() -> None:
    """Around the tube, 2π · 0.3, and around the hole on its inner side, 2π · 0.4."""
    length = cut(sample("torus", 48))[1]
    assert 0.95 * 2.0 * np.pi * 0.7 < length < 1.25 * 2.0 * np.pi * 0.7


def test_a_sphere_is_slit_between_two_far_points() -> None:
    length = cut(sample("sphere", 48))[1]
    assert 0.95 * np.pi < length < 1.15 * np.pi


def test_the_discount_draws_the_cut_onto_a_crease() -> None:
    tube = square_tube()
    table = edge_table(tube.faces)
    mask = disk_cuts(tube, table, SeamPrices())
    ends = tube.vertices[table.edges[mask]]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(1.0)
    assert np.abs(ends[..., :2]) == pytest.approx(0.5)


def test_a_cut_goes_round_to_reach_a_crease_that_saves_more() -> None:
    """Two holes in two faces of a cube: most of the way between them is crease, though the straight one is shorter."""
    cube = pierced(sample("cube", 64), [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]], 0.2)
    table = edge_table(cube.faces)
    ends = cube.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    crease = (np.abs(ends.mean(axis=1)) > 0.5 - 1e-9).sum(axis=1) == 2
    drawn = disk_cuts(cube, table, SeamPrices())
    assert length[drawn].sum() >= 1.6 - 1e-9  # straight across: 0.3 + 1 + 0.3
    assert length[drawn & crease].sum() >= 1.0 - 1e-9


@pytest.mark.parametrize("name", ["spot", "suzanne", "fandisk"])
def test_each_manifold_part_of_a_real_mesh_becomes_one_disk(name: str, models: Path) -> None:
    surface = load_asset(models / f"{name}.obj").surface
    faces, old = split_non_manifold_vertices(surface.faces)
    part = components(faces)
    for number in range(int(part.max()) + 1):
        assert_disk(cut(without(Surface(surface.vertices[old], faces), part != number), 0.8)[0])
