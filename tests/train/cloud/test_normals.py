"""Neighbours, fitted planes and their orientation, on shapes whose normals are known."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.samples import make_sample
from flexpara.train.cloud.config import CloudConfig
from flexpara.train.cloud.normals import (
    disagreement,
    fitted_normals,
    local_spacing,
    nearest_neighbours,
    oriented_normals,
    thinned_out,
    turned_to,
)

CONFIG = CloudConfig()


def sphere(n: int) -> np.ndarray:
    points = np.random.default_rng(5).normal(size=(n, 3))
    return points / np.linalg.norm(points, axis=1, keepdims=True)


def unoriented(points: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Oriented normals from positions alone, neighbours and spacing."""
    index, distance = nearest_neighbours(points, CONFIG.neighbours)
    spacing = local_spacing(distance)
    fitted = fitted_normals(points, index, distance, CONFIG)
    return oriented_normals(points, fitted, index, spacing, CONFIG), index, spacing


def test_neighbours_on_a_line_are_those_beside_it() -> None:
    points = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [3.0, 0.0, 0.0]])
    index, distance = nearest_neighbours(points, 8)
    np.testing.assert_array_equal(index, [[1, 2], [0, 2], [1, 0]])
    np.testing.assert_array_equal(distance, [[1, 3], [1, 2], [2, 3]])


def test_the_spacing_of_uniform_samples_is_one_over_the_root_of_their_density() -> None:
    points = sphere(8000)
    spacing = local_spacing(nearest_neighbours(points, 8)[1])
    assert np.median(spacing) == pytest.approx(np.sqrt(4.0 * np.pi / 8000), rel=0.05)


def test_points_of_a_plane_have_its_normal() -> None:
    points = np.random.default_rng(0).random((300, 3)) * [1.0, 1.0, 0.0]
    normals, _, _ = unoriented(points @ np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0])
    np.testing.assert_allclose(np.abs(normals @ normals[0]), 1.0, atol=1e-10)


@pytest.mark.parametrize("n", [200, 8000])
def test_normals_of_a_sphere_point_outwards(n: int) -> None:
    points = sphere(n)
    cosine = (unoriented(points + 5.0)[0] * points).sum(axis=1)
    assert cosine.min() > 1.0 - 20.0 / n


def test_normals_of_a_torus_point_outwards_also_inside_its_hole() -> None:
    points, _ = make_sample("torus", resolution=72)
    ring = points * [1.0, 1.0, 0.0]
    centre = ring / np.linalg.norm(ring, axis=1, keepdims=True)
    centre *= np.linalg.norm(ring, axis=1).mean()
    assert ((unoriented(points)[0] * (points - centre)).sum(axis=1) > 0.0).all()


def test_each_of_two_pieces_is_oriented_by_itself() -> None:
    points = np.concatenate([sphere(1500), 0.5 * sphere(1500) + [9.0, 0.0, 0.0]])
    normals = unoriented(points)[0]
    outward = points - np.where(points[:, :1] > 4.0, [[9.0, 0.0, 0.0]], [[0.0, 0.0, 0.0]])
    assert ((normals * outward).sum(axis=1) > 0.0).all()


def test_noise_of_a_tenth_of_the_spacing_turns_no_normal() -> None:
    points = sphere(6000)
    noise = 0.1 * np.sqrt(4.0 * np.pi / 6000) * np.random.default_rng(6).normal(size=points.shape)
    cosine = (unoriented(points + noise)[0] * points).sum(axis=1)
    assert cosine.min() > 0.8


def test_given_normals_decide_about_the_side_and_keep_thin_sheets_apart() -> None:
    rng = np.random.default_rng(7)
    up = np.arange(4000) % 2 == 0
    points = np.column_stack([rng.random((4000, 2)), np.where(up, 0.005, -0.005)])  # a third of the spacing
    given = np.where(up[:, None], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
    index, distance = nearest_neighbours(points, CONFIG.neighbours)
    normals = fitted_normals(points, index, distance, CONFIG, given)
    np.testing.assert_allclose(normals, given, atol=1e-8)
    assert np.abs(fitted_normals(points, index, distance, CONFIG)[:, 2]).min() < 0.9  # without them it goes wrong


def test_random_signs_disagree_at_every_second_link_and_oriented_ones_nowhere() -> None:
    points = sphere(2000)
    index, _ = nearest_neighbours(points, 8)
    sign = np.random.default_rng(8).choice([-1.0, 1.0], (2000, 1))
    assert disagreement(points, points, index, CONFIG) == 0.0
    assert disagreement(points, sign * points, index, CONFIG) == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("outside", [1.0, -1.0])
def test_a_thin_sheet_and_a_narrow_gap_are_no_disagreement(outside: float) -> None:
    up = np.arange(3000) % 2 == 0
    side = np.where(up, 1.0, -1.0)[:, None] * [[0.0, 0.0, 1.0]]
    points = np.column_stack([np.random.default_rng(17).random((3000, 2)), np.zeros(3000)]) + 0.005 * side
    index, _ = nearest_neighbours(points, 8)
    assert disagreement(points, outside * side, index, CONFIG) == 0.0


def test_unknown_normals_take_the_side_of_known_ones_nearby() -> None:
    points = sphere(2000)
    index, _ = nearest_neighbours(points, 8)
    given = np.where(np.random.default_rng(9).random((2000, 1)) < 0.3, 0.0, -points)
    np.testing.assert_array_equal(turned_to(points, given, index), -points)


@pytest.mark.parametrize("noise", [0.0, 0.02])
def test_the_kernels_planes_are_its_twins_up_to_their_sign(noise: float) -> None:
    if kernel() is None:
        pytest.skip("nothing was compiled")
    points = sphere(9000) + noise * np.random.default_rng(7).normal(size=(9000, 3))
    index, distance = nearest_neighbours(points, CONFIG.neighbours)
    found = fitted_normals(points, index, distance, CONFIG)
    with twins_only():
        expected = fitted_normals(points, index, distance, CONFIG)
    np.testing.assert_allclose(np.abs((found * expected).sum(axis=1)), 1.0, atol=1e-6)


def test_thinning_out_leaves_the_neighbours_that_a_fresh_search_finds() -> None:
    rng = np.random.default_rng(8)
    points = sphere(2000)
    points = np.concatenate([points, points[:300] + 1e-5 * rng.normal(size=(300, 3))])[rng.permutation(2300)]
    chosen, index, distance = thinned_out(points, CONFIG.neighbours, CONFIG.closest)
    assert 1990 <= len(chosen) <= 2000
    fresh = nearest_neighbours(points[chosen], CONFIG.neighbours)
    np.testing.assert_array_equal(index, fresh[0])
    np.testing.assert_array_equal(distance, fresh[1])


def test_points_that_nearly_all_lie_on_one_keep_the_neighbours_there_are() -> None:
    near = 1e-9 * np.random.default_rng(9).normal(size=(60, 3))
    far = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [1.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 2.0, 0.0]])
    chosen, index, _ = thinned_out(np.concatenate([far, near]), CONFIG.neighbours, CONFIG.closest)
    assert index.shape == (len(chosen), min(CONFIG.neighbours, len(chosen) - 1))
    assert index.min() >= 0
