"""The search: one square, four squares, a pole that limits all others; padding kept and layouts repeated."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.errors import InputError
from flexpara.runtime.geometry.gaps import smallest_chart_gap
from flexpara.runtime.pack.config import PlaceConfig
from flexpara.runtime.pack.growing.outlines import rotation
from flexpara.runtime.pack.layouts.placement import Layout, find_layout

CONFIG = PlaceConfig()


def box(width: float, height: float) -> NDArray[np.float64]:
    corner = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    return np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)


def found_for(sides: NDArray[np.float64], padding: float, seed: int = 0) -> tuple[Layout, NDArray[np.float64]]:
    """The layout of boxes, and their outlines in the atlas (k, 4, 2, 2)."""
    outlines = [box(*pair) for pair in sides.tolist()]
    layout = find_layout(outlines, float(sides.prod(axis=1).sum()), padding, CONFIG, np.random.default_rng(seed))
    turned = [outline @ rotation(angle).T for outline, angle in zip(outlines, layout.angle, strict=True)]
    return layout, layout.scale * np.stack(turned) + layout.origin[:, None, None]


def assert_apart(placed: NDArray[np.float64], padding: float) -> None:
    assert placed.min() >= padding - 1e-12
    assert placed.max() <= 1.0 - padding + 1e-12
    gap = smallest_chart_gap(placed.reshape(-1, 2, 2), np.repeat(np.arange(len(placed)), 4), spacing=1.0 / 512.0)
    assert gap is None or gap >= 2.0 * padding - 1e-12


@pytest.mark.parametrize("padding", [0.0, 1.0 / 256.0, 1.0 / 64.0])
def test_squares_fill_most_of_the_square_and_keep_the_padding(padding: float) -> None:
    for count in (1, 4, 9):
        layout, placed = found_for(np.ones((count, 2)), padding)
        assert_apart(placed, padding)
        side = 1.0 / np.sqrt(count) - 2.0 * padding
        assert layout.scale > 0.93 * side


def test_boxes_of_any_shape_stand_upright_and_keep_the_padding() -> None:
    rng = np.random.default_rng(0)
    for seed in range(3):
        sides = rng.uniform(0.05, 1.0, (40, 2))
        layout, placed = found_for(sides, 1.0 / 512.0, seed)
        assert_apart(placed, 1.0 / 512.0)
        quarters = layout.angle / (np.pi / 2.0)
        assert np.array_equal(quarters, np.rint(quarters))
        assert layout.scale**2 * sides.prod(axis=1).sum() > 0.65


def test_charts_of_four_decades_leave_little_room() -> None:
    rng = np.random.default_rng(1)
    sides = rng.uniform(0.2, 1.0, (300, 2)) * 10.0 ** (-4.0 * rng.random((300, 1)))
    layout, placed = found_for(sides, 1.0 / 2048.0)
    assert_apart(placed, 1.0 / 2048.0)
    assert layout.scale**2 * sides.prod(axis=1).sum() > 0.6


def test_a_pole_too_long_for_the_square_lies_along_its_diagonal() -> None:
    layout, placed = found_for(np.array([[1.0, 0.005], [0.05, 0.05]]), 1.0 / 1024.0)
    assert_apart(placed, 1.0 / 1024.0)
    assert layout.scale > 1.2


def test_a_chart_that_is_alone_is_not_turned_away_from_the_angle_that_needs_least() -> None:
    cross = np.concatenate([box(4.0, 0.2) - [2.0, 0.1], box(0.2, 4.0) - [0.1, 2.0]])
    slanted = cross @ rotation(0.25 * np.pi).T  # 2.97 wide and high, where upright it is 4
    layout = find_layout([slanted], 1.56, 0.0, CONFIG, np.random.default_rng(0))
    turned = slanted @ rotation(float(layout.angle[0])).T * layout.scale
    assert np.ptp(turned, axis=(0, 1)).max() == pytest.approx(1.0, abs=0.02)
    assert 1.0 / layout.scale == pytest.approx(4.2 / np.sqrt(2.0), rel=0.03)


def test_the_same_generator_gives_the_same_layout() -> None:
    sides = np.random.default_rng(0).uniform(0.1, 1.0, (12, 2))
    one, two = (found_for(sides, 0.002, seed=5)[0] for _ in range(2))
    assert one.scale == two.scale
    assert np.array_equal(one.origin, two.origin)


def test_padding_that_leaves_no_room_is_refused() -> None:
    with pytest.raises(InputError, match="9 charts with a padding of 20 % of the atlas side leave no room"):
        found_for(np.ones((9, 2)), 0.2)


def test_a_first_layout_that_jumps_as_charts_grow_still_finds_a_size() -> None:
    """Of a candle's bent strips more fit beside each other, or fewer: guesses from the last size swing to and fro."""
    rng = np.random.default_rng(55)
    rng.integers(2, 8)
    outlines, area = [], 0.0
    for _ in range(7):
        outer = float(np.exp(rng.normal(0.0, 0.4)))
        inner, angle = outer * rng.uniform(0.4, 0.95), rng.uniform(2.0, 5.9)
        turn = np.linspace(0.0, angle, 20)
        arc = np.column_stack([np.cos(turn), np.sin(turn)])
        rim = np.concatenate([arc * outer, arc[::-1] * inner])
        outlines.append(np.stack([rim, np.roll(rim, -1, axis=0)], axis=1))
        area += angle / 2.0 * (outer**2 - inner**2)
    found = find_layout(outlines, area, 8 / 2048, PlaceConfig(tries=0), np.random.default_rng(0))
    assert found.scale**2 * area > 0.3
