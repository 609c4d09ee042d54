"""Cutting into disks: paths on a grid by hand, prisms and tubes with known cuts, solids of every genus, real meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

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
from flexpara.train.finish.disks import (
    cut_open,
    disk_cuts,
    edge_costs,
    is_disk,
    path_mask,
    prune,
    shortest_paths,
    trace_back,
)

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


def flat_grid(columns: int, rows: int) -> Surface:
    """A flat sheet of unit squares; vertex (i, j) has number i · (rows + 1) + j."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0), indexing="ij")
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface(np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1), faces)


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
    mask = disk_cuts(surface, table, crease_discount)
    ends = surface.vertices[table.edges[mask]]
    faces, old = cut_open(surface.faces, mask, table)
    assert np.array_equal(old[faces], surface.faces)  # the same triangles, only taken apart
    return Surface(surface.vertices[old], faces), float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def assert_disk(surface: Surface) -> None:
    assert euler_characteristic(surface.faces) == 1
    assert components(surface.faces).max() == 0
    assert len(boundary_loops(surface.faces)) == 1
    assert is_manifold(surface.faces)


def test_a_triangle_is_a_disk_and_a_tetrahedron_is_not() -> None:
    assert is_disk(TRIANGLE)
    assert not is_disk(TETRAHEDRON.faces)


def test_one_triangle_needs_no_cut() -> None:
    surface = Surface(np.eye(3), TRIANGLE)
    assert not disk_cuts(surface, edge_table(TRIANGLE), 0.8).any()


def test_the_shortest_way_over_a_grid_runs_along_its_diagonals() -> None:
    grid = flat_grid(4, 4)
    table = edge_table(grid.faces)
    paths = shortest_paths(25, table.edges, edge_costs(grid, table, 0.0), np.array([0]))
    assert paths.distance[24] == pytest.approx(4.0 * np.sqrt(2.0))
    assert paths.distance[23] == pytest.approx(3.0 * np.sqrt(2.0) + 1.0)
    path = trace_back(paths.parent, 24)
    assert path == [24, 18, 12, 6, 0]
    mask = path_mask(table, [path])
    assert table.edges[mask].tolist() == [[0, 6], [6, 12], [12, 18], [18, 24]]


def test_the_way_leads_to_the_nearest_source() -> None:
    grid = flat_grid(6, 1)
    table = edge_table(grid.faces)
    paths = shortest_paths(14, table.edges, edge_costs(grid, table, 0.0), np.array([0, 12]))
    assert paths.distance[[0, 2, 4, 6, 8, 10, 12]].tolist() == [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0]
    assert trace_back(paths.parent, 10) == [10, 12]
    assert trace_back(paths.parent, 0) == [0]


def test_out_of_reach_is_infinitely_far() -> None:
    paths = shortest_paths(3, np.array([[0, 1]]), np.ones(1), np.array([0]))
    assert paths.distance.tolist() == [0.0, 1.0, np.inf]
    assert paths.parent.tolist() == [-1, 0, -1]


def test_boundary_edges_are_on_no_cut() -> None:
    grid = flat_grid(3, 2)
    table = edge_table(grid.faces)
    mask = path_mask(table, [[0, 3, 6, 7]])
    assert table.edges[mask].tolist() == [[6, 7]]


def test_an_edge_costs_its_length_and_a_crease_a_fifth_of_it() -> None:
    cube = sample("cube", 8)
    table = edge_table(cube.faces)
    ends = cube.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    crease = (np.abs(ends.mean(axis=1)) > 0.5 - 1e-9).sum(axis=1) == 2
    assert crease.sum() == 12 * 2
    assert edge_costs(cube, table, 0.0) == pytest.approx(length)
    assert edge_costs(cube, table, 0.8) == pytest.approx(np.where(crease, 0.2 * length, length))


def test_pruning_keeps_loops_and_drops_what_leads_nowhere() -> None:
    grid = flat_grid(6, 4)
    table = edge_table(grid.faces)
    ring = [6, 11, 12, 7, 6]
    tail = [12, 17, 22]
    kept = prune(table, path_mask(table, [ring, tail]))
    assert np.array_equal(kept, path_mask(table, [ring]))
    assert not prune(table, path_mask(table, [tail])).any()


def test_pruning_writes_to_nothing() -> None:
    grid = flat_grid(6, 4)
    table = edge_table(grid.faces)
    mask = path_mask(table, [[12, 17, 22]])
    prune(table, mask)
    assert mask.sum() == 2


@pytest.mark.parametrize("name", ["cloth", "cone"])
def test_a_disk_needs_no_cut(name: str) -> None:
    surface = sample(name, 16)
    assert not disk_cuts(surface, edge_table(surface.faces), 0.8).any()


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
    assert (np.bincount(table.edges[disk_cuts(surface, table, 0.8)].reshape(-1)) != 1).all()
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
    mask = disk_cuts(tube, table, 0.8)
    ends = tube.vertices[table.edges[mask]]
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(1.0)
    assert np.abs(ends[..., :2]) == pytest.approx(0.5)


def test_a_cut_goes_round_to_reach_a_crease_that_saves_more() -> None:
    """Two holes in two faces of a cube: with the discount, more of the way between them is crease."""
    cube = pierced(sample("cube", 64), [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]], 0.2)
    table = edge_table(cube.faces)
    length, cheap = edge_costs(cube, table, 0.0), edge_costs(cube, table, 0.8)
    plain, drawn = disk_cuts(cube, table, 0.0), disk_cuts(cube, table, 0.8)
    assert length[drawn].sum() >= length[plain].sum() - 1e-9
    assert cheap[drawn].sum() < 0.8 * cheap[plain].sum()


@pytest.mark.parametrize("name", ["spot", "suzanne", "fandisk"])
def test_each_manifold_part_of_a_real_mesh_becomes_one_disk(name: str, models: Path) -> None:
    surface = load_asset(models / f"{name}.obj").surface
    faces, old = split_non_manifold_vertices(surface.faces)
    part = components(faces)
    for number in range(int(part.max()) + 1):
        assert_disk(cut(without(Surface(surface.vertices[old], faces), part != number), 0.8)[0])
