"""Growth: squares that jam in closed form, and what it never changes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.geometry.gaps import smallest_chart_gap
from flexpara.runtime.pack.config import GrowthConfig
from flexpara.runtime.pack.growing.growth import apply_placement, grown
from flexpara.runtime.pack.growing.outlines import rotation
from flexpara.runtime.pagesize import PageSize

CONFIG = GrowthConfig()
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
SQUARE = np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)


def placed(*where: tuple[float, float, float]) -> NDArray[np.float64]:
    """Placements (k, 2, 3) of (x, y, side) without turning."""
    return np.array([[[side, 0.0, x], [0.0, side, y]] for x, y, side in where])


def test_a_placement_is_an_affine_map_per_chart() -> None:
    found = apply_placement(placed((0.1, 0.2, 0.5), (0.0, 0.0, 2.0)), np.array([0, 1]), np.ones((2, 3, 2)))
    assert found[:, 0].tolist() == [[0.6, 0.7], [2.0, 2.0]]


def test_one_square_fills_the_atlas() -> None:
    found, _ = grown(placed((0.3, 0.2, 0.2)), [SQUARE], PageSize(64, 64), 4, CONFIG)
    assert found == pytest.approx(placed((4 / 64, 4 / 64, 56 / 64)), abs=1e-6)


def test_two_squares_on_a_diagonal_jam_at_the_closed_form() -> None:
    """Corner to corner they are 2·padding apart along the diagonal: side = (64 − 2·4 − 8/√2) / 2 or better."""
    found, _ = grown(placed((0.1, 0.1, 0.3), (0.55, 0.55, 0.3)), [SQUARE, SQUARE], PageSize(64, 64), 4, CONFIG)
    side = found[0, 0, 0] * 64
    assert side >= (64 - 8 - 8 / np.sqrt(2.0)) / 2.0 - 1e-3
    assert found[1, 0, 0] == found[0, 0, 0]


@pytest.mark.parametrize("padding", [0, 2, 6])
def test_loose_squares_come_to_lie_exactly_as_close_as_the_padding_allows(padding: int) -> None:
    start = placed((0.06, 0.05, 0.4), (0.54, 0.06, 0.4), (0.05, 0.55, 0.4), (0.55, 0.54, 0.4))
    found, _ = grown(start, [SQUARE] * 4, PageSize(128, 128), padding, CONFIG)
    segments = apply_placement(found, np.repeat(np.arange(4), 4), np.concatenate([SQUARE] * 4))
    gap = smallest_chart_gap(segments, np.repeat(np.arange(4), 4), spacing=1 / 512)
    assert gap is not None
    assert gap * 128 == pytest.approx(2.0 * padding, abs=1e-3)
    assert gap >= 2.0 * padding / 128
    assert found[0, 0, 0] > 0.9 * (128 - 4 * padding) / 256
    assert segments.min() >= padding / 128
    assert segments.max() <= 1.0 - padding / 128


def test_turns_are_kept_and_the_scale_stays_common() -> None:
    start = placed((0.1, 0.1, 0.3), (0.8, 0.5, 0.3))
    start[1, :, :2] = 0.3 * np.array([[0.0, -1.0], [1.0, 0.0]])
    found, _ = grown(start, [SQUARE, SQUARE], PageSize(64, 64), 2, CONFIG)
    factor = found[0, 0, 0] / 0.3
    assert factor > 1.0
    assert found[:, :, :2] == pytest.approx(factor * start[:, :, :2])


def outline_of(*corners: tuple[float, float]) -> NDArray[np.float64]:
    start = np.array(corners)
    return np.stack([start, np.roll(start, -1, axis=0)], axis=1)


def test_a_square_that_stands_askew_is_turned_upright_where_it_may_be() -> None:
    angle = 0.05
    start = 0.5 * rotation(angle)
    placement = np.concatenate([start, [[0.3], [0.2]]], axis=1)[None]
    kept, _ = grown(placement, [SQUARE], PageSize(64, 64), 4, CONFIG)
    found, _ = grown(placement, [SQUARE], PageSize(64, 64), 4, CONFIG, turning=np.array([True]))
    assert np.sqrt(np.linalg.det(kept[0, :, :2])) < 0.96 * 56 / 64
    assert found == pytest.approx(placed((4 / 64, 4 / 64, 56 / 64)), abs=1e-3)


def test_charts_that_turn_keep_their_padding_and_one_scale() -> None:
    wedge = outline_of((0.0, 0.0), (1.0, 0.0), (0.0, 0.7))
    start = placed((0.08, 0.05, 0.4), (0.52, 0.05, 0.4), (0.08, 0.52, 0.4))
    start[::2, :, :2] = 0.4 * rotation(0.06)
    turning = np.array([True, False, True])
    found, _ = grown(start, [wedge] * 3, PageSize(256, 256), 3, CONFIG, turning=turning)
    segments = apply_placement(found, np.repeat(np.arange(3), 3), np.concatenate([wedge] * 3))
    gap = smallest_chart_gap(segments, np.repeat(np.arange(3), 3), spacing=1 / 1024)
    assert gap is not None
    assert gap >= 6 / 256
    assert segments.min() >= 3 / 256
    assert segments.max() <= 1.0 - 3 / 256
    scale = np.linalg.det(found[:, :, :2])
    assert scale == pytest.approx(np.full(3, scale[0]))
    assert found[1, 0, 1] == 0.0
    assert scale[0] > np.linalg.det(grown(start, [wedge] * 3, PageSize(256, 256), 3, CONFIG)[0][0, :, :2])
