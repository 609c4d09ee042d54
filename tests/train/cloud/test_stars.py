"""Delaunay stars: by hand, against Qhull, and on curved surfaces."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import Delaunay

from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.train.cloud.config import CloudConfig
from flexpara.train.cloud.normals import local_spacing, nearest_neighbours
from flexpara.train.cloud.stars import circumradius, rolled_neighbours, star_candidates, star_pairs, stars

CONFIG = CloudConfig()


def test_the_circumradius_of_a_right_triangle_is_half_its_hypotenuse() -> None:
    triangles = np.array([[[0.0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 0, 0], [1, 0, 0], [2, 0, 0]]])
    np.testing.assert_allclose(circumradius(triangles), [2.5, np.inf])


def test_the_star_of_four_neighbours_in_a_cross_is_four_triangles() -> None:
    cross = np.array([[[1.0, 0.1], [0.0, 1.0], [-1.1, 0.0], [0.0, -1.2], [3.0, 3.0], [np.nan, np.nan]]])
    row, first, second = star_pairs(cross, CONFIG.star_points)
    assert set(zip(first.tolist(), second.tolist(), strict=True)) == {(0, 1), (1, 2), (2, 3), (3, 0)}
    assert (row == 0).all()


def test_a_star_at_a_corner_is_open() -> None:
    corner = np.array([[[1.0, 0.0], [0.0, 1.2], [0.9, 0.9]]])
    _, first, second = star_pairs(corner, CONFIG.star_points)
    assert set(zip(first.tolist(), second.tolist(), strict=True)) == {(0, 2), (2, 1)}


def test_rows_with_fewer_than_two_neighbours_have_no_star() -> None:
    flat = np.full((3, 4, 2), np.nan)
    flat[1, 0] = 1.0
    assert all(len(column) == 0 for column in star_pairs(flat, CONFIG.star_points))


def test_stars_in_the_plane_are_those_of_the_delaunay_triangulation() -> None:
    points = np.random.default_rng(2).random((400, 2))
    flat = points[None] - points[:, None]
    flat[np.arange(400), np.arange(400)] = np.nan
    row, first, second = star_pairs(flat, CONFIG.star_points)
    stars, votes = np.unique(np.sort(np.stack([row, first, second], axis=1), axis=1), axis=0, return_counts=True)
    expected = np.sort(Delaunay(points).simplices, axis=1)
    np.testing.assert_array_equal(stars, expected[np.lexsort(expected.T[::-1])])
    assert (votes == 3).all()


def test_rolling_keeps_distance_and_leaves_out_what_is_steep_or_on_the_other_side() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 1], [0, 0.01, 1], [1, 0, 0]])
    normals = np.array([[0.0, 0, 1], [0, 0, 1], [0, 0, 1], [0, 0, -1]])
    flat = rolled_neighbours(points, normals, np.array([0]), np.array([[1, 2, 3]]), CONFIG)[0]
    assert np.linalg.norm(flat[0]) == pytest.approx(np.sqrt(2.0))
    assert np.isnan(flat[1:]).all()


def test_nearly_all_triangles_of_a_sphere_are_seen_by_three_corners_and_face_outwards() -> None:
    points = np.random.default_rng(3).normal(size=(3000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    index, distance = nearest_neighbours(points, CONFIG.neighbours)
    found = star_candidates(points, points, index, local_spacing(distance), CONFIG)
    assert (found.votes == 3).mean() > 0.97
    corner = points[found.corners]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    assert ((normal * corner.mean(axis=1)).sum(axis=1) > 0.0).all()
    assert found.radius.max() <= CONFIG.circumradius


@pytest.mark.parametrize("name", ["sphere", "thin sheet", "few"])
def test_the_kernels_stars_are_its_twins(name: str) -> None:
    if kernel() is None:
        pytest.skip("nothing was compiled")
    rng = np.random.default_rng(6)
    points = rng.normal(size=(40 if name == "few" else 9000, 3))
    normals = points / np.linalg.norm(points, axis=1, keepdims=True)
    points = points * [1.0, 1.0, 0.01] if name == "thin sheet" else normals
    index, _ = nearest_neighbours(points, CONFIG.neighbours)
    found = stars(points, normals, index, CONFIG)
    with twins_only():
        expected = stars(points, normals, index, CONFIG)
    assert len(found) > len(points)
    assert np.array_equal(found[np.lexsort(found.T)], expected[np.lexsort(expected.T)])
