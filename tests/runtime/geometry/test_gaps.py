"""Gaps between charts: two squares by hand, then random rectangles against the distance of every pair of segments."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.geometry.gaps import (
    closest_points,
    facing_segments,
    near_segments,
    sample_segments,
    segment_distance,
    smallest_chart_gap,
    spread,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray


def box(x: float, y: float, w: float, h: float) -> NDArray[np.float64]:
    corner = np.array([[x, y], [x + w, y], [x + w, y + h], [x, y + h]])
    return np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)


def gap(*boxes: NDArray[np.float64], spacing: float = 0.1) -> float | None:
    chart = np.repeat(np.arange(len(boxes)), 4)
    return smallest_chart_gap(np.concatenate(boxes), chart, spacing=spacing)


@pytest.mark.parametrize("spacing", [0.01, 0.5, 3.0])
def test_the_gap_of_two_squares_is_exact_however_coarse_the_samples(spacing: float) -> None:
    assert gap(box(0, 0, 1, 1), box(1.3, 0.1, 1, 1), spacing=spacing) == pytest.approx(0.3, abs=1e-12)


def test_charts_that_touch_have_no_gap() -> None:
    assert gap(box(0, 0, 1, 1), box(1, 0.05, 1, 1)) == 0.0
    assert gap(box(0, 0, 1, 1), box(1, 1, 1, 1)) == 0.0


def test_one_chart_has_no_gap_to_measure() -> None:
    assert gap(box(0, 0, 1, 1)) is None


def test_distances_of_segments_by_hand() -> None:
    first = np.array([[[0.0, 0.0], [2.0, 0.0]]] * 4)
    second = np.array([[[1, 1], [1, 3]], [[3, 0], [4, 0]], [[1, -1], [1, 1]], [[3, 1], [3, 4]]], dtype=np.float64)
    assert segment_distance(first, second) == pytest.approx([1.0, 1.0, 0.0, np.sqrt(2.0)])


def test_samples_hold_the_ends_and_lie_close() -> None:
    points, owner = sample_segments(np.array([[[0.0, 0.0], [1.0, 0.0]], [[0.0, 0.0], [0.0, 0.1]]]), 0.3)
    assert owner.tolist() == [0] * 5 + [1] * 2
    assert points[:5, 0].tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]


@pytest.mark.parametrize("seed", range(5))
def test_random_rectangles_agree_with_all_pairs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell = rng.permutation(36)[:12]
    low = np.stack([cell % 6, cell // 6], axis=1) + rng.uniform(0.02, 0.3, (12, 2))
    boxes = [box(x, y, *rng.uniform(0.2, 0.68, 2)) for x, y in low.tolist()]
    segments, chart = np.concatenate(boxes), np.repeat(np.arange(12), 4)
    i, j = np.nonzero(chart[:, None] < chart[None, :])
    expected = segment_distance(segments[i], segments[j]).min()
    assert gap(*boxes, spacing=0.05) == pytest.approx(expected, abs=1e-12)
    pairs = facing_segments(segments, chart, spacing=0.05, reach=0.1)
    assert (chart[pairs[:, 0]] != chart[pairs[:, 1]]).all()
    near = {tuple(pair) for pair in near_segments(segments, chart, spacing=0.05, reach=0.2).tolist()}
    close = segment_distance(segments[i], segments[j]) <= 0.2
    assert near >= set(zip(i[close].tolist(), j[close].tolist(), strict=True))
    assert all(chart[one] != chart[other] for one, other in near)


def test_outlines_of_thousands_of_short_segments_have_the_pairs_of_all_with_all() -> None:
    """Two rings of radius 1, 0.1 apart: only what faces the other ring is near it."""
    angle = np.linspace(0.0, 2.0 * np.pi, 3001)
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    one = np.stack([ring[:-1], ring[1:]], axis=1)
    segments, chart = np.concatenate([one, one + np.array([2.1, 0.0])]), np.repeat([0, 1], 3000)
    pairs = near_segments(segments, chart, spacing=0.05, reach=0.15)
    i, j = (rows.reshape(-1) for rows in np.meshgrid(np.arange(3000), 3000 + np.arange(3000), indexing="ij"))
    facing = np.linalg.norm(segments[i, 0] - segments[j, 0], axis=1) < 0.2
    i, j = i[facing], j[facing]
    close = segment_distance(segments[i], segments[j]) <= 0.15
    assert {tuple(pair) for pair in pairs.tolist()} >= set(zip(i[close].tolist(), j[close].tolist(), strict=True))
    assert segment_distance(segments[pairs[:, 0]], segments[pairs[:, 1]]).max() < 0.16
    assert smallest_chart_gap(segments, chart, spacing=0.01) == pytest.approx(0.1, abs=1e-5)


def test_one_segment_stands_for_those_of_its_chart_in_a_square() -> None:
    segments = np.concatenate([box(0.0, 0.0, 0.1, 0.1), box(0.0, 0.0, 0.1, 0.1), box(5.0, 5.0, 3.0, 3.0)])
    chart = np.repeat([0, 1, 1], 4)
    assert spread(segments, chart, cell=1.0).tolist() == [0, 4, 8, 9, 10, 11]


def test_closest_points_lie_on_their_segments() -> None:
    rng = np.random.default_rng(1)
    first, second = rng.random((200, 2, 2)), rng.random((200, 2, 2)) + np.array([2.0, 0.0])
    one, two = closest_points(first, second)
    assert np.linalg.norm(one - two, axis=1) == pytest.approx(segment_distance(first, second))
    for point, segment in ((one, first), (two, second)):
        detour = np.linalg.norm(point - segment[:, 0], axis=1) + np.linalg.norm(point - segment[:, 1], axis=1)
        assert detour == pytest.approx(np.linalg.norm(segment[:, 1] - segment[:, 0], axis=1))
