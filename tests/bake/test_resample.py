"""The source's colours land where the surface carries them."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np

from flexpara.bake.color import byte_to_linear
from flexpara.bake.gbuffer import rasterize
from flexpara.bake.resample import linear_colors, sample_bilinear, source_color
from flexpara.runtime.mesh import Asset, Atlas, Material

Pair = tuple[Atlas, Asset]


def picture(height: int, width: int) -> np.ndarray:
    levels = np.random.default_rng(7).integers(0, 256, (height, width, 4)).astype(np.uint8)
    levels[..., 3] = 255
    return levels


def test_texel_centres_give_the_texels() -> None:
    image = picture(3, 5)
    row, column = np.mgrid[0:3, 0:5]
    uv = np.stack([(column + 0.5) / 5, 1 - (row + 0.5) / 3], axis=-1).reshape(-1, 2).astype(np.float32)
    np.testing.assert_allclose(sample_bilinear(image, uv), linear_colors(image).reshape(-1, 4), atol=1e-5)


def test_half_way_between_two_texels_is_their_mean_in_linear_light() -> None:
    image = np.zeros((1, 2, 4), np.uint8)
    image[0, 1] = 255
    sample = sample_bilinear(image, np.array([[0.5, 0.5]], np.float32))
    np.testing.assert_allclose(sample, [[0.5, 0.5, 0.5, 0.5]], atol=1e-6)


def test_the_texture_repeats_outside_the_square_and_filters_across_the_edge() -> None:
    image = picture(4, 4)
    uv = np.random.default_rng(3).random((50, 2)).astype(np.float32)
    shifted = (uv + np.array([2.0, -3.0])).astype(np.float32)
    np.testing.assert_allclose(sample_bilinear(image, shifted), sample_bilinear(image, uv), atol=1e-4)
    edge = sample_bilinear(image, np.array([[0.0, 0.875]], np.float32))[0]
    linear = linear_colors(image)
    np.testing.assert_allclose(edge, (linear[0, 0] + linear[0, 3]) / 2, atol=1e-5)


def test_alpha_of_vertex_colours_is_not_curved() -> None:
    np.testing.assert_allclose(linear_colors(np.array([[0, 188, 255, 51]], np.uint8))[0], [0, 0.503, 1, 0.2], atol=2e-3)


def test_a_texture_under_turned_uv_is_turned(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    image = picture(16, 16)
    turned = np.column_stack([atlas.uv[:, 1], 1 - atlas.uv[:, 0]]).astype(np.float64)  # old uv of each corner
    asset = replace(asset, uv=turned, materials=(Material(base_color=image),))
    color = source_color(rasterize(context, atlas, 16), atlas, asset)
    np.testing.assert_allclose(color, np.rot90(linear_colors(image), 1), atol=1e-4)


def test_far_uv_tiles_keep_their_digits(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    image = picture(16, 16)
    buffer = rasterize(context, atlas, 16)
    near = replace(asset, uv=atlas.uv.astype(np.float64), materials=(Material(base_color=image),))
    far = replace(near, uv=atlas.uv.astype(np.float64) + np.array([4000.0, -7000.0]))
    np.testing.assert_allclose(source_color(buffer, atlas, far), source_color(buffer, atlas, near), atol=1e-4)


def test_each_face_takes_its_own_material(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    materials = (Material(base_color_factor=(1, 0, 0, 1)), Material(base_color_factor=(0, 0.25, 0, 1)))
    asset = replace(asset, materials=materials, face_material=np.array([1, 0]))
    buffer = rasterize(context, atlas, 8)
    color = source_color(buffer, atlas, asset)
    np.testing.assert_allclose(color[buffer.face == 0], np.tile([0, 0.25, 0, 1], ((buffer.face == 0).sum(), 1)))
    np.testing.assert_allclose(color[buffer.face == 1], np.tile([1, 0, 0, 1], ((buffer.face == 1).sum(), 1)))


def test_vertex_colours_stand_in_for_a_texture_and_factors_multiply(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    colors = np.array([[0, 0, 0, 255], [255, 0, 0, 255], [255, 255, 0, 255], [0, 255, 0, 255]], np.uint8)
    asset = replace(asset, colors=colors, materials=(Material(base_color_factor=(0.5, 1, 1, 1)),))
    color = source_color(rasterize(context, atlas, 32), atlas, asset)
    place = (np.arange(32) + 0.5) / 32
    np.testing.assert_allclose(color[..., 0], np.broadcast_to(place * 0.5, (32, 32)), atol=1e-5)
    np.testing.assert_allclose(color[..., 1], np.broadcast_to(1 - place[:, None], (32, 32)), atol=1e-5)


def test_without_any_colour_the_surface_is_white(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = quad
    np.testing.assert_array_equal(source_color(rasterize(context, atlas, 4), atlas, asset), np.ones((4, 4, 4)))


def test_byte_to_linear_is_monotonic() -> None:
    assert (np.diff(byte_to_linear()) > 0).all()
