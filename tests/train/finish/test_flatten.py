"""Flattening: Jacobians of affine maps by hand, energies in closed form, bad disks, holes, real meshes."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.distortion import oriented_energy
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import boundary_loops, euler_characteristic
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.contact import excess_energy
from flexpara.train.finish.flatten import (
    Pins,
    Slim,
    circle_map,
    fill_holes,
    flatten,
    jacobians,
    loop_length,
    slim,
    sorted_loops,
    tutte_map,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

TURN = np.array([[0.6, -0.8], [0.8, 0.6]])
MIRROR = np.diag([1.0, -1.0])


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def without(surface: Surface, dropped: NDArray[np.bool_]) -> Surface:
    used, index = np.unique(surface.faces[~dropped], return_inverse=True)
    return Surface(surface.vertices[used], index.reshape(-1, 3).astype(np.int64))


def half_cylinder(columns: int, rows: int) -> tuple[Surface, NDArray[np.float64]]:
    """Half of a cylinder of radius 1 and height 2, and its exact development."""
    angle, z = np.meshgrid(np.linspace(0.0, np.pi, columns + 1), np.linspace(0.0, 2.0, rows + 1), indexing="ij")
    corner = np.arange(angle.size).reshape(angle.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    chord = 2.0 * columns * np.sin(np.pi / columns / 2.0)  # the prism that the mesh is has this arc length
    vertices = np.stack([np.cos(angle), np.sin(angle), z], axis=-1).reshape(-1, 3)
    return Surface(vertices, faces), np.stack([angle * chord / np.pi, z], axis=-1).reshape(-1, 2)


def sliver_disk() -> Surface:
    """A flat disk of random points, squeezed to slivers at random: cotangent weights go far below zero."""
    rng = np.random.default_rng(5)
    surface = sample("cloth", 12)
    inner = np.setdiff1d(np.arange(len(surface.vertices)), boundary_loops(surface.faces)[0])
    vertices = surface.vertices.copy()
    vertices[inner] += rng.normal(0.0, 0.35, (len(inner), 3))
    return Surface(vertices, surface.faces)


def assert_valid(surface: Surface, uv: NDArray[np.float64]) -> None:
    corners = uv[surface.faces]
    assert not flipped_triangles(corners).any()
    assert len(overlapping_pairs(corners)) == 0


def singular(surface: Surface, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.linalg.svd(jacobians(surface, uv), compute_uv=False).astype(np.float64)


def test_the_jacobian_of_one_triangle_by_hand() -> None:
    """Basis of the face: along its first edge, and left of it."""
    surface = Surface(np.array([[0.0, 0, 5], [2, 0, 5], [0, 4, 5]]), np.array([[0, 1, 2]]))
    assert jacobians(surface, np.array([[0.0, 0.0], [6.0, 2.0], [8.0, 12.0]]))[0] == pytest.approx(
        np.array([[3.0, 2.0], [1.0, 3.0]])
    )


def test_the_jacobian_of_an_affine_map_is_its_matrix_up_to_the_choice_of_basis() -> None:
    rng = np.random.default_rng(0)
    flat, matrix = rng.normal(size=(30, 2)), np.array([[2.0, 0.5], [-0.3, 0.7]])
    frame = np.linalg.qr(rng.normal(size=(3, 3)))[0][:, :2]
    faces = rng.permuted(np.tile(np.arange(30), (20, 1)), axis=1)[:, :3]
    faces[signed_areas(flat[faces]) < 0.0] = faces[signed_areas(flat[faces]) < 0.0][:, ::-1]
    surface = Surface(flat @ frame.T + 3.0, faces)
    found = jacobians(surface, flat @ matrix.T - 1.0)
    assert np.linalg.svd(found, compute_uv=False) == pytest.approx(np.tile(np.linalg.svd(matrix)[1], (20, 1)))
    assert np.linalg.det(found) == pytest.approx(np.linalg.det(matrix))


def mean_distortion(surface: Surface, uv: NDArray[np.float64]) -> float:
    return 1.0 + excess_energy(surface, uv) / float(surface.face_areas().sum())


def test_excess_energy_weighs_faces_by_their_area() -> None:
    """A square of four times the area at scale 1 beside one at scale 2."""
    vertices = np.array([[0.0, 0, 0], [4, 0, 0], [4, 2, 0], [9, 0, 0], [10, 0, 0], [10, 2, 0]])
    surface = Surface(vertices, np.array([[0, 1, 2], [3, 4, 5]]))
    uv = vertices[:, :2] * np.array([1.0, 1, 1, 2, 2, 2])[:, None]
    assert mean_distortion(surface, uv) == pytest.approx((4.0 * 1.0 + 1.0 * (4.0 + 0.25) / 2.0) / 5.0)


def test_the_circle_map_of_a_fan_is_its_polygon() -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)
    ring = np.stack([np.cos(angle), np.sin(angle), 0.3 * np.cos(2.0 * angle)], axis=1)
    faces = np.array([[i, (i + 1) % 8, 8] for i in range(8)])
    surface = Surface(np.concatenate([ring, [[0.0, 0.0, 0.0]]]), faces)
    uv = circle_map(surface, boundary_loops(faces)[0])
    radius = np.linalg.norm(uv, axis=1)
    assert radius == pytest.approx([np.sqrt(surface.face_areas().sum() / np.pi)] * 8 + [0.0], abs=1e-9)
    assert_valid(surface, uv)


@pytest.mark.parametrize("name", ["cloth", "cone"])
def test_the_circle_map_of_a_disk_is_bijective_at_the_scale_of_its_area(name: str) -> None:
    surface = sample(name, 20)
    uv = circle_map(surface, boundary_loops(surface.faces)[0])
    assert_valid(surface, uv)
    assert signed_areas(uv[surface.faces]).sum() == pytest.approx(surface.face_areas().sum(), rel=0.02)


def test_the_circle_map_never_flips_where_cotangents_do() -> None:
    import igl

    surface = sliver_disk()
    loop = boundary_loops(surface.faces)[0]
    circle = igl.map_vertices_to_circle(surface.vertices, loop)
    vertices, faces = np.asfortranarray(surface.vertices), np.asfortranarray(surface.faces)
    harmonic = np.asarray(igl.harmonic(vertices, faces, loop, circle, 1), dtype=np.float64)
    assert flipped_triangles(harmonic[surface.faces]).any()  # else this test shows nothing
    assert_valid(surface, circle_map(surface, loop))


def test_tutte_places_each_inner_vertex_at_the_mean_of_its_neighbours() -> None:
    surface = sample("cloth", 8)
    loop = boundary_loops(surface.faces)[0]
    angle = np.linspace(0.0, 2.0 * np.pi, len(loop), endpoint=False)
    uv = tutte_map(surface, loop, np.stack([np.cos(angle), np.sin(angle)], axis=1))
    for vertex in np.setdiff1d(np.arange(len(uv)), loop).tolist():
        around = np.unique(surface.faces[(surface.faces == vertex).any(axis=1)])
        assert uv[vertex] == pytest.approx(uv[around[around != vertex]].mean(axis=0))
    assert_valid(surface, uv)


def test_tutte_of_a_disk_without_inner_vertices_is_its_boundary() -> None:
    surface = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    corners = np.array([[0.0, 0], [3, 0], [3, 2], [0, 2]])
    assert np.array_equal(tutte_map(surface, np.arange(4), corners), corners)


def test_slim_lowers_the_energy_and_flips_nothing() -> None:
    surface = sample("cloth", 20)
    start = circle_map(surface, boundary_loops(surface.faces)[0])
    few, more = slim(surface, start, 3), slim(surface, start, 10)
    assert mean_distortion(surface, start) > mean_distortion(surface, few) > mean_distortion(surface, more) > 1.0
    assert np.isfinite(oriented_energy(jacobians(surface, more))).all()


def test_slim_runs_on_where_it_stopped() -> None:
    surface = sample("cloth", 12)
    start = circle_map(surface, boundary_loops(surface.faces)[0])
    solver = Slim(surface, start)
    solver.run(3)
    assert solver.run(4) == pytest.approx(slim(surface, start, 7), abs=1e-6)


def test_slim_leaves_its_start_alone() -> None:
    surface = sample("cloth", 12)
    start = circle_map(surface, boundary_loops(surface.faces)[0])
    before = start.copy()
    slim(surface, start, 3)
    assert np.array_equal(start, before)


def test_pins_draw_vertices_to_their_places() -> None:
    surface, exact = half_cylinder(12, 8)
    corner = np.array([0, len(exact) - 1])
    place = exact[corner] + np.array([[-0.5, 0.0], [0.5, 0.0]])
    pinned = slim(surface, exact, 20, Pins(corner, place, 1e3))
    assert pinned[corner] == pytest.approx(place, abs=0.02)
    assert_valid(surface, pinned)


def test_a_developable_surface_flattens_without_distortion() -> None:
    surface, exact = half_cylinder(24, 16)
    assert singular(surface, exact) == pytest.approx(1.0)
    uv = flatten(surface, 30)
    assert mean_distortion(surface, uv) < 1.0001
    spread, expected = (np.linalg.norm(points - points[0], axis=1) for points in (uv, exact))
    assert spread == pytest.approx(expected, abs=0.01)


def test_a_shrunk_surface_gives_a_shrunk_flattening() -> None:
    surface = sample("cloth", 12)
    small = Surface(0.01 * surface.vertices, surface.faces)
    assert mean_distortion(small, flatten(small, 10)) == pytest.approx(
        mean_distortion(surface, flatten(surface, 10)), rel=1e-3
    )


@pytest.mark.parametrize("share", [0.1, 0.3, 0.5])
def test_a_spherical_cap_flattens_with_the_distortion_its_curvature_asks_for(share: float) -> None:
    """Archimedes: no map of a cap is exact; the more of the sphere, the worse."""
    sphere = sample("sphere", 48)
    cap = without(sphere, sphere.triangles.mean(axis=1)[:, 2] < 1.0 - 2.0 * share)
    uv = flatten(cap, 25)
    assert_valid(cap, uv)
    bend = 1.0 - mean_distortion(cap, uv)
    assert -0.5 * share**2 < bend < -0.05 * share**2


def test_a_hole_is_filled_by_a_fan_around_its_middle() -> None:
    ring = without(sample("cloth", 12), np.linalg.norm(sample("cloth", 12).triangles.mean(axis=1), axis=1) < 0.3)
    outer, hole = sorted_loops(ring)
    assert loop_length(ring, outer) > loop_length(ring, hole)
    filled = fill_holes(ring, [hole])
    assert euler_characteristic(filled.faces) == 1
    assert len(boundary_loops(filled.faces)) == 1
    assert np.array_equal(filled.faces[: len(ring.faces)], ring.faces)
    assert filled.vertices[-1] == pytest.approx(ring.vertices[hole].mean(axis=0))


def test_the_longest_loop_is_the_outer_one_however_few_vertices_it_has() -> None:
    """A square with a finely cut hole."""
    angle = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    hole = 0.2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    square = np.array([[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]])
    nearest = ((hole[:, None] - square) ** 2).sum(axis=2).argmin(axis=1)
    faces = [[i, 40 + nearest[i], (i + 1) % 40] for i in range(40)]
    faces += [[(i + 1) % 40, 40 + nearest[i], 40 + nearest[(i + 1) % 40]] for i in range(40)]
    faces = np.array([face for face in faces if len(set(face)) == 3], dtype=np.int64)
    vertices = np.concatenate([hole, square])
    surface = Surface(np.concatenate([vertices, np.zeros((44, 1))], axis=1), faces)
    assert sorted(sorted_loops(surface)[0].tolist()) == [40, 41, 42, 43]


def test_holes_stay_open_and_nothing_overlaps() -> None:
    cloth = sample("cloth", 24)
    centre = cloth.triangles.mean(axis=1)[:, :2]
    holes = [(np.linalg.norm(centre - place, axis=1) < 0.25) for place in ([0.5, 0.5], [-0.5, -0.4])]
    surface = without(cloth, np.any(holes, axis=0))
    uv = flatten(surface, 20)
    assert uv.shape == (len(surface.vertices), 2)
    assert_valid(surface, uv)
    assert mean_distortion(surface, uv) < 1.1
    for hole in sorted_loops(surface)[1:]:
        x, y = uv[hole].T
        area = 0.5 * (x * np.roll(y, -1) - y * np.roll(x, -1)).sum()
        assert area == pytest.approx(-np.pi * 0.25**2, rel=0.3)  # a hole runs the other way round


@pytest.mark.parametrize("name", ["spot", "bunny"])
def test_a_round_patch_of_a_real_mesh_flattens_without_flips(name: str, models: Path) -> None:
    surface = load_asset(models / f"{name}.obj").surface
    centre = surface.triangles.mean(axis=1)
    far = np.linalg.norm(centre - centre[0], axis=1) > 0.1 * np.ptp(surface.vertices, axis=0).max()
    patch = without(surface, far)
    assert euler_characteristic(patch.faces) == 1  # else choose another patch
    uv = flatten(patch, 10)
    assert not flipped_triangles(uv[patch.faces]).any()
    assert mean_distortion(patch, uv) < 1.2
