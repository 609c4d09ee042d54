"""Files of every preset, read again by other programs, hold each point's colour, finish and normal where it belongs."""

from __future__ import annotations

import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pygltflib
import pytest
from PIL import Image

from flexpara.bake.baker import bake
from flexpara.bake.files.exr import write_layers
from flexpara.bake.files.gltf import write_glb
from flexpara.bake.files.images import read_image
from flexpara.bake.files.targets import TARGETS, find_target, packed_textures, prepare, with_green, write_target
from flexpara.bake.texture import Texture
from flexpara.runtime.errors import InputError
from flexpara.runtime.material import Material, Picture
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]

SIZE = 16
MAPS = ["base-color", "normal", "orm", "emissive"]


def card() -> dict[str, np.ndarray]:
    """Slot → (SIZE, SIZE, 3) uint8 without any symmetry: every texel of every slot is another one."""
    row, column = np.mgrid[0:SIZE, 0:SIZE]
    color = np.stack([16 * row + 8, 16 * column + 4, 255 - 8 * row - 7 * column], -1)
    tilt = np.stack([column / SIZE - 0.3, 0.5 - row / SIZE * 0.6, np.ones((SIZE, SIZE))], -1)
    normal = np.round((tilt / np.linalg.norm(tilt, axis=-1, keepdims=True) + 1) / 2 * 255)
    finish = np.stack([0 * row, 15 * row, 14 * column], -1)
    occlusion = np.repeat((255 - 3 * row - 9 * column)[..., None], 3, axis=-1)
    slots = {
        "base-color": color,
        "normal": normal,
        "metallic-roughness": finish,
        "occlusion": occlusion,
        "emissive": color[::-1],
    }
    return {slot: pixels.astype(np.uint8) for slot, pixels in slots.items()}


@pytest.fixture
def turned(quad: Pair) -> Pair:
    """The quad with position = old uv; the new uv are turned by a quarter: u runs along y, v against x."""
    atlas, asset = quad
    opaque = np.full((SIZE, SIZE, 1), 255, np.uint8)
    pictures: Any = {slot: Picture(np.concatenate([pixels, opaque], -1)) for slot, pixels in card().items()}
    material = Material("card", pictures=pictures, metallic=1.0, roughness=1.0, emissive=(1.0, 1.0, 1.0))
    new = np.column_stack([atlas.uv[:, 1], 1 - atlas.uv[:, 0]])
    return replace(atlas, uv=new), replace(asset, uv=atlas.uv.astype(np.float64), materials=(material,))


def at_new_texels(pixels: np.ndarray) -> np.ndarray:
    """What lies under each texel of the new uv.  Row r is x = (r + ½) / SIZE, column c is y = (c + ½) / SIZE."""
    row, column = np.mgrid[0:SIZE, 0:SIZE]
    return pixels[SIZE - 1 - column, row]


def turned_normals(green: str) -> np.ndarray:
    """The card's normals in the new frame: T = +y and B = −x, seen from the old T = +x and B = +y."""
    old = at_new_texels(card()["normal"]).astype(np.float64) / 255 * 2 - 1
    sign = 1.0 if green == "opengl" else -1.0
    return np.stack([old[..., 1], -sign * old[..., 0], old[..., 2]], -1)


