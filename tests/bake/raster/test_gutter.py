"""Each free texel near a chart takes the value of the nearest covered texel."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage

from flexpara.bake.raster.gutter import fill_gutters, find_gutter
from flexpara.runtime.errors import InputError

BACKGROUND = np.array([9.0], np.float32)


def test_one_covered_texel_fills_a_disk() -> None:
    covered = np.zeros((9, 9), np.bool_)
    covered[4, 4] = True
    filled = find_gutter(covered, 2).fill(covered[..., None].astype(np.float32), BACKGROUND)[..., 0]
    row, column = np.mgrid[-4:5, -4:5]
    np.testing.assert_array_equal(filled == 1.0, row**2 + column**2 <= 4)
    np.testing.assert_array_equal(filled == 9.0, row**2 + column**2 > 4)


@pytest.mark.parametrize("radius", [1, 3, 6, 100])
def test_the_source_is_a_nearest_covered_texel(radius: int) -> None:
    rng = np.random.default_rng(1)
    covered = rng.random((30, 21)) < 0.02
    gutter = find_gutter(covered, radius)
    places = np.argwhere(covered)
    reached = np.zeros(covered.size, np.bool_)
    for target, source in zip(gutter.target, gutter.source, strict=True):
        here, there = np.array(divmod(int(target), 21)), np.array(divmod(int(source), 21))
        nearest = np.sqrt(((places - here) ** 2).sum(axis=1)).min()
        assert np.linalg.norm(there - here) == nearest
        assert covered[tuple(there)]
        reached[target] = True
    for place in np.flatnonzero(~covered.reshape(-1)):
        nearest = np.sqrt(((places - np.array(divmod(int(place), 21))) ** 2).sum(axis=1)).min()
        assert reached[place] == (nearest <= radius)
    assert not gutter.beyond.reshape(-1)[gutter.target].any()
    assert not (gutter.beyond & covered).any()
    assert len(gutter.target) + gutter.beyond.sum() == (~covered).sum()


@pytest.mark.parametrize("radius", [0, 1, 4, 11, 97])
def test_bands_fill_what_the_whole_image_fills(radius: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(2)
    covered = rng.random((60, 50)) < 0.02
    pixels = rng.random((60, 50, 2), np.float32)
    background = np.array([9.0, 8.0], np.float32)
    expected = find_gutter(covered, radius).fill(pixels, background)
    monkeypatch.setattr("flexpara.bake.raster.gutter.BAND", 350)
    single = pixels[..., :1].copy()
    fill_gutters([(pixels, background), (single, background[:1])], covered, radius)
    np.testing.assert_array_equal(pixels, expected)
    np.testing.assert_array_equal(single, expected[..., :1])


def test_a_window_with_a_halo_finds_what_the_whole_image_finds() -> None:
    covered = np.random.default_rng(3).random((60, 70)) < 0.03
    whole, part = find_gutter(covered, 5), find_gutter(covered[10:50, 20:60], 5)
    source = dict(zip(whole.target.tolist(), whole.source.tolist(), strict=True))
    for target, found in zip(part.target, part.source, strict=True):
        row, column = divmod(int(target), 40)
        if 5 <= row < 35 and 5 <= column < 35:
            assert source[(row + 10) * 70 + column + 20] == (found // 40 + 10) * 70 + found % 40 + 20


def test_two_charts_meet_half_way() -> None:
    covered = np.zeros((1, 50), np.bool_)
    covered[0, [0, 49]] = True
    pixels = np.arange(50, dtype=np.float32).reshape(1, 50, 1)
    fill_gutters([(pixels, BACKGROUND)], covered, None)
    np.testing.assert_array_equal(pixels[0, :, 0], np.repeat([0, 49], 25))


@pytest.mark.parametrize("cells", [1024, 40, 10])
def test_the_whole_image_is_filled_from_near_by(cells: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exactly near charts, and to three diagonals of a cell elsewhere; bands change nothing."""
    monkeypatch.setattr("flexpara.bake.raster.background.MOST_CELLS", cells)
    monkeypatch.setattr("flexpara.bake.raster.gutter.BAND", 1200)
    covered = np.random.default_rng(2).random((80, 77)) < 0.0015
    number = np.where(covered, np.arange(covered.size).reshape(covered.shape), -1)[..., None].astype(np.float32)
    fill_gutters([(number, BACKGROUND)], covered, None)
    source = number[..., 0].astype(np.int64)
    assert covered.reshape(-1)[source].all()
    row, column = np.mgrid[:80, :77]
    distance = np.hypot(source // 77 - row, source % 77 - column)
    nearest = np.asarray(ndimage.distance_transform_edt(~covered))
    cell = -(-80 // cells)
    assert (distance <= nearest + 3.0 * np.sqrt(2.0) * (cell - (cell == 1)) + 1e-9).all()
    near = nearest <= max(16, 2 * cell)
    np.testing.assert_allclose(distance[near], nearest[near])


def test_covered_texels_keep_their_values_and_the_argument_is_not_changed() -> None:
    covered = np.eye(6, dtype=np.bool_)
    pixels = np.random.default_rng(0).random((6, 6, 3), np.float32)
    before = pixels.copy()
    filled = find_gutter(covered, 2).fill(pixels, np.zeros(3, np.float32))
    np.testing.assert_array_equal(filled[covered], pixels[covered])
    np.testing.assert_array_equal(pixels, before)


def test_no_radius_and_no_surface_leave_the_background() -> None:
    covered = np.zeros((4, 4), np.bool_)
    for mask, radius in ((covered, 3), (np.eye(4, dtype=np.bool_), 0)):
        filled = find_gutter(mask, radius).fill(np.ones((4, 4, 1), np.float32), BACKGROUND)
        np.testing.assert_array_equal(filled[~mask], np.full(((~mask).sum(), 1), 9.0))


def test_an_image_without_a_surface_is_background() -> None:
    pixels = np.ones((4, 4, 1), np.float32)
    fill_gutters([(pixels, BACKGROUND)], np.zeros((4, 4), np.bool_), None)
    np.testing.assert_array_equal(pixels, 9.0)


def test_a_negative_padding_is_refused() -> None:
    with pytest.raises(InputError, match="padding -1"):
        find_gutter(np.ones((2, 2), np.bool_), -1)
