"""What charts will cover of a page, foreseen: squares by hand, and the order of real layouts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.pack.config import ForeseenConfig
from flexpara.runtime.pack.layouts.foreseen import foreseen, silhouette

PLAIN = ForeseenConfig(padding=0.0)


def box(width: float, height: float) -> NDArray[np.float64]:
    corner = np.array([[0.0, 0.0], [width, 0.0], [width, height], [0.0, height]])
    return np.stack([corner, np.roll(corner, -1, axis=0)], axis=1)


def covered(sides: list[tuple[float, float]], config: ForeseenConfig = PLAIN) -> float:
    whole = sum(width * height for width, height in sides)
    alone = len(sides) == 1
    return foreseen([silhouette(box(*each), each[0] * each[1], whole, config, alone=alone) for each in sides], config)


def test_a_square_or_four_cover_nearly_all_of_their_page_and_five_leave_a_row_free() -> None:
    assert covered([(1.0, 1.0)]) == pytest.approx(1.0, abs=0.05)
    assert covered([(1.0, 1.0)] * 4) == pytest.approx(1.0, abs=0.08)
    assert 0.45 < covered([(1.0, 1.0)] * 5) < 0.65


def test_a_strip_covers_as_much_as_its_width_says_and_cut_in_two_more() -> None:
    assert covered([(4.0, 1.0)]) == pytest.approx(4.0 / (5.0 / np.sqrt(2.0)) ** 2, abs=0.03)
    assert covered([(4.0, 1.0)]) < covered([(2.0, 1.0)] * 2)


def test_padding_takes_more_from_many_charts_than_from_few() -> None:
    wide = replace(PLAIN, padding=1.0 / 64.0)
    few, many = [(1.0, 1.0)] * 4, [(0.25, 0.25)] * 64
    assert covered(few) - covered(few, wide) < covered(many) - covered(many, wide)


def test_size_and_place_of_charts_do_not_matter() -> None:
    sides = [(1.0, 0.3), (0.5, 0.5), (0.9, 0.2)]
    assert covered(sides) == pytest.approx(covered([(7.0 * width, 7.0 * height) for width, height in sides]), abs=1e-9)