def pillow(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        return np.asarray(image).astype(np.float64)


@pytest.mark.parametrize("name", list(TARGETS))
def test_the_card_comes_back_from_every_preset(turned: Pair, tmp_path: Path, name: str) -> None:
    target = find_target(name)
    textures = bake(*turned, MAPS, size=SIZE)
    paths = write_target(textures, tmp_path, "card", target)
    assert {key: path.stem for key, path in paths.items()} == target.file_names(MAPS, "card")
    np.testing.assert_array_equal(pillow(paths["base-color"]), at_new_texels(card()["base-color"]))
    np.testing.assert_array_equal(pillow(paths["emissive"]), at_new_texels(card()["emissive"]))
    if target.bits.get("normal", 8) == 8:
        found = pillow(paths["normal"]) / 255 * 2 - 1
        np.testing.assert_allclose(found, turned_normals(target.green), atol=0.03)
    finish = at_new_texels(card()["metallic-roughness"])
    values: dict[Any, Any] = {
        "occlusion": at_new_texels(card()["occlusion"])[..., 0],
        "roughness": finish[..., 1],
        "metallic": finish[..., 2],
        "smoothness": 255 - finish[..., 1],
        "zero": 0 * finish[..., 0],
    }
    for word, layout in target.packed.items():
        channels = pillow(paths[word]).reshape(SIZE, SIZE, -1)
        assert channels.shape[2] == len(layout)
        for part, channel in zip(layout, np.moveaxis(channels, 2, 0), strict=True):
            np.testing.assert_array_equal(channel, values[part])


def test_normals_in_16_bits_keep_their_direction(turned: Pair, tmp_path: Path) -> None:
    paths = write_target(bake(*turned, ["normal"], size=SIZE), tmp_path, "card", find_target("blender"))
    stored = read_image(paths["normal"])
    assert stored.dtype == np.uint16
    np.testing.assert_allclose(stored.astype(np.float64) / 65535 * 2 - 1, turned_normals("opengl"), atol=6e-3)


def test_the_card_comes_back_from_the_glb(turned: Pair, tmp_path: Path) -> None:
    write_glb(*turned, bake(*turned, MAPS, size=SIZE, normal_format="directx"), tmp_path / "card.glb")
    document = pygltflib.GLTF2().load(str(tmp_path / "card.glb"))
    assert document is not None
    data = document.binary_blob()
    assert data is not None
    found = {}
    for image in document.images:
        view = document.bufferViews[image.bufferView or 0]
        start = view.byteOffset or 0
        with Image.open(io.BytesIO(data[start : start + view.byteLength])) as picture:
            found[image.name] = np.asarray(picture).astype(np.float64)
    np.testing.assert_array_equal(found["base-color"], at_new_texels(card()["base-color"]))
    np.testing.assert_allclose(found["normal"] / 255 * 2 - 1, turned_normals("opengl"), atol=0.03)
    np.testing.assert_array_equal(found["orm"][..., 1], at_new_texels(card()["metallic-roughness"])[..., 1])
    uv = document.meshes[0].primitives[0].attributes.TEXCOORD_0
    view = document.bufferViews[document.accessors[uv or 0].bufferView or 0]
    stored = np.frombuffer(data, np.float32, 8, view.byteOffset or 0).reshape(-1, 2)
    np.testing.assert_allclose(stored, np.column_stack([turned[0].uv[:, 0], 1 - turned[0].uv[:, 1]]))


def test_the_card_comes_back_from_exr(turned: Pair, tmp_path: Path) -> None:
    openexr = pytest.importorskip("OpenEXR")
    write_layers(bake(*turned, ["position", "base-color"], size=SIZE), tmp_path / "card.exr")
    with openexr.File(str(tmp_path / "card.exr"), separate_channels=True) as file:
        channels = {name: np.asarray(channel.pixels) for name, channel in file.channels().items()}
    row, column = np.mgrid[0:SIZE, 0:SIZE]
    np.testing.assert_allclose(channels["position.R"], (row + 0.5) / SIZE, atol=1e-5)
    np.testing.assert_allclose(channels["position.G"], (column + 0.5) / SIZE, atol=1e-5)
    level = at_new_texels(card()["base-color"])[..., 0] / 255.0
    linear = np.where(level <= 0.04045, level / 12.92, ((level + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(channels["base-color.R"], linear, atol=1e-5)


def shares(*channels: float) -> Texture:
    return Texture(np.broadcast_to(np.array(channels, np.float32), (2, 2, len(channels))), "unit", 8, "png")


def test_what_is_missing_takes_its_constant() -> None:
    unity = packed_textures({"ao": shares(0.25)}, find_target("unity"))["MaskMap"]
    np.testing.assert_allclose(unity.pixels[0, 0], [0.0, 0.25, 0.0, 0.2], atol=1e-6)
    assert packed_textures({"base-color": shares(1, 1, 1)}, find_target("unity")) == {}
    assert set(packed_textures({"ao": shares(0.5)}, find_target("blender"))) == {"ao"}


def test_baked_occlusion_goes_before_the_source_s() -> None:
    packed = packed_textures({"orm": shares(0.9, 0.5, 0.1), "ao": shares(0.2)}, find_target("unreal"))["ORM"]
    np.testing.assert_allclose(packed.pixels[0, 0], [0.2, 0.5, 0.1], atol=1e-6)


def test_maps_of_two_sizes_cannot_be_packed() -> None:
    large = Texture(np.zeros((4, 4, 1), np.float32), "unit", 8, "png")
    with pytest.raises(InputError, match="bake them at one size"):
        packed_textures({"orm": shares(1, 1, 1), "ao": large}, find_target("gltf"))


def test_other_maps_keep_their_names_and_their_pixels(quad: Pair) -> None:
    textures = bake(*quad, ["position", "chart"], size=8)
    target = find_target("unreal")
    assert target.file_names(list(textures), "a") == {"position": "T_a_position", "chart": "T_a_chart"}
    assert prepare(textures, target)["position"] is textures["position"]


def test_green_is_turned_once() -> None:
    up = Texture(np.full((1, 1, 3), 0.5, np.float32), "signed", 8, "png", metadata={"space": "tangent, Y up"})
    down = with_green(up, "directx")
    np.testing.assert_array_equal(down.pixels[0, 0], [0.5, -0.5, 0.5])
    assert down.metadata["space"] == "tangent, Y down"
    assert with_green(down, "directx") is down
    np.testing.assert_array_equal(with_green(down, "opengl").pixels, up.pixels)


def test_padding_grows_with_the_size() -> None:
    assert [find_target("unreal").padding(size) for size in (64, 1024, 4096)] == [2, 8, 32]
    assert find_target("gltf").padding(4096) == 16


def test_an_unknown_target_lists_the_names() -> None:
    with pytest.raises(InputError, match="expected one of gltf, unreal, unity, godot, blender, usd"):
        find_target("maya")
