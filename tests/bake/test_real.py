"""Real meshes: a textured cow on its own uv, and what was written read back."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.baker import bake
from flexpara.bake.files.gltf import write_glb
from flexpara.bake.pictures.preview import preview_pixels
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.material import Material, Picture
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pack.packing import atlas_from_uv

MakeGBuffer = Callable[[Atlas, int], GBuffer]

Pair = tuple[Atlas, Asset]


@pytest.fixture
def spot(models: Path) -> Pair:
    """5,856 faces with uv, drawn together a little, since the file's leave the square."""
    asset = load_asset(models / "spot.obj")
    assert asset.uv is not None
    asset = replace(asset, uv=asset.uv * 0.9 + 0.06)
    return atlas_from_uv(asset), asset


def test_every_texel_lies_on_the_face_it_names(make_gbuffer: MakeGBuffer, spot: Pair) -> None:
    atlas, _ = spot
    buffer = make_gbuffer(atlas, 512)
    texels = buffer.texels
    assert 0.3 < len(texels) / 512**2 < 1.0
    faces = buffer.face.reshape(-1)[texels]
    weights = buffer.barycentric.reshape(-1, 3)[texels].astype(np.float64)
    expected = np.einsum("tc,tci->ti", weights, atlas.positions[atlas.faces[faces]])
    assert np.abs(buffer.position.reshape(-1, 3)[texels] - expected).max() < 1e-5
    assert len(np.unique(faces)) > 0.97 * len(atlas.faces)  # some are smaller than a texel
    uv = np.einsum("tc,tci->ti", weights, atlas.corner_uv[faces]) * 512
    row, column = np.divmod(texels, 512)
    away = np.hypot(uv[:, 0] - (column + 0.5), 512 - uv[:, 1] - (row + 0.5))
    assert away.max() < 0.72
    assert np.quantile(away, 0.9) < 1e-2


def test_a_texture_resampled_onto_its_own_uv_is_itself(make_gbuffer: MakeGBuffer, spot: Pair) -> None:
    atlas, asset = spot
    image = np.random.default_rng(0).integers(0, 256, (256, 256, 4)).astype(np.uint8)
    image[..., 3] = 255
    textured = replace(
        asset,
        materials=(Material(pictures={"base-color": Picture(image)}),),
        face_material=np.zeros(len(asset.faces), np.int64),
    )
    buffer = make_gbuffer(atlas, 256)
    from_source = bake(atlas, textured, ["base-color"], size=256, padding=0)["base-color"]
    weights = buffer.barycentric
    inside = (buffer.face >= 0) & (weights.min(axis=-1) > 1e-4)
    linear = bake(atlas, replace(textured, materials=(Material(),)), ["base-color"], size=256)["base-color"].pixels
    assert (linear == 1.0).all()
    stored = np.round(255 * np.clip(from_source.pixels, 0, None) ** (1 / 2.4) * 1.055 - 0.055 * 255)
    bright = inside[..., None] & (image[..., :3] > 20)
    assert np.abs(stored - image[..., :3])[bright].max() <= 1


def test_a_glb_read_back_gives_the_same_bake(spot: Pair, tmp_path: Path) -> None:
    atlas, asset = spot
    write_glb(atlas, asset, bake(atlas, asset, ["uv-checker"], size=64), tmp_path / "spot.glb")
    again = load_asset(tmp_path / "spot.glb")
    np.testing.assert_array_equal(again.surface.faces.shape, asset.surface.faces.shape)
    first = bake(atlas, asset, ["position"], size=256, padding=2)["position"].pixels
    second = bake(atlas_from_uv(again), again, ["position"], size=256, padding=2)["position"].pixels
    assert (np.abs(first - second).max(axis=-1) > 1e-4).mean() < 1e-3  # texel centres on an edge may change sides
    card = bake(atlas, asset, ["uv-checker"], size=64)["uv-checker"].pixels
    assert np.abs(again.materials[0].pictures["base-color"].pixels[..., :3] / 255.0 - card ** (1 / 2.4)).mean() < 0.05


def test_the_preview_of_a_real_mesh_is_no_empty_page(spot: Pair) -> None:
    atlas, asset = spot
    picture = preview_pixels(atlas, asset)
    assert np.isfinite(picture).all()
    assert picture.std() > 0.1
