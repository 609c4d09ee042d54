"""From an atlas to files: all maps of one G-buffer, gutters filled, names as promised."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.baker import bake, texture_names, write_textures
from flexpara.bake.gbuffer import GBuffer
from flexpara.bake.images import read_image
from flexpara.bake.maps import BakeMap, find_map
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def custom(result: np.ndarray | None = None) -> BakeMap:
    """A map of one's own: height above z = 0, or whatever result is given."""

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> np.ndarray:
        del atlas, asset
        return gbuffer.position[..., 2:] if result is None else result

    return BakeMap("height", "object", "source units", "any", "linear", "exr", 32, compute, (-1.0, -1.0, -1.0))


def test_maps_come_in_the_order_asked_for(quad: Pair) -> None:
    names: list[str] = []
    textures = bake(*quad, ["uv-checker", "position", "normal"], progress=names.append)
    assert list(textures) == names == ["uv-checker", "position", "normal"]
    assert {texture.pixels.shape for texture in textures.values()} == {(64, 64, 3)}
    assert {texture.pixels.dtype for texture in textures.values()} == {np.dtype(np.float32)}


def test_position_of_the_unit_quad_is_exact_to_1e_5(quad: Pair) -> None:
    size = 256
    position = bake(*quad, ["position"], size=size)["position"].pixels
    place = (np.arange(size) + 0.5) / size
    assert np.abs(position[..., 0] - place).max() < 1e-5
    assert np.abs(position[..., 1] - (1 - place)[:, None]).max() < 1e-5


def test_no_maps_need_no_context(quad: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexpara.bake.baker.open_context", lambda: pytest.fail("opened a context"))
    assert bake(*quad, []) == {}


def test_a_map_of_one_s_own_is_baked_like_the_others(two_charts: Pair) -> None:
    pixels = bake(*two_charts, [custom()], size=64, padding=2)["height"].pixels
    assert pixels.shape == (64, 64, 1)
    assert set(np.unique(pixels)) == {-1.0, 0.0, 1.0}


def test_gutters_reach_as_far_as_the_padding_and_no_chart_enters_the_other(two_charts: Pair) -> None:
    size, padding = 64, 6
    pixels = bake(*two_charts, [custom()], size=size, padding=padding)["height"].pixels[size // 2, :, 0]
    # charts cover columns 8 to 23 and 40 to 55 and touch one texel more on either side
    expected = np.full(size, -1.0)
    for value, first, last in ((0.0, 8, 23), (1.0, 40, 55)):
        expected[first - padding : last + padding + 1] = value
    inside = np.flatnonzero(expected >= 0)
    np.testing.assert_array_equal(pixels[inside], expected[inside])
    assert (pixels[: inside[0] - 1] == -1).all()
    whole = bake(*two_charts, [custom()], size=size, padding=None)["height"].pixels[..., 0]
    assert (whole[:, :32] == 0).all()
    assert (whole[:, 32:] == 1).all()


def test_both_sides_of_a_cut_agree_under_bilinear_filtering(sphere: Pair) -> None:
    atlas, asset = sphere
    size = 512
    pixels = bake(atlas, asset, ["position"], size=size, padding=4)["position"].pixels
    v = np.linspace(0.12, 0.88, 50)

    def sample(u: float) -> np.ndarray:
        x, y = u * size - 0.5, (1 - v) * size - 0.5
        left, top = int(np.floor(x)), np.floor(y).astype(int)
        across, down = x - left, (y - top)[:, None]
        rows = [pixels[top + i, left] * (1 - across) + pixels[top + i, left + 1] * across for i in (0, 1)]
        return rows[0] * (1 - down) + rows[1] * down

    assert np.abs(sample(0.05) - sample(0.95)).max() < 2.0 / 255


def test_alpha_is_1_beyond_the_gutter(two_charts: Pair) -> None:
    atlas, asset = two_charts
    clear = replace(asset, colors=np.full((8, 4), 100, np.uint8))
    pixels = bake(atlas, clear, ["vertex-color"], size=32, padding=1)["vertex-color"].pixels
    np.testing.assert_array_equal(pixels[0, 0], [0, 0, 0, 1])


def test_a_function_of_the_wrong_shape_is_named(quad: Pair) -> None:
    with pytest.raises(InputError, match=r"map height: its function returned \(3, 3, 1\)"):
        bake(*quad, [custom(np.zeros((3, 3, 1)))])


@pytest.mark.parametrize(("size", "text"), [(0, "size 0"), (10**6, "size 1000000: expected 1 to")])
def test_a_size_that_cannot_be_drawn_is_refused(quad: Pair, size: int, text: str) -> None:
    with pytest.raises(InputError, match=text):
        bake(*quad, ["position"], size=size)


def test_an_unknown_map_is_refused_before_any_work(quad: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexpara.bake.baker.open_context", lambda: pytest.fail("opened a context"))
    with pytest.raises(InputError, match="unknown map 'nope'"):
        bake(*quad, ["position", "nope"])


def test_files_are_named_by_stem_and_map(quad: Pair, tmp_path: Path) -> None:
    textures = bake(*quad, ["normal", "position", "normal-object"], size=16)
    paths = write_textures(textures, tmp_path, "part")
    assert [path.name for path in paths] == ["part_normal.png", "part_position.exr", "part_normal-object.exr"]
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)
    np.testing.assert_array_equal(read_image(paths[1]), textures["position"].pixels)
    assert read_image(paths[2]).dtype == np.float16
    assert abs(read_image(paths[0]).astype(float).mean(axis=(0, 1)) - [127.5, 127.5, 255]).max() < 0.01


def test_a_file_type_is_honoured_where_it_can_hold_the_map(quad: Pair) -> None:
    textures = bake(*quad, ["normal", "position"], size=8)
    assert texture_names(textures, "a", file_type="exr") == {"normal": "a_normal.exr", "position": "a_position.exr"}
    assert texture_names(textures, "a", file_type="png") == {"normal": "a_normal.png", "position": "a_position.exr"}


def test_an_8_bit_exr_becomes_half(quad: Pair, tmp_path: Path) -> None:
    textures = bake(*quad, ["normal"], size=8)
    (path,) = write_textures(textures, tmp_path, "a", file_type="exr")
    assert read_image(path).dtype == np.float16


def test_the_same_atlas_gives_the_same_files(sphere: Pair, tmp_path: Path) -> None:
    contents = []
    for name in ("first", "second"):
        folder = tmp_path / name
        folder.mkdir()
        maps = ["normal-object", "position", "chart", "uv-checker"]
        contents.append([path.read_bytes() for path in write_textures(bake(*sphere, maps), folder, "a")])
    assert contents[0] == contents[1]


def test_every_map_can_be_asked_for_by_name(quad: Pair) -> None:
    assert bake(*quad, ["chart"], size=4)["chart"].metadata["units"] == find_map("chart").units
