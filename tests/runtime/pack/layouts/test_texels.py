"""Rectangles on whole texels: one by hand, a turned one, thin ones, and what is left alone."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.pack.config import PackConfig
from flexpara.runtime.pack.growing.outlines import rotation
from flexpara.runtime.pack.layouts.texels import aligned
from flexpara.runtime.pagesize import PageSize

CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 0.5], [0.0, 0.5]])
RECTANGLE = np.stack([CORNERS, np.roll(CORNERS, -1, axis=0)], axis=1)
PAGE = PageSize(10, 10)
WHOLE = PackConfig(whole_texels=True)


def placed(scale: float, x: float, y: float, angle: float = 0.0) -> np.ndarray:
    return np.column_stack([scale * rotation(angle), [x, y]])[None]


def texels(placement: np.ndarray, outline: np.ndarray, size: int) -> tuple[list[float], list[float]]:
    flat = (outline @ placement[0, :, :2].T + placement[0, :, 2]) * size
    return flat.min(axis=(0, 1)).round(9).tolist(), flat.max(axis=(0, 1)).round(9).tolist()


def test_a_rectangle_shrinks_to_whole_texels() -> None:
    found = aligned(placed(0.52, 0.13, 0.21), [RECTANGLE], PAGE, WHOLE)
    assert texels(found, RECTANGLE, 10) == ([2.0, 3.0], [6.0, 4.0])


def test_a_rectangle_on_whole_texels_stays_to_the_last_digit_of_a_texel() -> None:
    placement = placed(0.4, 0.2, 0.3)
    assert np.allclose(aligned(placement, [RECTANGLE], PAGE, WHOLE), placement, atol=1e-12)


def test_a_quarter_turn_is_kept() -> None:
    found = aligned(placed(0.52, 0.93, 0.21, np.pi / 2), [RECTANGLE], PAGE, WHOLE)
    assert texels(found, RECTANGLE, 10) == ([7.0, 3.0], [9.0, 7.0])


def test_slanted_and_thin_ones_and_other_shapes_stay() -> None:
    triangle = RECTANGLE[:3].copy()
    triangle[2, 1] = triangle[0, 0]
    for outline, placement in (
        (RECTANGLE, placed(0.52, 0.5, 0.3, 0.4)),
        (RECTANGLE, placed(0.01, 0.5, 0.3)),
        (triangle, placed(0.52, 0.13, 0.21)),
    ):
        assert np.array_equal(aligned(placement, [outline], PAGE, WHOLE), placement)


def test_nothing_moves_unless_it_is_asked_for() -> None:
    placement = placed(0.52, 0.13, 0.21)
    assert aligned(placement, [RECTANGLE], PAGE, PackConfig()) is placement


def test_each_side_of_a_page_has_texels_of_its_own() -> None:
    found = aligned(placed(0.52, 0.13, 0.21), [RECTANGLE], PageSize(10, 20), WHOLE)
    flat = (RECTANGLE @ found[0, :, :2].T + found[0, :, 2]) * (10, 20)
    assert flat.min(axis=(0, 1)) == pytest.approx([2.0, 5.0])
    assert flat.max(axis=(0, 1)) == pytest.approx([6.0, 9.0])
