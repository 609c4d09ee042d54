"""Charts as bitmaps: which cells they take, where they fall, holes that are used, and when it is not tried."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.pack.config import NestConfig
from flexpara.runtime.pack.growing.outlines import rotation
from flexpara.runtime.pack.layouts.bitmap import Mask, mask_of, nest
from flexpara.runtime.pack.layouts.nesting import find_nested


def ring(points: list[tuple[float, float]]) -> np.ndarray:
    """(s, 2, 2) outline through points."""
    start = np.array(points, dtype=float)
    return np.stack([start, np.roll(start, -1, axis=0)], axis=1)


def box(width: float, height: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    return ring([(x, y), (x + width, y), (x + width, y + height), (x, y + height)])


def test_a_mask_holds_every_cell_the_padded_outline_may_touch() -> None:
    outline = ring([(0.3, 0.2), (9.7, 1.1), (4.4, 7.9)])
    mask = mask_of(outline, 1.5)
    share = np.linspace(0, 1, 200)[:, None, None]
    points = (outline[:, 0] + share * (outline[:, 1] - outline[:, 0])).reshape(-1, 2)
    angle = np.linspace(0, 2 * np.pi, 64)
    around = points[:, None] + 1.5 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    column, row = np.floor(around + mask.offset).astype(int).reshape(-1, 2).T
    assert mask.cells[row, column].all()
    assert mask.cells.sum() < 1.6 * (0.5 * 9.4 * 7.2 + 1.5 * 27 + np.pi * 2.25)


def test_what_an_outline_encloses_is_taken_but_not_its_hole() -> None:
    outline = np.concatenate([box(20, 20), box(10, 10, 5, 5)[::-1, ::-1]])
    x, y = mask_of(outline, 0.0).offset.astype(int)
    assert not mask_of(outline, 0.0).cells[y + 10, x + 10]
    assert mask_of(outline, 0.0).cells[y + 2, x + 10]
    assert mask_of(outline, 0.0, filled=True).cells[y + 10, x + 10]


def test_a_turned_mask_is_that_of_the_turned_outline() -> None:
    outline = ring([(0.0, 0.0), (9.0, 1.0), (4.0, 7.0)])
    turned, made = mask_of(outline, 1.0).turned, mask_of(outline @ rotation(np.pi / 2).T, 1.0)
    low = (outline @ rotation(np.pi / 2).T).min(axis=(0, 1))
    column, row = np.floor(low + turned.offset).astype(int)
    assert turned.cells.shape[0] == pytest.approx(made.height, abs=1)
    assert 0 <= column <= 3
    assert 0 <= row <= 3


def test_a_chart_falls_into_the_hole_of_another() -> None:
    frame = np.ones((10, 10), dtype=bool)
    frame[3:7, 3:7] = False
    charts = [[Mask(frame, np.zeros(2))], [Mask(np.ones((4, 4), dtype=bool), np.zeros(2))]]
    found = nest(charts, np.array([0, 1]), 10)
    assert found is not None
    assert found.place.tolist() == [[0, 0], [3, 3]]
    assert (found.width, found.height) == (10, 10)


def test_cells_are_taken_once_and_within_the_columns() -> None:
    rng = np.random.default_rng(3)
    charts = [[Mask(rng.random((h, w)) < 0.9, np.zeros(2))] for h, w in rng.integers(2, 9, (30, 2)).tolist()]
    charts = [[Mask(masks[0].cells | np.eye(*masks[0].cells.shape, dtype=bool), np.zeros(2))] for masks in charts]
    for masks in charts:
        masks[0].cells[:, 0], masks[0].cells[0] = True, True  # in one piece
    found = nest(charts, np.arange(30), 24)
    assert found is not None
    count = np.zeros((found.height, 24), dtype=int)
    for (column, row), masks in zip(found.place.tolist(), charts, strict=True):
        cells = masks[0].cells
        count[row : row + cells.shape[0], column : column + cells.shape[1]] += cells
    assert count.max() == 1


def test_too_wide_or_too_high_is_no_layout() -> None:
    charts = [[Mask(np.ones((2, 9), dtype=bool), np.zeros(2))]]
    assert nest(charts, np.array([0]), 8) is None
    assert nest(charts, np.array([0]), 9, most=1) is None


def test_one_chart_or_very_many_are_left_to_the_skyline() -> None:
    config, rng = NestConfig(), np.random.default_rng(0)
    assert find_nested([box(1, 1)], np.array([False]), 1.0, 0.01, config, rng) is None
    many = [box(1, 1)] * (config.most + 1)
    assert find_nested(many, np.zeros(len(many), bool), float(len(many)), 0.001, config, rng) is None
