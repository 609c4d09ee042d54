"""Mean curvature: one edge by hand, cylinder and ball and saddle in closed form, Steiner's sum, then the map."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import moderngl
import numpy as np
import pytest

from flexpara.bake.maps.curvature import RADIUS, curvature_map, edge_curvature, mean_curvature, shared
from flexpara.bake.raster.gbuffer import rasterize
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.mesh import Asset, Atlas, Frame, Surface
from flexpara.runtime.samples import make_sample

Pair = tuple[Atlas, Asset]


def sample(name: str, resolution: int) -> Surface:
    return asset_from_arrays(*make_sample(name, resolution=resolution)).surface


def bent_sheet(angle: float) -> Surface:
    """Two triangles along the y axis; the second turns down by the angle."""
    ends = [[0.0, 0, 0], [0, 2, 0], [-1, 1, 0], [np.cos(angle), 1, -np.sin(angle)]]
    return Surface(np.array(ends), np.array([[0, 1, 2], [1, 0, 3]]))


@pytest.mark.parametrize("angle", [0.3, -0.8, np.pi / 2])
def test_an_edge_carries_half_its_length_times_its_angle(angle: float) -> None:
    edges, integral = edge_curvature(bent_sheet(angle))
    assert edges.tolist() == [[0, 1]]
    np.testing.assert_allclose(integral, [0.5 * 2.0 * angle], atol=1e-12)


def test_a_plane_is_flat() -> None:
    flat = bent_sheet(0.0)
    np.testing.assert_allclose(mean_curvature(flat), 0.0, atol=1e-14)


@pytest.mark.parametrize("radius", [0.5, 3.0])
def test_a_ball_bends_by_the_inverse_of_its_radius(radius: float) -> None:
    unit = sample("sphere", 48)
    surface = Surface(unit.vertices * radius, unit.faces)
    np.testing.assert_allclose(mean_curvature(surface), 1 / radius, rtol=0.05)
    assert abs(np.median(mean_curvature(surface)) * radius - 1) < 2e-3
    np.testing.assert_allclose(mean_curvature(replace(surface, faces=unit.faces[:, ::-1])), -1 / radius, rtol=0.05)


def test_a_box_obeys_steiner() -> None:
    """The integral of H over a cube of side 2 is its 12 edges' ½ · 2 · π/2."""
    _, integral = edge_curvature(sample("cube", 8))
    side = np.ptp(sample("cube", 8).vertices[:, 0])
    np.testing.assert_allclose(integral.sum(), 12 * 0.5 * side * np.pi / 2, rtol=1e-9)


def test_a_torus_is_flatter_inside() -> None:
    """H = (R + 2 r cos θ) / (2 r (R + r cos θ)), read off the vertices' own places."""
    surface = sample("torus", 128)
    ring = np.linalg.norm(surface.vertices[:, :2], axis=1)
    outer, inner = ring.max(), ring.min()
    large, small = (outer + inner) / 2, (outer - inner) / 2
    expected = (large + 2 * (ring - large)) / (2 * small * ring)
    np.testing.assert_allclose(mean_curvature(surface), expected, atol=0.03 * np.abs(expected).max())


def test_sharing_keeps_the_sum() -> None:
    amount = np.array([1.0, 0.0, 0.0, 5.0])
    after = shared(amount, np.array([[0, 1], [1, 2]]))
    np.testing.assert_allclose(after, [0.5, 0.5, 0.0, 5.0])
    np.testing.assert_allclose(shared(np.array([0.0, 4.0, 0.0, 0.0]), np.array([[0, 1], [1, 2]])), [1, 2, 1, 0])


def test_half_is_flat_and_a_ball_of_a_tenth_is_three_quarters(
    pair: Callable[..., Pair], quad: Pair, context: moderngl.Context
) -> None:
    flat = curvature_map()(rasterize(context, quad[0], 8), *quad)
    assert flat.shape == (8, 8, 1)
    np.testing.assert_array_equal(flat, 0.5)
    ball = sample("sphere", 24)
    far = np.array([[10.0, 0, 0], [-10.0, 0, 0], [0.0, 0, 1]])  # widens the frame to radius 10
    uv = np.concatenate([ball.vertices[:, :2] * 0.4 + 0.5, [[0, 0], [0, 0.01], [0.01, 0]]])
    chosen = np.flatnonzero(ball.triangles[:, :, 2].min(axis=1) > 0)
    wide = len(uv) - 3 + np.arange(3)[None]
    atlas, asset = pair(np.concatenate([ball.vertices, far]), np.concatenate([ball.faces[chosen], wide]), uv)
    asset = replace(asset, surface=Surface(asset.positions, np.concatenate([ball.faces, wide])))
    assert abs(Frame.of(asset.surface.vertices).scale * RADIUS - 1) < 1e-6
    buffer = rasterize(context, replace(atlas, faces=ball.faces[chosen]), 64)
    buffer = replace(buffer, face=np.where(buffer.face >= 0, chosen[buffer.face], -1).astype(np.int32))
    found = curvature_map()(buffer, atlas, asset)[buffer.face >= 0]
    np.testing.assert_allclose(found, 0.75, atol=0.01)


def test_bunny_s_ears_are_convex_and_its_folds_hollow(models: Path) -> None:
    surface = load_asset(models / "bunny.obj").surface
    bend = mean_curvature(surface)
    assert np.isfinite(bend).all()
    scaled = bend * Frame.of(surface.vertices).scale
    assert np.percentile(scaled, 99) > 10
    assert np.percentile(scaled, 1) < -5
    assert abs(np.median(scaled)) < 5
