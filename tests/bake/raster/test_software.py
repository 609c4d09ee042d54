"""The numpy rasterizer and the device agree: the same faces, the same points."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from flexpara.bake.raster.gbuffer import GBuffer, rasterize
from flexpara.bake.raster.software import rasterize_in_software
from flexpara.runtime.errors import InputError
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pack.packing import atlas_from_uv

Pair = tuple[Atlas, Asset]


def assert_equal(first: GBuffer, second: GBuffer) -> None:
    np.testing.assert_array_equal(first.face, second.face)
    np.testing.assert_array_equal(first.inside, second.inside)
    for name in ("position", "normal", "second", "third"):
        assert np.abs(getattr(first, name) - getattr(second, name)).max() < 1e-5, name


def test_a_quad_whose_position_is_its_uv_holds_the_texel_centres(quad: Pair) -> None:
    buffer = rasterize_in_software(quad[0], 7)
    place = (np.arange(7) + 0.5) / 7
    assert (buffer.face >= 0).all()
    np.testing.assert_allclose(buffer.position[..., 0], np.broadcast_to(place, (7, 7)), atol=1e-6)
    np.testing.assert_allclose(buffer.position[..., 1], np.broadcast_to(1 - place[:, None], (7, 7)), atol=1e-6)
    np.testing.assert_array_equal(np.diagonal(np.fliplr(buffer.face)), np.zeros(7))  # of two faces the first


def test_random_triangles_equal_the_device(pair: Callable[..., Pair], context: moderngl.Context) -> None:
    rng = np.random.default_rng(3)
    for size in (1, 16, 61, 128):
        uv = rng.uniform(0.0, 1.0, (20, 1, 2)) + rng.normal(
            0.0, [[[0.005]], [[0.05]], [[0.3]], [[0.6]]] * 5, (20, 3, 2)
        )
        uv[0] = uv[0, 0]
        uv[1, 2] = uv[1, 1]
        uv = np.clip(uv, 0.0, 1.0).astype(np.float32).reshape(-1, 2)
        atlas, _ = pair(rng.normal(size=(60, 3)), np.arange(60).reshape(20, 3), uv)
        first, second = rasterize(context, atlas, size), rasterize_in_software(atlas, size)
        np.testing.assert_array_equal(first.face, second.face)
        assert (
            np.abs(first.position - second.position).max() < 1e-3
        )  # slivers: positions of a triangle 0.01 texels wide


def test_centres_on_edges_and_corners_go_to_the_same_face(context: moderngl.Context, pair: Callable[..., Pair]) -> None:
    rng = np.random.default_rng(4)
    uv = (rng.integers(0, 16, (60, 2)) + 0.5) / 16
    atlas, _ = pair(rng.normal(size=(60, 3)), np.arange(60).reshape(20, 3), uv)
    np.testing.assert_array_equal(rasterize(context, atlas, 16).face, rasterize_in_software(atlas, 16).face)


@pytest.mark.parametrize("size", [64, 200])
def test_a_sphere_and_two_charts_equal_the_device(
    sphere: Pair, two_charts: Pair, context: moderngl.Context, size: int
) -> None:
    for atlas, _ in (sphere, two_charts):
        assert_equal(rasterize(context, atlas, size), rasterize_in_software(atlas, size))


def test_windows_change_no_bit(sphere: Pair) -> None:
    whole, tiled = rasterize_in_software(sphere[0], 64), rasterize_in_software(sphere[0], 64, limit=19)
    for name in ("position", "normal", "second", "third", "face"):
        assert getattr(whole, name).tobytes() == getattr(tiled, name).tobytes()


def test_nothing_to_draw_and_no_size_are_refused(quad: Pair) -> None:
    with pytest.raises(InputError, match="0 faces"):
        rasterize_in_software(replace(quad[0], faces=np.zeros((0, 3), np.int64)), 8)
    with pytest.raises(InputError, match="size 0"):
        rasterize_in_software(quad[0], 0)


def test_a_real_mesh_equals_the_device(models: Path, context: moderngl.Context) -> None:
    asset = load_asset(models / "spot.obj")
    assert asset.uv is not None
    atlas = atlas_from_uv(replace(asset, uv=asset.uv * 0.9 + 0.06))
    assert_equal(rasterize(context, atlas, 512), rasterize_in_software(atlas, 512))
