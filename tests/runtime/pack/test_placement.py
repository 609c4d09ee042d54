"""Silhouettes: reliefs of a square, what xatlas rasterizes, and placements without common cells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import xatlas
from scipy import ndimage

from flexpara.runtime.pack.placement import _options, _soup, place, relief, solid, turned

if TYPE_CHECKING:
    from numpy.typing import NDArray

SQUARE = np.array([[[0, 0], [4, 0]], [[4, 0], [4, 4]], [[4, 4], [0, 4]], [[0, 4], [0, 0]]], dtype=np.float64)
HOLE = SQUARE[::-1, ::-1] * 0.5 + 1.0


def blob(rng: np.random.Generator) -> NDArray[np.bool_]:
    """A random connected mask, with holes."""
    seeds = rng.random(rng.integers(4, 30, 2)) < 0.08
    seeds[1, 1] = True
    grown = ndimage.binary_dilation(seeds, np.ones((2, 2)), iterations=2)
    labels = np.zeros(grown.shape, dtype=np.int32)
    ndimage.label(grown, output=labels)
    return solid(labels == labels[1, 1])[0]


def test_the_silhouette_of_a_square_is_the_square_and_its_padding() -> None:
    found = relief(SQUARE + 10.0, 3.0)
    x = np.arange(found.distance.shape[1]) + 0.5 + found.origin[0] - 10.0
    outside = np.maximum(np.maximum(-x, x - 4.0), 0.0)
    exact = np.hypot(outside[:, None], outside[None, :])
    near = exact < 3.5
    assert found.distance[near] == pytest.approx(exact[near], abs=0.02)
    for padding in (0.0, 1.0, 2.7):
        cell = np.hypot(*(np.maximum(np.abs(x - 2.0) - 2.5, 0.0)[axis] for axis in (np.s_[:, None], np.s_[None, :])))
        assert found.silhouette(padding)[cell <= padding].all()


def test_a_hole_stays_open_for_other_charts() -> None:
    found = relief(np.concatenate([SQUARE * 10.0, HOLE * 10.0]), 1.0)
    middle = tuple((np.array([20.0, 20.0]) - found.origin).astype(int))
    assert found.silhouette(0.0)[middle[0], middle[1] - 15]
    assert not found.silhouette(1.0)[middle]


def test_turning_a_mask_is_counter_clockwise_with_row_0_lowest() -> None:
    mask = np.array([[True, True, False], [False, False, False]])
    assert turned(mask, 1).tolist() == [[False, True], [False, True], [False, False]]
    assert turned(mask, 4).tolist() == mask.tolist()


def test_a_mask_is_cropped_and_its_offset_told() -> None:
    mask = np.zeros((6, 7), dtype=bool)
    mask[2:5, 3:6] = True
    found, offset = solid(mask)
    assert found.shape == (3, 3)
    assert offset.tolist() == [3, 2]
    assert solid(mask[:3, :4])[0].shape == (2, 2)


@pytest.mark.parametrize("second", [(2, 2), (5, 6)])
def test_a_mask_in_pieces_is_joined_and_still_covers_them(second: tuple[int, int]) -> None:
    mask = np.zeros((8, 9), dtype=bool)
    mask[0:2, 0:2] = True
    mask[second[0] : second[0] + 2, second[1] : second[1] + 2] = True
    found, offset = solid(mask)
    canvas = np.zeros((12, 13), dtype=bool)
    column, row = (offset + 1).tolist()
    canvas[row : row + found.shape[0], column : column + found.shape[1]] = found
    assert canvas[1:9, 1:10][mask].all()
    assert place([found], 16, exhaustive=True) is not None


@pytest.mark.parametrize("seed", range(30))
def test_xatlas_rasterizes_exactly_the_cells_of_a_mask(seed: int) -> None:
    mask = blob(np.random.default_rng(seed))
    soup = _soup(mask)
    atlas = xatlas.Atlas()
    indices = np.arange(3 * len(soup), dtype=np.uint32).reshape(-1, 3)
    atlas.add_uv_mesh(soup.reshape(-1, 2).astype(np.float32), indices, np.ones((len(soup), 1), dtype=np.uint32))
    options = _options(40, exhaustive=True)
    options.create_image = True
    atlas.generate(pack_options=options)
    assert atlas.chart_count == 1
    expected = np.zeros((40, 40), dtype=bool)
    expected[: mask.shape[0], : mask.shape[1]] = mask
    assert np.array_equal(atlas.get_chart_image(0).any(axis=-1), expected)


@pytest.mark.parametrize("count", [3, 60])
def test_placed_masks_share_no_cell(count: int) -> None:
    rng = np.random.default_rng(count)
    masks = [blob(rng) for _ in range(count)]
    side = int(np.sqrt(sum(mask.sum() for mask in masks) / 0.5)) + 20
    offset = place(masks, side, exhaustive=True)
    assert offset is not None
    used = np.zeros((side, side), dtype=np.int64)
    for mask, (column, row) in zip(masks, offset.tolist(), strict=True):
        used[row : row + mask.shape[0], column : column + mask.shape[1]] += mask
    assert used.max() == 1


def test_a_square_that_fits_exactly_fits_and_no_more() -> None:
    full = np.ones((8, 8), dtype=bool)
    assert place([full] * 4, 16, exhaustive=True) is not None
    assert place([full] * 4, 15, exhaustive=True) is None
    assert place([full] * 5, 16, exhaustive=True) is None
    assert place([np.ones((2, 20), dtype=bool)], 19, exhaustive=True) is None
