"""Rows of boxes: one square by hand, boxes apart and on the page, thousands, no room."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.pack.config import RowConfig
from flexpara.runtime.pack.layouts.rows import boxes, laid_in_rows

SQUARE = np.array(
    [[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [1.0, 1.0]], [[1.0, 1.0], [0.0, 1.0]], [[0.0, 1.0], [0.0, 0.0]]]
)
PAGE = np.ones(2)


def placed(outlines: list[np.ndarray], placement: np.ndarray) -> np.ndarray:
    """Boxes (k, 2, 2), low and high, of outlines where they are placed."""
    corners = [
        outline.reshape(-1, 2) @ way[:, :2].T + way[:, 2] for outline, way in zip(outlines, placement, strict=True)
    ]
    return np.array([(points.min(axis=0), points.max(axis=0)) for points in corners])


def rectangles(count: int, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    turns = rng.uniform(0.0, 2.0 * np.pi, count)
    sides = np.exp(rng.normal(size=(count, 2)))
    ways = [np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) for turn in turns.tolist()]
    return [SQUARE * side @ way + rng.normal(size=2) for side, way in zip(sides, ways, strict=True)]


def test_one_square_fills_the_page_but_for_its_padding() -> None:
    placement = laid_in_rows([SQUARE * 3.0], 0.125, PAGE, RowConfig())
    np.testing.assert_allclose(placed([SQUARE * 3.0], placement)[0], [[0.125, 0.125], [0.875, 0.875]], atol=1e-9)


@pytest.mark.parametrize("extent", [(1.0, 1.0), (1.0, 0.25), (0.5, 1.0)])
def test_boxes_keep_their_distance_and_stay_on_the_page(extent: tuple[float, float]) -> None:
    outlines, room = rectangles(300), 0.002
    placement = laid_in_rows(outlines, room, np.array(extent), RowConfig())
    low, high = placed(outlines, placement).transpose(1, 0, 2)
    assert low.min() >= room - 1e-12
    assert (high <= np.array(extent) - room + 1e-12).all()
    gap = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
    assert gap[~np.eye(300, dtype=bool)].min() >= 2.0 * room - 1e-12


def test_all_charts_have_one_scale_and_none_is_mirrored() -> None:
    placement = laid_in_rows(rectangles(50), 0.001, PAGE, RowConfig())
    determinant = np.linalg.det(placement[:, :, :2])
    np.testing.assert_allclose(determinant, determinant[0])
    assert determinant[0] > 0.0


def test_a_turned_rectangle_is_laid_down() -> None:
    _, low, size = boxes([SQUARE * (1.0, 4.0) @ np.array([[0.0, 1.0], [-1.0, 0.0]])], 12, lying=True)
    np.testing.assert_allclose(size, [[4.0, 1.0]])
    assert np.isfinite(low).all()


def test_charts_are_not_turned_where_that_is_off() -> None:
    placement = laid_in_rows(rectangles(20), 0.0, PAGE, RowConfig(), rotation="off")
    assert (placement[:, 0, 1] == 0.0).all()
    assert (placement[:, 0, 0] > 0.0).all()


def test_thousands_cover_most_of_the_page_that_their_boxes_could() -> None:
    outlines = rectangles(3000)
    low, high = placed(outlines, laid_in_rows(outlines, 0.0, PAGE, RowConfig())).transpose(1, 0, 2)
    assert (high - low).prod(axis=1).sum() > 0.8


def test_padding_without_room_is_an_error_of_the_input() -> None:
    with pytest.raises(InputError, match="no room"):
        laid_in_rows(rectangles(100), 0.06, PAGE, RowConfig())
