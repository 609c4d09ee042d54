"""The source's textures land where the surface carries them, with what its material says about them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import pytest

from flexpara.bake.maps.material import (
    base_color_map,
    emissive_map,
    emissive_strength,
    from_tangent_space,
    metallic_roughness_map,
    occlusion_map,
    textured_normals,
)
from flexpara.bake.maps.normals import tangent_normal_map, to_tangent_space
from flexpara.bake.maps.resample import linear_colors
from flexpara.bake.maps.tangents import unit
from flexpara.bake.raster.gbuffer import GBuffer, rasterize
from flexpara.runtime.material import Material, Picture
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def noise(height: int, width: int) -> np.ndarray:
    levels = np.random.default_rng(7).integers(0, 256, (height, width, 4)).astype(np.uint8)
    levels[..., 3] = 255
    return levels


def flat(*levels: int) -> Picture:
    """A picture of one colour."""
    return Picture(np.broadcast_to(np.array(levels, np.uint8), (4, 4, 4)))


@pytest.fixture
def buffer(quad: Pair, context: moderngl.Context) -> GBuffer:
    return rasterize(context, quad[0], 16)


def with_material(pair: Pair, **changes: Any) -> Pair:
    """The pair with its own uv as the old ones, and one material."""
    atlas, asset = pair
    return atlas, replace(asset, uv=atlas.uv.astype(np.float64), materials=(Material(**changes),))


def test_a_texture_under_turned_uv_is_turned(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    image = noise(16, 16)
    turned = np.column_stack([atlas.uv[:, 1], 1 - atlas.uv[:, 0]]).astype(np.float64)  # old uv of each corner
    asset = replace(asset, uv=turned, materials=(Material(pictures={"base-color": Picture(image)}),))
    color = base_color_map()(rasterize(context, atlas, 16), atlas, asset)
    np.testing.assert_allclose(color, np.rot90(linear_colors(image), 1), atol=1e-4)


def test_far_uv_tiles_keep_their_digits(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    image = noise(16, 16)
    buffer = rasterize(context, atlas, 16)
    near = replace(
        asset, uv=atlas.uv.astype(np.float64), materials=(Material(pictures={"base-color": Picture(image)}),)
    )
    far = replace(near, uv=atlas.uv.astype(np.float64) + np.array([4000.0, -7000.0]))
    np.testing.assert_allclose(base_color_map()(buffer, atlas, far), base_color_map()(buffer, atlas, near), atol=1e-4)


def test_each_face_takes_its_own_material(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    materials = (Material(base_color_factor=(1, 0, 0, 1)), Material(base_color_factor=(0, 0.25, 0, 1)))
    asset = replace(asset, materials=materials, face_material=np.array([1, 0]))
    buffer = rasterize(context, atlas, 8)
    color = base_color_map()(buffer, atlas, asset)
    np.testing.assert_allclose(color[buffer.face == 0], np.tile([0, 0.25, 0, 1], ((buffer.face == 0).sum(), 1)))
    np.testing.assert_allclose(color[buffer.face == 1], np.tile([1, 0, 0, 1], ((buffer.face == 1).sum(), 1)))


def test_vertex_colours_stand_in_for_a_texture_and_factors_multiply(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    colors = np.array([[0, 0, 0, 255], [255, 0, 0, 255], [255, 255, 0, 255], [0, 255, 0, 255]], np.uint8)
    asset = replace(asset, colors=colors, materials=(Material(base_color_factor=(0.5, 1, 1, 1)),))
    color = base_color_map()(rasterize(context, atlas, 32), atlas, asset)
    place = (np.arange(32) + 0.5) / 32
    np.testing.assert_allclose(color[..., 0], np.broadcast_to(place * 0.5, (32, 32)), atol=1e-5)
    np.testing.assert_allclose(color[..., 1], np.broadcast_to(1 - place[:, None], (32, 32)), atol=1e-5)


def test_without_any_colour_the_surface_is_white(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    np.testing.assert_array_equal(base_color_map()(rasterize(context, atlas, 4), atlas, asset), np.ones((4, 4, 4)))


def test_opaque_materials_ignore_alpha(quad: Pair, buffer: GBuffer) -> None:
    pictures = {"base-color": flat(255, 255, 255, 51)}
    for mode, expected in (("OPAQUE", 1.0), ("BLEND", 0.2), ("MASK", 0.4)):
        pair = with_material(quad, pictures=pictures, alpha_mode=mode, alpha_cutoff=0.25)
        np.testing.assert_allclose(base_color_map()(buffer, *pair)[..., 3], expected, atol=1e-6)


def test_vertex_colours_multiply_the_textures_of_gltf(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = with_material(quad, pictures={"base-color": flat(255, 0, 255, 255)})
    asset = replace(asset, colors=np.full((4, 4), (188, 188, 0, 255), np.uint8))
    np.testing.assert_allclose(base_color_map()(buffer, atlas, asset)[3, 3], [0.503, 0, 0, 1], atol=1e-3)


def test_finish_is_factor_times_texture(quad: Pair, buffer: GBuffer) -> None:
    pair = with_material(quad, pictures={"metallic-roughness": flat(9, 102, 204, 255)}, metallic=0.5, roughness=0.25)
    np.testing.assert_allclose(metallic_roughness_map()(buffer, *pair)[5, 5], [1, 0.1, 0.4], atol=1e-6)
    plain = quad[0], replace(quad[1], materials=(Material(),))
    np.testing.assert_allclose(metallic_roughness_map()(buffer, *plain)[5, 5], [1, 0.8, 0.0], atol=1e-6)


def test_occlusion_takes_red_and_its_strength(quad: Pair, buffer: GBuffer) -> None:
    pair = with_material(quad, pictures={"occlusion": flat(51, 255, 255, 255)}, occlusion_strength=0.5)
    np.testing.assert_allclose(occlusion_map()(buffer, *pair), 0.6, atol=1e-6)
    np.testing.assert_array_equal(occlusion_map()(buffer, *quad), 1.0)


def test_emission_is_kept_below_1_and_its_strength_told(quad: Pair, buffer: GBuffer) -> None:
    pair = with_material(quad, pictures={"emissive": flat(255, 255, 0, 255)}, emissive=(4.0, 2.0, 1.0))
    assert emissive_strength(pair[1]) == 4.0
    np.testing.assert_allclose(emissive_map()(buffer, *pair)[2, 2], [1, 0.5, 0], atol=1e-6)


def test_textures_need_uv(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = with_material(quad, pictures={"base-color": flat(0, 0, 0, 255)})
    np.testing.assert_array_equal(base_color_map()(buffer, atlas, replace(asset, uv=None)), 1.0)


def encoded(normal: Any) -> Picture:
    """A normal texture of one direction, 8 bits."""
    level = np.round((np.asarray(normal) + 1) / 2 * 255)
    return flat(*level.astype(int), 255)


def test_a_normal_texture_leans_along_the_old_axes(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = with_material(quad, pictures={"normal": encoded([0.6, 0.0, 0.8])})
    turned = replace(asset, uv=np.column_stack([atlas.uv[:, 1], 1 - atlas.uv[:, 0]]).astype(np.float64))  # u along y
    found = textured_normals()(buffer, atlas, turned, buffer.texels)
    np.testing.assert_allclose(found, np.tile([0, 0.6, 0.8], (len(found), 1)), atol=4e-3)
    np.testing.assert_allclose(tangent_normal_map("opengl")(buffer, atlas, turned)[8, 8], [0, 0.6, 0.8], atol=4e-3)
    np.testing.assert_allclose(tangent_normal_map("directx")(buffer, atlas, turned)[8, 8], [0, -0.6, 0.8], atol=4e-3)


def test_a_normal_texture_under_mirrored_uv_keeps_green_along_v(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = with_material(quad, pictures={"normal": encoded([0.48, 0.36, 0.8])})
    mirrored = replace(asset, uv=np.column_stack([1 - atlas.uv[:, 0], atlas.uv[:, 1]]).astype(np.float64))
    found = textured_normals()(buffer, atlas, mirrored, buffer.texels)
    np.testing.assert_allclose(found[0], [-0.48, 0.36, 0.8], atol=6e-3)


def test_the_same_uv_give_the_same_normal_texture(sphere: Pair, context: moderngl.Context) -> None:
    atlas, asset = with_material(sphere, pictures={"normal": encoded([0.36, -0.48, 0.8])}, normal_scale=1.0)
    buffer = rasterize(context, atlas, 64)
    found = tangent_normal_map("opengl")(buffer, atlas, asset).reshape(-1, 3)[buffer.texels]
    np.testing.assert_allclose(found, np.tile([0.36, -0.48, 0.8], (len(found), 1)), atol=5e-3)


def test_the_scale_of_a_normal_texture_multiplies_x_and_y(quad: Pair, buffer: GBuffer) -> None:
    pair = with_material(quad, pictures={"normal": encoded([0.6, 0.0, 0.8])}, normal_scale=2.0)
    expected = unit(np.array([1.2, 0.0, 0.8]))
    np.testing.assert_allclose(textured_normals()(buffer, *pair, buffer.texels)[0], expected, atol=7e-3)


def test_leaving_tangent_space_undoes_entering_it() -> None:
    rng = np.random.default_rng(4)
    frame = rng.normal(size=(200, 7)).astype(np.float32)
    normal = unit(rng.normal(size=(200, 3))).astype(np.float32)
    np.testing.assert_allclose(from_tangent_space(to_tangent_space(normal, frame), frame), normal, atol=2e-3)
