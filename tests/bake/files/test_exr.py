"""One EXR file holds all maps, losslessly, each under its name, and says what they are."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexpara.bake.baker import bake
from flexpara.bake.files.exr import ExrSettings, file_metadata, write_layers
from flexpara.bake.files.images import EncodingError, oiio
from flexpara.bake.texture import Texture
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def layers(path: Path) -> tuple[dict[str, np.ndarray], Any]:
    """Channel name → (h, w), and the header."""
    source = oiio.ImageInput.open(str(path))
    assert source is not None
    spec = source.spec()
    pixels = np.asarray(source.read_image(spec.format))
    source.close()
    return {name: pixels[..., index] for index, name in enumerate(spec.channelnames)}, spec


def test_every_map_is_a_layer(sphere: Pair, tmp_path: Path) -> None:
    textures = bake(*sphere, ["position", "normal-object", "face-id"], size=32)
    metadata = file_metadata(sphere[1], normal_format="directx")
    write_layers(textures, tmp_path / "a.exr", metadata=metadata)
    found, spec = layers(tmp_path / "a.exr")
    assert set(found) == {*(f"{name}.{c}" for name in ("position", "normal-object") for c in "RGB"), "face-id.R"}
    for name, texture in textures.items():
        for letter, channel in zip("RGB", np.moveaxis(texture.pixels, 2, 0), strict=False):
            np.testing.assert_array_equal(found[f"{name}.{letter}"], channel)
    assert spec.getattribute("flexpara:normal_convention") == "tangent space MikkTSpace, green -Y"
    assert spec.getattribute("flexpara:position.units") == "source units"
    assert spec.getattribute("flexpara:uv_set") == "TEXCOORD_0"


@pytest.mark.parametrize("compression", ["none", "rle", "zip", "zips", "piz"])
def test_half_and_compression_are_chosen(tmp_path: Path, compression: Any) -> None:
    pixels = np.random.default_rng(0).normal(size=(20, 30, 3)).astype(np.float32)
    write_layers({"a": Texture(pixels, "linear", 32, "exr")}, tmp_path / "a.exr", ExrSettings(16, compression))
    found, spec = layers(tmp_path / "a.exr")
    assert spec.format == oiio.HALF
    assert str(spec.getattribute("compression")).startswith(compression)
    np.testing.assert_array_equal(found["a.G"], pixels[..., 1].astype(np.float16))


def test_the_same_maps_give_the_same_bytes(tmp_path: Path) -> None:
    texture = Texture(np.ones((4, 4, 1), np.float32), "unit", 8, "png")
    for name in ("a.exr", "b.exr"):
        write_layers({"ao": texture}, tmp_path / name)
    assert (tmp_path / "a.exr").read_bytes() == (tmp_path / "b.exr").read_bytes()
    assert b"1970:01:01" in (tmp_path / "a.exr").read_bytes()


@pytest.mark.parametrize(
    ("textures", "text"),
    [
        ({}, "no map"),
        ({"a": (2, 2, 3), "b": (3, 3, 3)}, "one size"),
        ({"a.b": (2, 2, 3)}, "letters, digits"),
    ],
)
def test_what_a_file_cannot_hold_is_refused(tmp_path: Path, textures: dict[str, Any], text: str) -> None:
    made = {name: Texture(np.zeros(shape, np.float32), "linear", 32, "exr") for name, shape in textures.items()}
    with pytest.raises(EncodingError, match=text):
        write_layers(made, tmp_path / "a.exr")
    assert not (tmp_path / "a.exr").exists()


def test_values_that_are_no_numbers_or_beyond_half_are_refused(tmp_path: Path) -> None:
    large = Texture(np.full((2, 2, 1), 1e6, np.float32), "linear", 32, "exr")
    with pytest.raises(EncodingError, match="range of half"):
        write_layers({"a": large}, tmp_path / "a.exr", ExrSettings(bits=16))
    with pytest.raises(EncodingError, match="NaN"):
        write_layers({"a": Texture(large.pixels * np.nan, "linear", 32, "exr")}, tmp_path / "a.exr")
    with pytest.raises(EncodingError, match="choose this ending"):
        write_layers({"a": large}, tmp_path / "a.png")
    with pytest.raises(EncodingError, match=r"16 \(half\) or 32"):
        ExrSettings(bits=8)  # type: ignore[arg-type]
    with pytest.raises(EncodingError, match="expected one of none, rle"):
        ExrSettings(compression="jpeg")  # type: ignore[arg-type]
