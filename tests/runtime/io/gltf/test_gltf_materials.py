"""Materials of glTF files keep their textures, samplers, placements and factors."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from flexpara.runtime.errors import MeshError
from flexpara.runtime.io.gltf.buffers import GltfFile
from flexpara.runtime.io.gltf.materials import read_materials, uv_set
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.material import SLOTS, Material

TEXTURES = {
    "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}, "metallicRoughnessTexture": {"index": 1}},
    "normalTexture": {"index": 0, "scale": 0.5},
    "emissiveTexture": {"index": 1},
    "occlusionTexture": {"index": 0, "strength": 0.25},
}


def picture_uri(level: int) -> str:
    data = io.BytesIO()
    Image.new("RGB", (2, 3), (level, 0, 0)).save(data, "PNG")
    return "data:image/png;base64," + base64.b64encode(data.getvalue()).decode()


def read(*materials: dict[str, Any], **tree: Any) -> tuple[list[Material], dict[str, int]]:
    whole: dict[str, Any] = {
        "materials": list(materials),
        "textures": [{"source": 0}, {"source": 1, "sampler": 0}],
        "images": [{"uri": picture_uri(10)}, {"uri": picture_uri(20)}],
        "samplers": [{"wrapS": 33648, "wrapT": 33071, "magFilter": 9728}],
        **tree,
    }
    return read_materials(GltfFile(whole, [], Path()))


def test_every_slot_is_read() -> None:
    (material,), changes = read(TEXTURES)
    assert set(material.pictures) == set(SLOTS)
    levels = {slot: int(picture.pixels[0, 0, 0]) for slot, picture in material.pictures.items()}
    assert levels == {"base-color": 10, "metallic-roughness": 20, "normal": 10, "emissive": 20, "occlusion": 10}
    assert material.pictures["normal"].pixels is material.pictures["base-color"].pixels  # decoded once
    assert (material.normal_scale, material.occlusion_strength) == (0.5, 0.25)
    assert not any(changes.values())


def test_a_webp_picture_is_read() -> None:
    data = io.BytesIO()
    Image.new("RGB", (2, 2), (0, 77, 0)).save(data, "WEBP", lossless=True)
    webp = {"uri": "data:image/webp;base64," + base64.b64encode(data.getvalue()).decode()}
    alone = {"extensions": {"EXT_texture_webp": {"source": 1}}}
    (material,), changes = read(TEXTURES, textures=[alone, alone], images=[{"uri": picture_uri(10)}, webp])
    assert material.pictures["base-color"].pixels[0, 0].tolist() == [0, 77, 0, 255]
    assert not any(changes.values())


def test_samplers_say_how_it_goes_on_outside() -> None:
    (material,), _ = read(TEXTURES)
    assert material.pictures["base-color"].wrap == ("repeat", "repeat")
    assert material.pictures["base-color"].smooth
    assert material.pictures["emissive"].wrap == ("mirror", "clamp")
    assert not material.pictures["emissive"].smooth


def test_factors_are_linear_and_limited() -> None:
    entry = {
        "pbrMetallicRoughness": {"baseColorFactor": [2, -1, 0.5, 1], "metallicFactor": 0.25},
        "emissiveFactor": [1, 0.5, 0],
        "extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": 6}},
        "alphaMode": "MASK",
        "alphaCutoff": 0.3,
        "doubleSided": True,
    }
    (material,), _ = read(entry)
    assert material.base_color_factor == (1.0, 0.0, 0.5, 1.0)
    assert (material.metallic, material.roughness) == (0.25, 1.0)
    assert material.emissive == (6.0, 3.0, 0.0)
    assert (material.alpha_mode, material.alpha_cutoff, material.double_sided) == ("MASK", 0.3, True)


def test_a_texture_without_a_picture_is_counted() -> None:
    (material,), changes = read(TEXTURES, textures=[{}, {"source": 1}])
    assert set(material.pictures) == {"metallic-roughness", "emissive"}
    assert changes["textures_not_decoded"] == 3
    assert set(material.unread) == {"base-color", "normal", "occlusion"}
    assert material.unread["normal"] == "has its picture in no extension, which is not read"


def test_a_texture_on_another_uv_set_is_not_baked_and_counted() -> None:
    entry = {**TEXTURES, "occlusionTexture": {"index": 0, "texCoord": 1}}
    (material,), changes = read(entry)
    assert "occlusion" not in material.pictures
    assert changes["textures_of_other_uv"] == 1


def test_the_uv_set_is_that_of_the_first_texture() -> None:
    assert uv_set({"normalTexture": {"index": 0, "texCoord": 2}, "emissiveTexture": {"index": 0}}) == 2
    assert uv_set({}) == 0


@pytest.mark.parametrize(
    ("transform", "uv", "expected"),
    [
        ({"offset": [0.25, 0.125]}, (0.5, 0.5), (0.75, 0.625)),
        ({"scale": [2, 3]}, (0.5, 0.25), (1.0, 0.75)),
        ({"rotation": np.pi / 2}, (0.25, 0.0), (0.0, -0.25)),  # counter-clockwise as seen, in uv that are v down
        ({"rotation": np.pi / 2, "scale": [2, 1], "offset": [0.5, 0]}, (0.25, 0.125), (0.625, -0.5)),
    ],
)
def test_a_texture_transform_moves_uv(transform: dict[str, Any], uv: Any, expected: Any) -> None:
    """All uv here are v down, as in the file; the placement is for v up."""
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    (material,), _ = read({"pbrMetallicRoughness": {"baseColorTexture": info}})
    (a, b, c), (d, e, f) = material.pictures["base-color"].placement
    u, v = uv[0], 1 - uv[1]
    np.testing.assert_allclose((a * u + b * v + c, 1 - (d * u + e * v + f)), expected, atol=1e-12)


@pytest.mark.parametrize(
    "entry",
    ['"alphaMode": "GLASS"', '"alphaCutoff": NaN', '"emissiveFactor": [1, 2]', '"normalTexture": {"index": 7}'],
)
def test_broken_materials_are_bad_input(tmp_path: Path, entry: str) -> None:
    path = tmp_path / "bad.gltf"
    path.write_text(f'{{"asset": {{"version": "2.0"}}, "materials": [{{{entry}}}]}}')
    with pytest.raises(MeshError, match="damaged"):
        load_asset(path)
