"""Padding: two squares whose largest common scale is known, walls, and what can't be parted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.runtime.errors import FinishError
from flexpara.runtime.pack.config import GrowthConfig
from flexpara.runtime.pack.growing.padding import Crowd, are_apart, largest_factor, padded

CONFIG = GrowthConfig()
CORNERS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
SQUARE = np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)


def squares(*centre: tuple[float, float], side: float = 1.0) -> Crowd:
    count = len(centre)
    half = np.full((count, 2), side / 2.0)
    local, chart = np.concatenate([side * SQUARE] * count), np.repeat(np.arange(count), 4)
    return Crowd(local, chart, half, np.array(centre), 1.0, np.ones(2))


def test_one_square_fills_what_the_border_leaves() -> None:
    assert padded(squares((0.5, 0.5), side=0.9), 0.1, 0.2, CONFIG).factor * 0.9 == pytest.approx(0.8)


def test_two_squares_side_by_side_share_what_the_padding_between_them_leaves() -> None:
    """Centres ½ apart, 0.1 of it padding."""
    found = padded(squares((0.25, 0.5), (0.75, 0.5), side=0.45), 0.0, 0.1, CONFIG)
    assert found.factor * 0.45 == pytest.approx(0.4, abs=1e-6)
    assert found.factor * 0.45 <= 0.4


def test_charts_that_lie_too_close_shrink_about_their_centres() -> None:
    start = squares((0.25, 0.5), (0.75, 0.5), side=0.499)
    found = padded(start, 0.0, 0.1, CONFIG)
    assert found.factor < 1.0
    assert found.centre.tolist() == start.centre.tolist()


def test_a_pair_is_apart_at_exactly_the_distance_asked_for() -> None:
    crowd = squares((0.25, 0.5), (0.75, 0.5), side=0.25)
    facing = np.array([[1, 7]])  # the right side of the first, the left side of the second
    assert are_apart(crowd, facing, 0.25)
    assert not are_apart(crowd, facing, np.nextafter(0.25, 1.0))


def test_charts_without_a_repair_left_are_refused() -> None:
    with pytest.raises(FinishError, match=r"closer than 0\.1 of the atlas side after 0 repairs"):
        padded(squares((0.25, 0.5), (0.75, 0.5), side=0.45), 0.0, 0.1, replace(CONFIG, repairs=0))


def test_charts_whose_centres_are_too_close_are_refused_at_once() -> None:
    with pytest.raises(FinishError, match=r"centres of charts lie closer than 0\.1 of the atlas side"):
        padded(squares((0.5, 0.5), (0.55, 0.5), side=0.45), 0.0, 0.1, CONFIG)


def test_pairs_that_are_no_longer_measured_change_no_bit_of_the_factor() -> None:
    """Against halving with all pairs measured each time."""
    rng = np.random.default_rng(0)
    for _ in range(20):
        crowd = squares(*[tuple(place) for place in rng.uniform(0.1, 0.9, (6, 2)).tolist()], side=0.2)
        one, two = np.triu_indices(24, 1)
        across = crowd.chart[one] != crowd.chart[two]
        pairs = np.column_stack([one, two])[across]
        low, high = 0.0, 1.25
        for _ in range(40):
            middle = (low + high) / 2.0
            fits = are_apart(replace(crowd, factor=middle), pairs, 0.02)
            low, high = (middle, high) if fits else (low, middle)
        assert largest_factor(crowd, pairs, 0.02, walls=2.0) == low
