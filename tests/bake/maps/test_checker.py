"""The test card tells up from down, left from right, and one place from another."""

from __future__ import annotations

import numpy as np

from flexpara.bake.maps.checker import CELLS, uv_card
from flexpara.bake.maps.glyphs import FONT, glyph, text_mask


def test_no_flip_or_turn_maps_the_card_onto_itself() -> None:
    card = uv_card(512)
    turned = [np.rot90(card, 1), np.rot90(card, 2), np.rot90(card, 3)]
    flipped = [card[::-1], card[:, ::-1], card.transpose(1, 0, 2), np.rot90(card, 2).transpose(1, 0, 2)]
    for other in turned + flipped:
        assert np.abs(card - other).max(axis=-1).mean() > 0.02


def test_all_cells_differ() -> None:
    side = 512 // CELLS
    blocks = uv_card(512).reshape(CELLS, side, CELLS, side, 3).transpose(0, 2, 1, 3, 4).reshape(CELLS * CELLS, -1)
    assert len(np.unique(blocks, axis=0)) == CELLS * CELLS


def test_the_first_label_stands_at_the_uv_origin() -> None:
    side = 512 // CELLS
    cell = uv_card(512)[-side:, :side].mean(axis=-1)
    label = text_mask("A1")
    ink = cell > 0.6
    rows, columns = np.flatnonzero(ink[20:].any(axis=1)) + 20, np.flatnonzero(ink[20:].any(axis=0))
    np.testing.assert_array_equal(ink[rows[0] : rows[0] + 7, columns[0] : columns[0] + label.shape[1]], label)


def test_values_are_linear_light_of_any_size() -> None:
    for size in (1, 3, 100):
        card = uv_card(size)
        assert card.shape == (size, size, 3)
        assert card.min() >= 0.0
        assert card.max() <= 1.0


def test_every_glyph_is_7_by_5_and_unlike_the_others() -> None:
    drawn = {glyph(character).tobytes() for character in FONT}
    assert {glyph(character).shape for character in FONT} == {(7, 5)}
    assert len(drawn) == len(FONT)


def test_text_is_laid_out_in_a_row() -> None:
    mask = text_mask("ab", scale=2)
    assert mask.shape == (14, 22)
    np.testing.assert_array_equal(mask[::2, :10:2], glyph("A"))
    np.testing.assert_array_equal(text_mask("é")[:, :5], glyph(" "))
