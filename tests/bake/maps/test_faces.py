"""Maps of faces are flat on a face, and packed maps hold what the single ones hold."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import moderngl
import numpy as np

from flexpara.bake.baker import bake
from flexpara.bake.colors.color import chart_colors
from flexpara.bake.maps.faces import distortion_map, face_id_map, material_id_map
from flexpara.bake.maps.material import metallic_roughness_map, occlusion_map, orm_map
from flexpara.bake.raster.gbuffer import rasterize
from flexpara.runtime.material import SLOTS, Material, Picture
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def test_face_numbers_are_exact_and_nothing_is_minus_one(two_charts: Pair) -> None:
    pixels = bake(*two_charts, ["face-id"], size=64, padding=0)["face-id"].pixels
    assert set(np.unique(pixels)) == {-1.0, 0.0, 1.0, 2.0, 3.0}
    assert pixels.shape == (64, 64, 1)


def test_face_numbers_are_those_of_the_buffer(sphere: Pair, context: moderngl.Context) -> None:
    buffer = rasterize(context, sphere[0], 64)
    np.testing.assert_array_equal(face_id_map(buffer, *sphere)[..., 0], buffer.face)


def test_each_material_has_its_colour(two_charts: Pair, context: moderngl.Context) -> None:
    atlas, asset = two_charts
    asset = replace(asset, materials=(Material(), Material()), face_material=np.array([1, 1, 0, 0]))
    buffer = rasterize(context, atlas, 32)
    pixels = material_id_map(buffer, atlas, asset)
    for chart, color in ((0, chart_colors(2)[1]), (1, chart_colors(2)[0])):
        np.testing.assert_array_equal(np.unique(pixels[buffer.face // 2 == chart], axis=0), color[None])


def test_an_isometric_chart_is_white_and_larger_uv_are_red(two_charts: Pair, context: moderngl.Context) -> None:
    atlas, asset = two_charts
    white = distortion_map()(rasterize(context, atlas, 32), atlas, asset)[16, 8]
    assert np.ptp(white) < 0.05
    assert white.min() > 0.7
    larger = atlas.uv.copy()
    larger[4:] = (larger[4:] - 0.75) * 1.6 + 0.75
    uneven = replace(atlas, uv=np.clip(larger, 0, 1))
    buffer = rasterize(context, uneven, 64)
    pixels = distortion_map()(buffer, uneven, asset)
    small, large = pixels[buffer.face == 0][0], pixels[buffer.face == 3][0]
    assert small[2] > small[0] + 0.1  # blue
    assert large[0] > large[2] + 0.1  # red


def test_orm_holds_occlusion_and_finish(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    noise = np.random.default_rng(1).integers(0, 256, (8, 8, 4)).astype(np.uint8)
    pictures: Any = {slot: Picture(noise) for slot in SLOTS}
    rich = replace(asset, uv=atlas.uv.astype(np.float64), materials=(Material(pictures=pictures),))
    buffer = rasterize(context, atlas, 16)
    packed = orm_map()(buffer, atlas, rich)
    np.testing.assert_array_equal(packed[..., 0], occlusion_map()(buffer, atlas, rich)[..., 0])
    np.testing.assert_array_equal(packed[..., 1:], metallic_roughness_map()(buffer, atlas, rich)[..., 1:])
