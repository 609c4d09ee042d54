"""Text lies where it was put, in its colour, and changes nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.bake.colors.lettering import text_cover, with_text

RED = (0.8, 0.1, 0.1)


def blank() -> np.ndarray:
    return np.full((40, 200, 3), 0.5, np.float32)


def test_longer_and_higher_text_covers_more() -> None:
    short, long, high = text_cover("uv", 16), text_cover("uv layout", 16), text_cover("uv", 32)
    assert short.shape[0] == long.shape[0] < high.shape[0]
    assert short.shape[1] < long.shape[1]
    assert 0.0 <= short.min() < short.max() <= 1.0
    assert high.sum() > 3.0 * short.sum()


def test_letters_differ() -> None:
    masks = {character: text_cover(character, 20).tobytes() for character in "ABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789"}
    assert len(set(masks.values())) == len(masks)


@pytest.mark.parametrize(("align", "first", "last"), [("left", 100, 200), ("middle", 60, 140), ("right", 0, 101)])
def test_the_place_is_an_end_or_the_middle(align: str, first: int, last: int) -> None:
    picture = with_text(blank(), "layout", (20.0, 100.0), height=16, color=RED, align=align)  # type: ignore[arg-type]
    row, column = np.nonzero((picture != 0.5).any(axis=-1))
    assert first <= column.min() < column.max() <= last
    assert abs(row.mean() - 20) < 4
    if align == "middle":
        assert abs((column.min() + column.max()) / 2 - 100) < 2


def test_the_argument_stays_and_the_colour_is_reached() -> None:
    before = blank()
    after = with_text(before, "HHH", (20.0, 100.0), height=30, color=RED)
    np.testing.assert_array_equal(before, blank())
    assert np.abs(after - np.array(RED, np.float32)).max(axis=-1).min() < 1e-3


def test_what_lies_beyond_the_rim_is_cut_off() -> None:
    for place in ((0.0, 0.0), (39.0, 199.0), (-500.0, 20.0), (20.0, 900.0)):
        assert with_text(blank(), "uv", place, height=16, color=RED).shape == (40, 200, 3)
    np.testing.assert_array_equal(with_text(blank(), "uv", (-500.0, 20.0), height=16, color=RED), blank())
