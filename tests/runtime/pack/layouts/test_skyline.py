"""Profiles and drops: a square and a triangle by hand, squares in a row, a lid on a box; then random charts, apart."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.pack.layouts.skyline import drop, profile


def outline(*corners: tuple[float, float]) -> NDArray[np.float64]:
    """Outline (s, 2, 2) of a polygon."""
    points = np.array(corners, dtype=np.float64)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


SQUARE = outline((5.0, 7.0), (7.0, 7.0), (7.0, 9.0), (5.0, 9.0))
TRIANGLE = outline((0.0, 0.0), (4.0, 0.0), (0.0, 4.0))


def test_a_square_is_as_low_and_as_high_as_it_is() -> None:
    found = profile(SQUARE, 0.0)
    assert found.low.tolist() == [0.0, 0.0]
    assert found.high.tolist() == [2.0, 2.0]
    assert found.offset.tolist() == [-5.0, -7.0]
    assert profile(SQUARE, 0.5).offset.tolist() == [-4.5, -6.5]
    assert len(profile(SQUARE, 0.5).low) == 3


def test_a_slope_counts_in_a_column_with_its_highest_point() -> None:
    assert profile(TRIANGLE, 0.0).high.tolist() == [4.0, 3.0, 2.0, 1.0]


def test_padding_surrounds_a_chart_as_a_disc_does() -> None:
    found = profile(SQUARE, 1.0)
    assert found.low.tolist() == [0.0, 0.0, 0.0, 0.0]
    assert found.high.tolist() == [4.0, 4.0, 4.0, 4.0]
    wide = profile(SQUARE, 2.5)
    assert wide.high.max() == 7.0
    assert wide.high[0] == pytest.approx(4.5 + np.sqrt(5.25))  # the square begins in the second column from there


def test_upside_down_twice_is_the_same_again() -> None:
    found = profile(TRIANGLE, 1.5)
    again = found.turned.turned
    assert again.looks_like(found)
    assert again.offset == pytest.approx(found.offset)
    assert not found.turned.looks_like(found)


def test_turned_profiles_are_those_of_turned_outlines() -> None:
    one, other = profile(TRIANGLE, 0.5).turned, profile(-TRIANGLE, 0.5)
    assert one.looks_like(other)
    assert one.offset == pytest.approx(other.offset)


def test_squares_fill_a_row_before_they_pile_up() -> None:
    found = drop([[profile(SQUARE, 0.0)]] * 4, np.arange(4), 4, tightness=1.0)
    assert found is not None
    assert found.origin.tolist() == [[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]]
    assert found.height == 4.0


def test_a_triangle_turned_upside_down_closes_the_square() -> None:
    shape = profile(TRIANGLE, 0.0)
    found = drop([[shape, shape.turned]] * 2, np.arange(2), 4, tightness=1.0)
    assert found is not None
    assert found.angle.tolist() == [0, 1]
    assert found.height == pytest.approx(5.0)  # the slope costs a column


def test_a_chart_wider_than_the_columns_is_not_placed_and_a_tower_is_given_up() -> None:
    shape = profile(SQUARE, 0.0)
    assert drop([[shape]], np.arange(1), 1, tightness=1.0) is None
    assert drop([[shape]] * 3, np.arange(3), 2, tightness=1.0, most=5.0) is None


@pytest.mark.parametrize("seed", range(4))
def test_dropped_charts_keep_twice_the_padding(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = np.sort(rng.uniform(0.0, 2.0 * np.pi, (12, 7)), axis=1)
    radius = rng.uniform(1.0, 6.0, (12, 7))
    outlines = [outline(*zip(r * np.cos(a), r * np.sin(a), strict=True)) for r, a in zip(radius, angles, strict=True)]
    padding = float(rng.uniform(0.0, 2.5))
    shapes = [profile(part, padding) for part in outlines]
    found = drop([[shape, shape.turned] for shape in shapes], np.arange(12), 40, tightness=1.0)
    assert found is not None
    placed = []
    for part, shape, angle, origin in zip(outlines, shapes, found.angle, found.origin, strict=True):
        chosen = shape.turned if angle else shape
        share = np.linspace(0.0, 1.0, 60)[:, None]
        points = (part[:, None, 0] * (1.0 - share) + part[:, None, 1] * share).reshape(-1, 2)
        placed.append((-points if angle else points) + chosen.offset + origin)
    for number, one in enumerate(placed):
        assert one.min() >= padding - 1e-9
        assert one[:, 0].max() <= 40.0 - padding + 1e-9
        for other in placed[number + 1 :]:
            assert np.linalg.norm(one[:, None] - other[None], axis=2).min() >= 2.0 * padding - 1e-9


@pytest.mark.skipif(kernel() is None, reason="nothing was compiled")
@pytest.mark.parametrize("seed", range(6))
def test_the_kernel_drops_charts_where_its_twin_does(seed: int) -> None:
    rng = np.random.default_rng(seed)
    shapes = [profile(rng.uniform(0.0, 9.0, (5, 2, 2)), 0.7) for _ in range(30)]
    charts = [[shape, shape.turned][: 1 + number % 2] for number, shape in enumerate(shapes)]
    order, most = rng.permutation(30), (np.inf, 30.0, 200.0)[seed % 3]
    found = drop(charts, order, 24, tightness=0.8, most=most)
    with twins_only():
        expected = drop(charts, order, 24, tightness=0.8, most=most)
    assert (found is None) == (expected is None) == (most == 30.0)
    if found is not None and expected is not None:
        assert found.angle.tolist() == expected.angle.tolist()
        assert found.origin.tolist() == expected.origin.tolist()
        assert found.skyline.tolist() == expected.skyline.tolist()
