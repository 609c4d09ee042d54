"""UDIM: each tile is the image its charts would have in the unit square, and is named by its number."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.baker import bake
from flexpara.bake.files.images import read_image
from flexpara.bake.maps.catalogue import find_map
from flexpara.bake.results.udim import bake_udim, tile_of, udim_names, udim_tiles, write_udim
from flexpara.bake.seams.across import on_tall_page, stacked
from flexpara.bake.seams.seamcheck import find_seams, page_of, sample_seams, seam_error
from flexpara.bake.texture import as_texture
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pack.packing import atlas_of_corners

Pair = tuple[Atlas, Asset]


@pytest.fixture
def spread(two_charts: Pair) -> Pair:
    """Chart 0 in tile 1001, chart 1 in tile 1013."""
    uv = two_charts[0].uv.copy()
    uv[4:] += [2.0, 1.0]
    return replace(two_charts[0], uv=uv), two_charts[1]


def test_tiles_are_numbered_by_tens() -> None:
    assert [tile_of(number) for number in (1001, 1010, 1011, 1013, 2000)] == [(0, 0), (9, 0), (0, 1), (2, 1), (9, 99)]
    for number in (1000, 2001):
        with pytest.raises(InputError, match=f"UDIM tile {number}"):
            tile_of(number)


def test_tiles_with_charts_are_found(spread: Pair, quad: Pair) -> None:
    assert udim_tiles(spread[0]) == [1001, 1013]
    assert udim_tiles(quad[0]) == [1001]
    assert udim_tiles(replace(quad[0], uv=quad[0].uv * np.float32(1.5) + 1)) == [1012, 1013, 1022, 1023]


def test_a_tile_holds_what_its_charts_alone_would_give(spread: Pair, two_charts: Pair) -> None:
    tiles = bake_udim(*spread, ["position", "face-id"], size=64, padding=4)
    assert list(tiles) == [1001, 1013]
    whole = bake(*two_charts, ["position", "face-id"], size=64, padding=4)
    for number, columns, faces in ((1001, slice(0, 32), {-1, 0, 1}), (1013, slice(32, 64), {-1, 2, 3})):
        for name in ("position", "face-id"):
            tile = tiles[number][name].pixels
            assert np.abs(tile[:, columns] - whole[name].pixels[:, columns]).max() < 1e-5
        assert set(np.unique(tiles[number]["face-id"].pixels)) == faces


def test_seams_between_tiles_are_closed_as_those_within_one_are(sphere: Pair) -> None:
    """The sphere in two halves, each in a tile: both sides of the meridians between them give one value."""
    atlas, asset = sphere
    half = (atlas.uv[atlas.faces, 0].mean(axis=1) > 0.5).astype(np.int64)
    uv = atlas.uv[atlas.faces].astype(np.float64) * 0.9 + 0.05 + np.stack([half, 0 * half], axis=1)[:, None]
    spread = atlas_of_corners(asset, half, uv.astype(np.float32), atlas)
    names = ["position", "face-id"]
    tiles = bake_udim(spread, asset, names, size="48x64")
    alone = [bake(spread, asset, names, size="48x64", tile=tile_of(number)) for number in tiles]

    def error(images: list[np.ndarray]) -> float:
        tall = on_tall_page(spread, [(0, 0), (1, 0)], 64)
        texture = as_texture(find_map("position"), stacked(images))
        measured = seam_error(texture, sample_seams(find_seams(tall), page_of(texture.pixels)))
        assert measured is not None
        return measured.maximum

    closed = error([tile["position"].pixels for tile in tiles.values()])
    assert closed < 0.3 * error([tile["position"].pixels for tile in alone])
    for tile, other in zip(tiles.values(), alone, strict=True):
        np.testing.assert_array_equal(tile["face-id"].pixels, other["face-id"].pixels)


def test_a_chart_over_a_border_is_drawn_on_both_sides(quad: Pair) -> None:
    shifted = replace(quad[0], uv=quad[0].uv + np.array([0.5, 0.0], np.float32))
    tiles = bake_udim(shifted, quad[1], ["position"], size=8, padding=0)
    x = (np.arange(4) + 0.5) / 8
    np.testing.assert_allclose(tiles[1001]["position"].pixels[4, 4:, 0], x, atol=1e-5)
    np.testing.assert_allclose(tiles[1002]["position"].pixels[4, :4, 0], x + 0.5, atol=1e-5)


def test_files_carry_the_number(spread: Pair, tmp_path: Path) -> None:
    tiles = bake_udim(*spread, ["chart"], size=16, padding=2)
    paths = write_udim(tiles, tmp_path, "part")
    assert [path.name for path in paths] == ["part_chart.1001.png", "part_chart.1013.png"]
    assert udim_names(tiles[1001], "part") == {"chart": "part_chart.<UDIM>.png"}
    assert (read_image(paths[0]) != read_image(paths[1])).any()


@pytest.mark.parametrize(("move", "text"), [((-1, 0), "span -0.875"), ((10, 0), "to 10.88"), ((np.nan, 0), "NaN")])
def test_uv_that_udim_cannot_name_are_refused(two_charts: Pair, move: tuple[float, float], text: str) -> None:
    with pytest.raises(InputError, match=text):
        udim_tiles(replace(two_charts[0], uv=two_charts[0].uv + np.array(move, np.float32)))


def test_each_map_of_each_tile_is_told_before_it_is_made(spread: Pair) -> None:
    told: list[str] = []
    bake_udim(*spread, ["position", "face-id"], size=16, progress=told.append)
    assert told == ["position", "face-id"] * 2
