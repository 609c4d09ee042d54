"""From an atlas to files: all maps of one G-buffer, gutters filled, names as promised."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

from flexpara.bake.bakemap import BakeMap
from flexpara.bake.baker import bake
from flexpara.bake.files.images import read_image
from flexpara.bake.files.textures import texture_names, write_textures
from flexpara.bake.maps.catalogue import find_map
from flexpara.bake.raster.context import open_context
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.bake.raster.plan import Device, SoftwareWarning
from flexpara.bake.seams.seamcheck import seam_report
from flexpara.bake.settings import BakeSettings
from flexpara.runtime.errors import InputError, MissingDependencyError
from flexpara.runtime.mesh import Asset, Atlas

MakeGBuffer = Callable[[Atlas, int], GBuffer]

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
    assert list(textures) == ["uv-checker", "position", "normal"]
    assert sorted(names) == ["normal", "position", "uv-checker"]
    assert {texture.pixels.shape for texture in textures.values()} == {(64, 64, 3)}
    assert {texture.pixels.dtype for texture in textures.values()} == {np.dtype(np.float32)}


def test_position_of_the_unit_quad_is_exact_to_1e_5(quad: Pair) -> None:
    size = 256
    position = bake(*quad, ["position"], size=size)["position"].pixels
    place = (np.arange(size) + 0.5) / size
    assert np.abs(position[..., 0] - place).max() < 1e-5
    assert np.abs(position[..., 1] - (1 - place)[:, None]).max() < 1e-5


@pytest.mark.parametrize("device", ["auto", "software"])
def test_each_side_of_an_image_has_texels_of_its_own(sphere: Pair, quad: Pair, device: Device) -> None:
    position = bake(*quad, ["position"], size="48x20", device=device)["position"].pixels
    assert position.shape == (20, 48, 3)
    assert np.abs(position[..., 0] - (np.arange(48) + 0.5) / 48).max() < 1e-5
    assert np.abs(position[..., 1] - (1 - (np.arange(20) + 0.5) / 20)[:, None]).max() < 1e-5
    whole, cut = (bake(*sphere, ["normal", "ao"], size="64x96", limit=limit, device=device) for limit in (None, 37))
    for name, texture in whole.items():
        assert texture.pixels.shape[:2] == (96, 64)
        np.testing.assert_array_equal(texture.pixels, cut[name].pixels)


def test_seams_are_closed_in_an_image_that_is_not_square(sphere: Pair) -> None:
    textures = bake(*sphere, ["position"], size="96x256")
    assert seam_report(sphere[0], textures)["position"]["max"] < 1.5 / 255.0


def test_no_maps_need_no_context(quad: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexpara.bake.raster.plan.open_context", lambda: pytest.fail("opened a context"))
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


def test_a_function_of_the_surface_needs_no_asset(make_gbuffer: MakeGBuffer, two_charts: Pair) -> None:
    calls: list[tuple[tuple[int, ...], ...]] = []

    def height_and_face(position: np.ndarray, normal: np.ndarray, face: np.ndarray) -> np.ndarray:
        calls.append((position.shape, normal.shape, face.shape))
        assert face.min() >= 0
        return np.column_stack([position[:, 2], face, normal[:, 2]])

    pixels = bake(two_charts[0], {"mymap": height_and_face}, size=32, padding=0)["mymap"].pixels
    gbuffer = make_gbuffer(two_charts[0], 32)
    covered = gbuffer.face >= 0
    np.testing.assert_array_equal(pixels[..., 0], gbuffer.position[..., 2])
    np.testing.assert_array_equal(pixels[covered, 1], gbuffer.face[covered])
    assert calls == [((covered.sum(), 3), (covered.sum(), 3), (covered.sum(),))]


def test_a_function_may_return_one_number_a_texel_and_nothing_else(two_charts: Pair) -> None:
    ones = bake(two_charts[0], {"ones": lambda position, *_: np.ones(len(position))}, size=16)["ones"].pixels
    np.testing.assert_array_equal(ones, np.ones((16, 16, 1)))
    with pytest.raises(InputError, match=r"map bad: its function returned \(1,\)"):
        bake(two_charts[0], {"bad": lambda *_: np.ones(1)}, size=16)
    with pytest.raises(InputError, match="expected one"):
        bake(two_charts[0], {}, {})


def test_images_kept_on_disk_are_the_same_and_leave_no_file(sphere: Pair, tmp_path: Path) -> None:
    names = ["position", "normal-object", "chart"]
    memory, disk = (bake(*sphere, names, size=100, padding=3, scratch=folder) for folder in (None, tmp_path))
    assert list(tmp_path.iterdir()) == []
    for name in names:
        assert isinstance(disk[name].pixels, np.memmap)
        np.testing.assert_array_equal(disk[name].pixels, memory[name].pixels)
    paths = [write_textures(textures, tmp_path, stem) for textures, stem in ((memory, "a"), (disk, "b"))]
    assert [path.read_bytes() for path in paths[0]] == [path.read_bytes() for path in paths[1]]


def test_a_bake_leaves_neither_errors_nor_objects_on_the_device(
    sphere: Pair, monkeypatch: pytest.MonkeyPatch, leaks: Callable[[moderngl.Context], list[str]]
) -> None:
    opened: list[moderngl.Context] = []

    @contextmanager
    def watched() -> Iterator[moderngl.Context]:
        with open_context() as context:
            context.gc_mode = "context_gc"
            opened.append(context)
            yield context
            assert context.error == "GL_NO_ERROR"
            assert leaks(context) == []

    monkeypatch.setattr("flexpara.bake.raster.plan.open_context", watched)
    bake(*sphere, ["position", "normal", "face-id"], size=50, padding=2, samples=4, limit=40)
    with pytest.raises(InputError, match="uv span"):
        bake(replace(sphere[0], uv=sphere[0].uv * 3), sphere[1], ["position"], size=50)
    with pytest.raises(InputError, match="its function returned"):
        bake(*sphere, [custom(np.zeros((3, 3, 1)))], size=50, limit=20)
    assert len(opened) == 2


@pytest.mark.parametrize("limit", [24, 31, 60])
@pytest.mark.parametrize("samples", [1, 4])
def test_tiles_change_no_bit_of_any_map(sphere: Pair, limit: int, samples: int) -> None:
    atlas, asset = sphere
    maps = ["normal", "normal-object", "position", "chart", "uv-checker", "base-color", "face-id", "distortion"]
    whole = bake(atlas, asset, maps, size=60, padding=3, samples=samples)
    tiled = bake(atlas, asset, maps, size=60, padding=3, samples=samples, limit=limit)
    for name in maps:
        assert whole[name].pixels.tobytes() == tiled[name].pixels.tobytes(), name


def test_the_software_rasterizer_bakes_the_same(make_gbuffer: MakeGBuffer, sphere: Pair) -> None:
    names = ["position", "chart", "face-id"]
    first, second = (bake(*sphere, names, size=64, padding=3, device=device) for device in ("opengl", "software"))
    np.testing.assert_array_equal(first["face-id"].pixels, second["face-id"].pixels)
    np.testing.assert_array_equal(first["chart"].pixels, second["chart"].pixels)
    inside = make_gbuffer(sphere[0], 64).inside
    difference = np.abs(first["position"].pixels - second["position"].pixels).max(axis=-1)
    assert difference[inside].max() < 1e-5
    assert difference.max() < 1e-4  # beside charts seams are closed by iteration


def test_without_opengl_numpy_draws_and_says_so(quad: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    def absent() -> None:
        raise MissingDependencyError("no OpenGL 3.3 context could be made: apt-get install libegl1")

    monkeypatch.setattr("flexpara.bake.raster.plan.open_context", absent)
    said: list[str] = []
    expected = bake(*quad, ["position"], size=16, device="software")["position"].pixels
    np.testing.assert_array_equal(bake(*quad, ["position"], size=16, warn=said.append)["position"].pixels, expected)
    assert len(said) == 1
    assert "slower" in said[0]
    assert "apt-get install" in said[0]
    with pytest.warns(SoftwareWarning, match="slower"):
        bake(*quad, ["position"], size=16)
    with pytest.raises(MissingDependencyError):
        bake(*quad, ["position"], size=16, device="opengl")
    with pytest.raises(InputError, match="device 'cuda'"):
        bake(*quad, ["position"], size=16, device="cuda")  # pyright: ignore[reportArgumentType]


def test_supersampling_comes_closer_to_the_mean_over_a_texel(quad: Pair) -> None:
    def stripes(position: np.ndarray, *_: np.ndarray) -> np.ndarray:
        return np.sin(40.0 * position[:, 0])  # 6.4 texels a wave at this size

    edges = np.linspace(0, 1, 33)
    mean = -np.diff(np.cos(40.0 * edges)) / 40.0 * 32
    errors = [
        np.abs(bake(quad[0], {"f": stripes}, size=32, samples=n)["f"].pixels[..., 0] - mean).max() for n in (1, 4, 16)
    ]
    assert errors[1] < 0.3 * errors[0]
    assert errors[2] < 0.3 * errors[1]


def test_supersampled_borders_are_means_of_the_surface_alone(two_charts: Pair) -> None:
    ones = {"ones": lambda position, *_: np.ones(len(position))}
    single, many = (bake(two_charts[0], ones, size=50, padding=0, samples=n)["ones"].pixels for n in (1, 16))
    assert set(np.unique(many)) == {0.0, 1.0}
    assert (many <= single).all()
    assert many.sum() > 0.9 * single.sum()


def test_supersampled_normals_stay_unit_and_face_numbers_whole(sphere: Pair) -> None:
    textures = bake(*sphere, ["normal-object", "face-id"], size=40, padding=0, samples=16)
    length = np.linalg.norm(textures["normal-object"].pixels, axis=-1)
    covered = length > 0
    assert covered.mean() > 0.5
    assert np.abs(length[covered] - 1).max() < 1e-5
    face = textures["face-id"].pixels
    np.testing.assert_array_equal(face, np.round(face))


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"samples": 2}, "samples 2"),
        ({"padding": -1}, "padding -1"),
        ({"limit": 2, "samples": 16}, "limit 2"),
        ({"samples": 16, "size": 30000}, "size 120000"),
    ],
)
def test_what_cannot_be_planned_is_refused(quad: Pair, changes: dict[str, Any], text: str) -> None:
    with pytest.raises(InputError, match=text):
        bake(*quad, ["position"], **{"size": 16, **changes})


@pytest.mark.parametrize(("size", "text"), [(0, "size 0"), (10**6, "size 1000000: expected 1 to")])
def test_a_size_that_cannot_be_drawn_is_refused(quad: Pair, size: int, text: str) -> None:
    with pytest.raises(InputError, match=text):
        bake(*quad, ["position"], size=size)


def test_an_unknown_map_is_refused_before_any_work(quad: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("flexpara.bake.raster.plan.open_context", lambda: pytest.fail("opened a context"))
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


def test_settings_are_made_once_or_given_as_keywords(quad: Pair) -> None:
    made = BakeSettings(size=8, padding=0)
    assert bake(*quad, ["position"], made)["position"].pixels.shape == (8, 8, 3)
    assert bake(*quad, ["position"], made, size=16)["position"].pixels.shape == (16, 16, 3)
    with pytest.raises(InputError, match=r"sise is no option, expected some of .*; pass size"):
        bake(*quad, ["position"], sise=8)
