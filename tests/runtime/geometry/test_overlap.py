"""Exact overlap: signs by rational arithmetic, triangles by hand, grids, soups against adobe-lagrange, real meshes."""

from __future__ import annotations

from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.overlap import (
    flipped_triangles,
    orientation_sign,
    overlap_area,
    overlap_fraction,
    overlapping_pairs,
)
from flexpara.runtime.geometry.triangles import signed_areas

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

UNIT = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])


def exact_sign(triangle: NDArray[np.float64]) -> int:
    (ax, ay), (bx, by), (cx, cy) = [[Fraction(value) for value in point] for point in triangle.tolist()]
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    return (area > 0) - (area < 0)


def grid(n: int, angle: float) -> NDArray[np.float64]:
    point = np.stack(np.meshgrid(np.arange(n + 1.0), np.arange(n + 1.0), indexing="ij"), axis=-1)
    point = point @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    a, b, c, d = point[:-1, :-1], point[1:, :-1], point[1:, 1:], point[:-1, 1:]
    return np.concatenate([np.stack([a, b, c], 2).reshape(-1, 3, 2), np.stack([a, c, d], 2).reshape(-1, 3, 2)])


def lagrange_overlap(uv: NDArray[np.float64]) -> tuple[NDArray[np.int64], float]:
    lagrange = pytest.importorskip("lagrange")
    corners = np.arange(uv.shape[0] * 3, dtype=np.uint32)
    mesh = lagrange.SurfaceMesh()
    mesh.add_vertices(np.concatenate([uv.reshape(-1, 2), np.zeros((len(corners), 1))], axis=1))
    mesh.add_triangles(corners.reshape(-1, 3))
    mesh.create_attribute(
        "@uv",
        element=lagrange.AttributeElement.Indexed,
        usage=lagrange.AttributeUsage.UV,
        initial_values=np.ascontiguousarray(uv.reshape(-1, 2)),
        initial_indices=corners,
    )
    found = lagrange.bvh.compute_uv_overlap(mesh, uv_attribute_name="@uv", compute_overlapping_pairs=True)
    pairs = sorted(tuple(sorted(pair)) for pair in found.overlapping_pairs)
    return np.array(pairs, dtype=np.int64).reshape(-1, 2), found.overlap_area or 0.0


def test_signs_of_one_triangle_its_mirror_and_its_shadow() -> None:
    triangles = np.stack([UNIT, UNIT[::-1], UNIT * [1.0, 0.0]])
    assert orientation_sign(triangles[:, 0], triangles[:, 1], triangles[:, 2]).tolist() == [1, -1, 0]
    assert flipped_triangles(triangles).tolist() == [False, True, True]


def test_signs_equal_rational_arithmetic_where_float64_is_wrong() -> None:
    rng = np.random.default_rng(0)
    along = rng.random((3000, 1, 2)) + rng.random((3000, 3, 1)) * rng.random((3000, 1, 2))
    lattice = 0.1 * rng.integers(0, 4, (3000, 3, 2)) + 0.5
    tiny = np.ldexp(rng.integers(-3, 4, (3000, 3, 2)).astype(np.float64), rng.integers(-1070, -500, (3000, 3, 2)))
    triangles = np.concatenate([along, lattice, tiny]).astype(np.float64)
    exact = [exact_sign(triangle) for triangle in triangles]
    assert orientation_sign(triangles[:, 0], triangles[:, 1], triangles[:, 2]).tolist() == exact
    assert np.sign(signed_areas(triangles)).tolist() != exact


@pytest.mark.parametrize(
    ("shift", "meets"),
    [((0.0, 0.0), True), ((0.5, 0.25), True), ((1.0, 0.0), False), ((0.5, 0.5), False), ((-1.0, 0.0), False)],
)
def test_two_triangles_meet_only_where_their_interiors_do(shift: tuple[float, float], meets: bool) -> None:
    for other in (UNIT + shift, (UNIT + shift)[::-1]):
        assert overlapping_pairs(np.stack([UNIT, other])).tolist() == ([[0, 1]] if meets else [])


def test_a_gap_or_an_overlap_of_one_unit_in_the_last_place_is_seen() -> None:
    edge = np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    below = edge.copy()
    below[0, 0] = np.nextafter(1.0, 0.0)
    assert len(overlapping_pairs(np.stack([UNIT, edge]))) == 0
    assert len(overlapping_pairs(np.stack([UNIT, below]))) == 1


