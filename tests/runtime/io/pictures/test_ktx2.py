"""KTX 2 pictures, written by another program's encoder (alktx2 0.1.7, basis_universal 2.10)."""

from __future__ import annotations

import base64
from pathlib import Path

import numpy as np
import pytest

from flexpara.runtime.errors import InputError, MeshError
from flexpara.runtime.io.gltf.buffers import GltfFile
from flexpara.runtime.io.gltf.materials import read_materials
from flexpara.runtime.io.pictures.ktx2 import decode_ktx2
from flexpara.runtime.material import Material, refuse_unread
from flexpara.runtime.mesh import Asset

pytest.importorskip("opengl_basisu")

ETC1S = (
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAABAAAAaAAAADwAAACkAAAAJAAAAMgAAAAAAAAAlAAAAAAAAABcAQAA"
    "AAAAAAQAAAAAAAAAAAAAAAAAAAA8AAAAAAAAAAIAOACjAQIAAwMAAAgIAAAAAAAAAAA/AAAAAAAAAAAA/////0AAPw8AAAAAAAAAAP////8fAAAA"
    "S1RYd3JpdGVyAEJhc2lzIFVuaXZlcnNhbCAyLjEwAAAFAAIAMgAAAAkAAAAxAAAAAAAAAAAAAAAAAAAAAgAAAAIAAAACAAAAHECUAAAAAACIB6Ig"
    "ApgBAAAAAABA2qkApgAIAAAAgKAZfRGAKQACAAAAIAhPYUU89QGsqqqqUlVVVQUAwUQAAAAAAADy3ydIATABQAAAAAACuQwBUQIGAACAQcNePgJR"
    "CAAmAAAAAAAAEEAACwDGPw=="
)
UASTC = (
    "q0tUWCAyMLsNChoKAAAAAAEAAAAIAAAACAAAAAAAAAAAAAAAAQAAAAEAAAAAAAAAaAAAACwAAACUAAAALAAAAAAAAAAAAAAAAAAAAAAAAADAAAAA"
    "AAAAAEAAAAAAAAAAQAAAAAAAAAAsAAAAAAAAAAIAKACmAQIAAwMAABAAAAAAAAAAAAB/AwAAAAAAAAAA/////x8AAABLVFh3cml0ZXIAQmFzaXMg"
    "VW5pdmVyc2FsIDIuMTAAAAQAAAB/fwAAFxkA4P/zAAAAAAAAAAAAABeAFuBfAwwAAAAAAAAAAAAXAID7HwPAAQAAAAAAAAAAFxAQEBBACAEAAAAA"
    "AAAAAA=="
)


def four_squares() -> np.ndarray:
    """What was encoded: red and green above blue and grey, which is half transparent; 8 × 8."""
    pixels = np.zeros((8, 8, 4), np.uint8)
    pixels[..., 3] = 255
    pixels[:4, :4, 0], pixels[:4, 4:, 1], pixels[4:, :4, 2] = 200, 180, 220
    pixels[4:, 4:] = 128
    return pixels


@pytest.mark.parametrize("text", [ETC1S, UASTC], ids=["etc1s", "uastc"])
def test_both_codecs_decode_to_what_was_encoded(text: str) -> None:
    found = decode_ktx2(base64.b64decode(text))
    assert np.abs(found.astype(int) - four_squares()).max() <= 1


@pytest.mark.parametrize("length", [12, 100, 300])
def test_a_damaged_picture_is_refused(length: int) -> None:
    with pytest.raises(MeshError, match="expected KTX 2 of Basis Universal"):
        decode_ktx2(base64.b64decode(ETC1S)[:length])


def read(data: bytes) -> Material:
    tree = {
        "materials": [{"name": "Crate", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"extensions": {"KHR_texture_basisu": {"source": 0}}}],
        "images": [{"uri": "data:image/ktx2;base64," + base64.b64encode(data).decode()}],
    }
    (material,), _ = read_materials(GltfFile(tree, [], Path()))
    return material


def test_a_glTF_texture_has_it_as_its_picture() -> None:  # noqa: N802  # the format's name
    found = read(base64.b64decode(UASTC)).pictures["base-color"].pixels
    np.testing.assert_array_equal(found[[0, 0, 7, 7], [0, 7, 0, 7]], four_squares()[[0, 0, 7, 7], [0, 7, 0, 7]])


def test_one_that_cannot_be_decoded_is_not_replaced() -> None:
    material = read(base64.b64decode(UASTC)[:90])
    assert not material.pictures
    plain = np.zeros((3, 3))
    asset = Asset(plain, np.array([[0, 1, 2]]), np.arange(3), None, uv=plain[:, :2], materials=(material,))  # type: ignore[arg-type]
    with pytest.raises(InputError, match=r"texture of material Crate is a KTX 2 picture .* save it as PNG"):
        refuse_unread(asset, ["base-color"])
    refuse_unread(asset, ["ao"])
