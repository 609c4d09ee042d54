"""What is rendered with the new textures looks like what is rendered with the old ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import textured

from flexpara.bake.baker import bake
from flexpara.bake.colors.color import srgb_exact
from flexpara.bake.files.images import quantize
from flexpara.bake.maps.material import base_color_map, emissive_map, metallic_roughness_map, occlusion_map
from flexpara.bake.maps.normals import object_normal_map
from flexpara.bake.maps.tangents import split_by_tangents
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.runtime.material import Material, Picture
from flexpara.runtime.mesh import Asset, Atlas

MakeGBuffer = Callable[[Atlas, int], GBuffer]


SIZE = 256
BAR = 40.0


def seen_from_above(atlas: Atlas) -> Atlas:
    """The faces that look up, with the screen as their uv: a render is a bake onto it."""
    assert np.ptp(atlas.positions[:, 2]) == pytest.approx(2.0)
    corner = atlas.positions[atlas.faces]
    up = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])[:, 2] > 1e-6
    return replace(atlas, faces=atlas.faces[up], uv=(atlas.positions[:, :2] / 6.2 + 0.5).astype(np.float32))


def on_faces(asset: Asset, screen: Atlas, atlas: Atlas) -> Asset:
    """The asset with the faces that the screen shows."""
    where = {tuple(face): number for number, face in enumerate(atlas.faces.tolist())}
    shown = np.array([where[tuple(face)] for face in screen.faces.tolist()])
    assert asset.face_material is not None
    return replace(asset, faces=asset.faces[shown], face_material=asset.face_material[shown])


def renders(make_gbuffer: MakeGBuffer, atlas: Atlas, asset: Asset, pixels: int) -> dict[str, np.ndarray]:
    """Name → (t, c) values in [0, 1] of the covered pixels, as a display shows them."""
    screen = seen_from_above(atlas)
    shown = on_faces(asset, screen, atlas)
    buffer = make_gbuffer(screen, pixels)
    maps = {
        "base-color": base_color_map(),
        "metallic-roughness": metallic_roughness_map(),
        "emissive": emissive_map(),
        "occlusion": occlusion_map(),
        "normal": object_normal_map(),
    }
    drawn = {name: compute(buffer, screen, shown) for name, compute in maps.items()}
    found: dict[str, Any] = {name: image.reshape(-1, image.shape[-1])[buffer.texels] for name, image in drawn.items()}
    found["normal"] = found["normal"] * 0.5 + 0.5
    for name in ("base-color", "emissive"):
        found[name] = srgb_exact(np.clip(found[name][:, :3], 0.0, 1.0))
    return found


def rebaked(atlas: Atlas, asset: Asset, size: int) -> Asset:
    """The asset as a reader of the written files has it: 8-bit textures on the new uv."""
    textures = bake(atlas, asset, ["base-color", "metallic-roughness", "occlusion", "emissive", "normal"], size=size)
    pictures: Any = {}
    for name, texture in textures.items():
        pixels = quantize(texture, bits=8)
        rgb = np.broadcast_to(pixels, (*pixels.shape[:2], 3)) if pixels.shape[2] == 1 else pixels
        rgba = np.concatenate([rgb, np.full((*pixels.shape[:2], 1), 255, np.uint8)], -1).astype(np.uint8)
        pictures[name] = Picture(rgba, ("clamp", "clamp"))
    material = Material(pictures=pictures, metallic=1.0, roughness=1.0, emissive=(1.0, 1.0, 1.0))
    assert asset.normals is not None
    return Asset(
        positions=atlas.positions,
        faces=atlas.faces,
        weld=asset.weld[atlas.source_vertex],
        surface=asset.surface,
        normals=asset.normals[atlas.source_vertex],
        uv=atlas.uv.astype(np.float64),
        materials=(material,),
        face_material=np.zeros(len(atlas.faces), np.int64),
    )


def psnr(first: np.ndarray, second: np.ndarray) -> float:
    return float(-10 * np.log10(np.mean((first - second) ** 2)))


@pytest.mark.parametrize("wrap", [("repeat", "repeat"), ("mirror", "clamp")])
def test_the_renders_before_and_after_agree(
    make_gbuffer: MakeGBuffer, monkeypatch: pytest.MonkeyPatch, wrap: Any
) -> None:
    """At twice the texels: the old picture of 256² lies twice around the torus, the new one has 1024²."""
    material = textured.rich_material(SIZE, wrap=wrap, emissive=(1.0, 1.0, 1.0))
    asset = textured.torus_asset(material)
    atlas = split_by_tangents(textured.new_atlas(asset, 4 * SIZE))
    after = rebaked(atlas, asset, 4 * SIZE)
    own = replace(atlas, source_vertex=np.arange(len(atlas.positions)))
    monkeypatch.setattr("flexpara.bake.maps.resample.SHARPEN", 0.0)  # what looks at the textures filters bilinearly
    old, new = renders(make_gbuffer, atlas, asset, 512), renders(make_gbuffer, own, after, 512)
    found = {name: psnr(old[name], new[name]) for name in old}
    assert min(found.values()) >= BAR, found
