"""Polygons: fans where they are convex, ears where they are not, and always the area of the polygon."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from flexpara.runtime.io.polygons import clip_ears, fans, triangulate

L_HEXAGON = [(2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 0)]


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Signed, against +z."""
    corner = points[triangles]
    return 0.5 * np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2]


def flat(loop: Sequence[Sequence[float]]) -> np.ndarray:
    return np.column_stack([np.array(loop, dtype=np.float64), np.zeros(len(loop))])


def one(points: np.ndarray) -> np.ndarray:
    """The triangles of a single polygon."""
    triangles, polygon = triangulate(points, np.arange(len(points)), np.array([len(points)]))
    assert (polygon == 0).all()
    return triangles


def test_a_triangle_stays_and_a_square_becomes_a_fan() -> None:
    assert one(flat([(0, 0), (1, 0), (0, 1)])).tolist() == [[0, 1, 2]]
    assert one(flat([(0, 0), (1, 0), (1, 1), (0, 1)])).tolist() == [[0, 1, 2], [0, 2, 3]]


def test_fans_number_corners_through_all_polygons() -> None:
    triangles, polygon = fans(np.array([3, 5]))
    assert triangles.tolist() == [[0, 1, 2], [3, 4, 5], [3, 5, 6], [3, 6, 7]]
    assert polygon.tolist() == [0, 1, 1, 1]


@pytest.mark.parametrize("start", range(6))
def test_a_concave_hexagon_keeps_its_area_wherever_it_starts(start: int) -> None:
    points = np.roll(flat(L_HEXAGON), start, axis=0)
    area = areas(points, one(points))
    assert (area > 0).all()
    assert area.sum() == 3.0


def test_a_dart_is_cut_along_the_diagonal_inside() -> None:
    points = flat([(0, 0), (2, 1), (0, 2), (1, 1)])  # the last corner turns right; the fan from it is the only good one
    assert areas(points, one(points)).min() > 0
    assert areas(points, one(points)).sum() == pytest.approx(1.0)


def test_a_corner_in_the_middle_of_an_edge_costs_no_area_and_leaves_no_flat_triangle() -> None:
    points = flat([(0, 0), (1, 0), (2, 0), (3, 0), (3, 3), (0, 3)])
    assert areas(points, one(points)).min() > 0.1
    assert areas(points, one(points)).sum() == pytest.approx(9.0)


def test_a_hole_joined_by_a_bridge_stays_a_hole() -> None:
    outer, inner = [(0, 0), (4, 0), (4, 4), (0, 4), (0, 0)], [(1, 1), (1, 3), (3, 3), (3, 1), (1, 1)]
    points = flat([*outer, *inner])
    area = areas(points, one(points))
    assert (area >= 0).all()
    assert area.sum() == pytest.approx(12.0)


@pytest.mark.parametrize("seed", range(20))
def test_random_stars_keep_area_and_orientation_in_space(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0, 2 * np.pi, 40))
    angle = angle[np.concatenate([[True], np.diff(angle) > 1e-3])]
    loop = rng.uniform(0.2, 1.0, len(angle))[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    if np.diff(np.append(angle, angle[0] + 2 * np.pi)).max() > 3.0:
        pytest.skip("the star does not see its own corners")
    turned, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    turned = turned * np.sign(np.linalg.det(turned))
    points = flat(loop.tolist()) @ turned.T * 1e-4 + rng.normal(size=3) * 5.0
    corner = points[one(points)]
    cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]) @ turned[:, 2] / 2e-8
    true = 0.5 * (loop[:, 0] * np.roll(loop[:, 1], -1) - np.roll(loop[:, 0], -1) * loop[:, 1]).sum()
    assert (cross > -1e-9).all()
    assert cross.sum() == pytest.approx(true, rel=1e-6)


def test_polygons_that_cross_themselves_or_have_no_area_end() -> None:
    assert len(one(flat([(0, 0), (1, 1), (1, 0), (0, 1)]))) == 2
    assert len(one(flat([(0, 0), (1, 0), (2, 0), (3, 0)]))) == 2
    assert len(one(np.zeros((5, 3)))) == 3
    assert len(one(np.full((4, 3), np.nan))) == 2
    rng = np.random.default_rng(0)
    for size in range(4, 30):
        triangles = clip_ears(rng.normal(size=(size, 2)))
        assert triangles.shape == (size - 2, 3)


def test_a_thousand_corners_of_a_gear_are_cut_in_a_moment() -> None:
    angle = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    radius = np.where(np.arange(1000) % 4 < 2, 1.0, 0.9)
    points = flat((radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])).tolist())
    area = areas(points, one(points))
    assert (area > 0).all()
    x, y = points[:, 0], points[:, 1]
    assert area.sum() == pytest.approx(0.5 * (x * np.roll(y, -1) - np.roll(x, -1) * y).sum())