def test_triangles_without_area_have_no_interior() -> None:
    line = np.array([[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]])
    assert len(overlapping_pairs(np.stack([UNIT, line, line]))) == 0
    assert len(overlapping_pairs(line[None])) == 0
    assert len(overlapping_pairs(np.zeros((0, 3, 2)))) == 0


def test_areas_of_intersections_by_hand() -> None:
    triangles = np.stack([UNIT, UNIT, UNIT[::-1] + 0.25, 1.0 - UNIT, UNIT * 0.5 + 0.1, UNIT + np.array([0.5, 0.0])])
    for pair, area in (((0, 1), 0.5), ((0, 2), 0.125), ((0, 3), 0.0), ((0, 4), 0.125), ((0, 5), 0.125)):
        assert overlap_area(triangles, np.array([pair])) == pytest.approx(area, abs=1e-15)


def test_the_fraction_is_overlap_over_area() -> None:
    assert overlap_fraction(np.stack([UNIT, UNIT])) == pytest.approx(0.5)
    assert overlap_fraction(np.stack([UNIT, UNIT + 2.0])) == 0.0


@pytest.mark.parametrize("angle", [0.0, 0.3])
def test_a_grid_does_not_overlap_itself_however_it_is_turned(angle: float) -> None:
    assert len(overlapping_pairs(grid(30, angle) / 30)) == 0


def test_a_folded_grid_overlaps_exactly_where_it_is_folded() -> None:
    uv = grid(20, 0.0)
    uv[..., 0] = np.abs(uv[..., 0] - 10.0)
    pairs = overlapping_pairs(uv)
    assert np.unique(pairs).tolist() == list(range(800))
    assert overlap_area(uv, pairs) == pytest.approx(200.0)


def test_triangles_of_all_sizes_find_each_other() -> None:
    small = np.concatenate([UNIT * 0.01 + offset for offset in np.random.default_rng(0).random((500, 1, 2)) * 0.4])
    small = small.reshape(-1, 3, 2)
    pairs = overlapping_pairs(np.concatenate([small, UNIT[None]]))
    inside = [[i, 500] for i in range(500)]
    assert pairs[pairs[:, 1] == 500].tolist() == inside


@pytest.mark.parametrize("seed", range(8))
def test_random_soups_agree_with_lagrange(seed: int) -> None:
    rng = np.random.default_rng(seed)
    lattice = rng.integers(0, 5, (60, 3, 2)).astype(float)
    mixed = rng.random((400, 1, 2)) + 10.0 ** rng.uniform(-4.0, -0.5, (400, 1, 1)) * rng.normal(size=(400, 3, 2))
    for uv in (lattice, mixed):
        pairs, area = lagrange_overlap(uv)
        assert np.array_equal(overlapping_pairs(uv), pairs)
        assert overlap_area(uv, pairs) == pytest.approx(area, rel=1e-9)


def test_the_same_mesh_scaled_shifted_and_mirrored_has_the_same_pairs() -> None:
    uv = np.random.default_rng(3).integers(0, 64, (300, 3, 2)).astype(float)
    pairs = overlapping_pairs(uv)
    assert len(pairs) > 100
    assert np.array_equal(overlapping_pairs(uv * 2.0**-40), pairs)
    assert np.array_equal(overlapping_pairs(uv * [-1.0, 1.0] + 2.0**20), pairs)


def test_a_flat_projection_of_bunny_agrees_with_lagrange(models: Path) -> None:
    mesh = trimesh.load_mesh(models / "bunny.obj", process=False, skip_materials=True)
    triangles = np.asarray(mesh.vertices)[np.asarray(mesh.faces)]
    front = triangles[mesh.face_normals[:, 2] > 0.8][:, :, :2]
    pairs, area = lagrange_overlap(front)
    assert len(pairs) > 100
    assert np.array_equal(overlapping_pairs(front), pairs)
    assert overlap_area(front, pairs) == pytest.approx(area, rel=1e-9)


@pytest.mark.parametrize("turn", [0.0, 0.4, 0.75, 2.0])
def test_of_needles_side_by_side_those_that_overlap_are_found_however_they_lie(turn: float) -> None:
    row = np.arange(40.0)[:, None, None] * [0.0, 1e-3]
    needles = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1e-3]]) + row
    needles[7, 2] += [0.0, 0.5e-3]  # its tip lies in the needle beside it
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    pairs = overlapping_pairs(needles @ rotation.T).tolist()
    assert [7, 8] in pairs
    assert all(second - first == 1 for first, second in pairs)
