"""The test card tells up from down, left from right, and one place from another."""

from __future__ import annotations

import numpy as np

from flexpara.bake.colors.lettering import text_cover
from flexpara.bake.maps.checker import ARROW_ROW, CELLS, DOTS, LABEL, LABEL_ROW, uv_card


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


def test_the_first_label_stands_at_the_uv_origin_and_arrows_point_up() -> None:
    cell = uv_card(CELLS * DOTS)[-DOTS:, :DOTS].mean(axis=-1) > 0.6  # white ink on the darkest cell
    label = text_cover("A1", LABEL) > 0.5
    top, left = LABEL_ROW - label.shape[0] // 2, (DOTS - label.shape[1]) // 2
    np.testing.assert_array_equal(cell[top : top + label.shape[0], left : left + label.shape[1]], label)
    arrow = cell[ARROW_ROW - 11 : ARROW_ROW + 11, DOTS // 2 - 8 : DOTS // 2 + 8]
    assert arrow[:8].any(axis=0).sum() > 3 * arrow[12:].any(axis=0).sum()  # the head is above the shaft
    assert cell.sum() == label.sum() + arrow.sum()


def test_values_are_linear_light_of_any_size() -> None:
    for size in (1, 3, 100):
        card = uv_card(size)
        assert card.shape == (size, size, 3)
        assert card.min() >= 0.0
        assert card.max() <= 1.0


def test_cells_stay_square_on_a_page_that_is_not() -> None:
    card = uv_card("512x256")
    assert card.shape == (256, 512, 3)
    np.testing.assert_array_equal(card, uv_card(512)[256:])
