"""Each map holds what its docstring says."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from flexpara.bake.colors.color import chart_colors
from flexpara.bake.maps.catalogue import MAP_NAMES, all_maps, find_map
from flexpara.bake.maps.normals import to_tangent_space
from flexpara.bake.maps.tangents import unit
from flexpara.bake.raster.gbuffer import GBuffer, rasterize
from flexpara.runtime.errors import InputError
from flexpara.runtime.material import Material
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


@pytest.fixture
def buffer(quad: Pair, context: moderngl.Context) -> GBuffer:
    return rasterize(context, quad[0], 16)


def with_normals(pair: Pair, normal: tuple[float, float, float]) -> Pair:
    atlas, asset = pair
    return atlas, replace(asset, normals=unit(np.tile(np.array(normal), (len(asset.positions), 1))))


def test_the_registry_describes_every_map() -> None:
    assert {
        "normal",
        "normal-object",
        "position",
        "chart",
        "uv-checker",
        "vertex-color",
        "base-color",
        "metallic-roughness",
        "occlusion",
        "orm",
        "emissive",
        "face-id",
        "material-id",
        "distortion",
    } <= set(MAP_NAMES)
    for entry in all_maps().values():
        assert entry.space
        assert entry.units
        assert entry.value_range
        assert entry.compute.__name__ == "compute" or entry.compute.__doc__
        assert len(entry.background) == 3


def test_an_unknown_map_lists_the_names() -> None:
    with pytest.raises(InputError, match=r"'normals': expected one of normal, normal-object, position"):
        find_map("normals")
    with pytest.raises(InputError, match="opengl, directx"):
        all_maps("vulkan")  # type: ignore[arg-type]


def test_position_is_the_surface_point(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = quad
    pixels = find_map("position").compute(buffer, atlas, asset)
    np.testing.assert_allclose(pixels[..., 0], np.broadcast_to((np.arange(16) + 0.5) / 16, (16, 16)), atol=1e-6)
    assert pixels.flags.c_contiguous


def test_own_normals_are_flat_in_tangent_space(quad: Pair, buffer: GBuffer) -> None:
    for normals in (None, quad[0].normals.astype(np.float64)):
        asset = replace(quad[1], normals=normals)
        pixels = find_map("normal").compute(buffer, quad[0], asset)
        np.testing.assert_array_equal(pixels, np.broadcast_to([0, 0, 1], (16, 16, 3)))


def test_a_tilted_normal_leans_along_u_and_v(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = with_normals(quad, (0.3, 0.4, 1.0))
    expected = np.array([0.3, 0.4, 1.0]) / np.sqrt(1.25)
    pixels = find_map("normal").compute(buffer, atlas, asset)
    np.testing.assert_allclose(pixels, np.broadcast_to(expected, (16, 16, 3)), atol=1e-6)


def test_directx_turns_green_down(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = with_normals(quad, (0.3, 0.4, 1.0))
    up = find_map("normal").compute(buffer, atlas, asset)
    entry = find_map("normal", normal_format="directx")
    np.testing.assert_array_equal(entry.compute(buffer, atlas, asset), up * [1, -1, 1])
    assert entry.space == "tangent, Y down"


def test_mirrored_uv_keep_green_along_v(quad: Pair, context: moderngl.Context) -> None:
    atlas, asset = with_normals(quad, (0.3, 0.4, 1.0))
    mirrored = replace(atlas, uv=np.column_stack([1 - atlas.uv[:, 0], atlas.uv[:, 1]]))
    pixels = find_map("normal").compute(rasterize(context, mirrored, 8), mirrored, asset)
    np.testing.assert_allclose(pixels[4, 4], np.array([-0.3, 0.4, 1.0]) / np.sqrt(1.25), atol=1e-6)


def test_tangent_space_is_undone_by_the_decoding_of_mikktspace() -> None:
    rng = np.random.default_rng(4)
    frame = rng.normal(size=(200, 7)).astype(np.float32)
    normal = unit(rng.normal(size=(200, 3))).astype(np.float32)
    local = to_tangent_space(normal, frame)
    axis, tangent, w = frame[:, :3], frame[:, 3:6], np.where(frame[:, 6:] < 0, -1, 1)
    again = local[:, :1] * tangent + local[:, 1:2] * w * np.cross(axis, tangent) + local[:, 2:] * axis
    np.testing.assert_allclose(unit(again.astype(np.float64)), normal, atol=2e-3)
    np.testing.assert_allclose(np.linalg.norm(local, axis=1), 1.0, atol=1e-5)


def test_a_collapsed_frame_gives_the_flat_normal() -> None:
    frame = np.array([[0, 0, 1, 0, 0, 1, 1], [0, 0, 0, 0, 0, 0, 1]], np.float32)
    local = to_tangent_space(np.array([[0, 0.6, 0.8], [0, 0, 1]], np.float32), frame)
    np.testing.assert_array_equal(local, [[0, 0, 1], [0, 0, 1]])


def test_object_normals_are_the_source_s(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = with_normals(quad, (1.0, 2.0, 2.0))
    pixels = find_map("normal-object").compute(buffer, atlas, asset)
    np.testing.assert_allclose(pixels, np.broadcast_to([1 / 3, 2 / 3, 2 / 3], (16, 16, 3)), atol=1e-6)


def test_object_normals_of_a_sphere_are_its_positions(sphere: Pair, context: moderngl.Context) -> None:
    atlas, asset = sphere
    buffer = rasterize(context, atlas, 64)
    pixels = find_map("normal-object").compute(buffer, atlas, asset)
    covered = buffer.face >= 0
    directions = unit(buffer.position[covered].astype(np.float64))
    assert np.abs(pixels[covered] - directions).max() < 1e-3


def test_each_chart_has_its_colour(two_charts: Pair, context: moderngl.Context) -> None:
    atlas, asset = two_charts
    buffer = rasterize(context, atlas, 32)
    pixels = find_map("chart").compute(buffer, atlas, asset)
    for chart, color in enumerate(chart_colors(2)):
        np.testing.assert_array_equal(np.unique(pixels[buffer.face // 2 == chart], axis=0), color[None])


def test_vertex_colours_interpolate_in_linear_light(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = quad
    colors = np.array([[0, 0, 0, 255], [255, 0, 0, 255], [255, 0, 0, 255], [0, 0, 0, 255]], np.uint8)
    pixels = find_map("vertex-color").compute(buffer, atlas, replace(asset, colors=colors))
    assert pixels.shape == (16, 16, 3)
    np.testing.assert_allclose(pixels[..., 0], np.broadcast_to((np.arange(16) + 0.5) / 16, (16, 16)), atol=1e-6)


def test_transparent_colours_keep_their_alpha(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = quad
    pixels = find_map("vertex-color").compute(buffer, atlas, replace(asset, colors=np.full((4, 4), 51, np.uint8)))
    np.testing.assert_allclose(pixels[..., 3], 0.2, atol=1e-6)


def test_vertex_colour_without_colours_is_refused(quad: Pair, buffer: GBuffer) -> None:
    with pytest.raises(InputError, match="mesh has no vertex colours"):
        find_map("vertex-color").compute(buffer, *quad)


def test_base_colour_drops_an_alpha_of_1(quad: Pair, buffer: GBuffer) -> None:
    atlas, asset = quad
    opaque = replace(asset, materials=(Material(base_color_factor=(0.2, 0.4, 0.6, 1.0)),))
    pixels = find_map("base-color").compute(buffer, atlas, opaque)
    np.testing.assert_allclose(pixels, np.broadcast_to([0.2, 0.4, 0.6], (16, 16, 3)), atol=1e-7)
    clear = replace(asset, materials=(Material(base_color_factor=(0.2, 0.4, 0.6, 0.5), alpha_mode="BLEND"),))
    assert find_map("base-color").compute(buffer, atlas, clear).shape == (16, 16, 4)
