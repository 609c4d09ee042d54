"""Where high-to-low rays start and end: settings, a box with hard edges, cage meshes of right and wrong topology."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from flexpara.bake.highpoly.cage import Cage, CageSettings, check_cage
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas, Frame, Surface

MakeGBuffer = Callable[[Atlas, int], GBuffer]

Pair = tuple[Atlas, Asset]
UNIT = Frame((0.0, 0.0, 0.0), 1.0)
ROOF = Surface(np.array([[0.0, 0, 1], [0, 2, 1], [-1, 1, 0], [1, 1, 0]]), np.array([[0, 1, 2], [1, 0, 3]]))


@pytest.mark.parametrize("distance", [0.0, -0.1, 1.5, float("nan")])
def test_a_distance_out_of_range_is_refused(distance: float) -> None:
    with pytest.raises(InputError, match=r"expected a part of the bounding box diagonal.*pass 0\.02"):
        CageSettings(distance)


def test_rays_reach_a_part_of_the_diagonal_both_ways(make_gbuffer: MakeGBuffer, quad: Pair) -> None:
    atlas, asset = quad
    buffer = make_gbuffer(atlas, 8)
    frame = Frame((0.0, 0.0, 0.0), 2.0)
    rays = Cage.of(asset.surface, frame, CageSettings(0.1)).rays(buffer, buffer.texels)
    np.testing.assert_allclose(rays.front, 0.1 * np.sqrt(2) / 2, rtol=1e-6)
    np.testing.assert_array_equal(rays.front, rays.back)
    np.testing.assert_allclose(rays.point, buffer.position.reshape(-1, 3) / 2, atol=1e-7)
    np.testing.assert_allclose(rays.outwards, np.tile([0, 0, 1], (64, 1)), atol=1e-7)


def test_directions_are_smooth_across_a_hard_edge(make_gbuffer: MakeGBuffer, pair: Callable[..., Pair]) -> None:
    """The atlas is split along the ridge and has flat normals; rays on both sides of it still run the same way."""
    faces = np.array([[0, 1, 2], [4, 3, 5]])
    source = np.array([0, 1, 2, 0, 1, 3])
    uv = [[0.45, 0.1], [0.45, 0.9], [0.05, 0.5], [0.55, 0.1], [0.55, 0.9], [0.95, 0.5]]
    atlas, asset = pair(ROOF.vertices[source], faces, uv)
    buffer = make_gbuffer(atlas, 64)
    rays = Cage.of(replace(asset, surface=ROOF).surface, UNIT, CageSettings()).rays(buffer, buffer.texels)
    ridge = np.abs(rays.point[:, 0]) < 0.02
    assert ridge.sum() > 20
    assert rays.outwards[ridge, 2].min() > 0.99
    assert rays.outwards[:, 2].min() < 0.8
    np.testing.assert_allclose(np.linalg.norm(rays.outwards, axis=1), 1, atol=1e-6)


def test_a_cage_mesh_says_where_rays_start(make_gbuffer: MakeGBuffer, quad: Pair) -> None:
    atlas, asset = quad
    buffer = make_gbuffer(atlas, 8)
    lifted = replace(asset.surface, vertices=asset.surface.vertices + np.array([0.3, 0, 0.4]))
    settings = CageSettings(cage=replace(asset, surface=lifted))
    rays = Cage.of(asset.surface, UNIT, settings).rays(buffer, buffer.texels)
    np.testing.assert_allclose(rays.outwards, np.tile([0.6, 0, 0.8], (64, 1)), atol=1e-6)
    np.testing.assert_allclose(rays.front, 0.5, atol=1e-6)
    np.testing.assert_allclose(rays.back, 0.5, atol=1e-6)


def test_a_cage_that_touches_takes_the_normal(make_gbuffer: MakeGBuffer, quad: Pair) -> None:
    atlas, asset = quad
    buffer = make_gbuffer(atlas, 8)
    rays = Cage.of(asset.surface, UNIT, CageSettings(cage=asset)).rays(buffer, buffer.texels)
    np.testing.assert_allclose(rays.outwards, np.tile([0, 0, 1], (64, 1)), atol=1e-6)
    assert (rays.front > 0).all()


def test_a_cage_may_number_its_vertices_otherwise() -> None:
    turned = Surface(ROOF.vertices[[3, 2, 1, 0]] + 0.1, 3 - ROOF.faces)
    check_cage(turned, ROOF)
    frame_settings = CageSettings(cage=Asset(turned.vertices, turned.faces, np.arange(4), turned))
    cage = Cage.of(ROOF, UNIT, frame_settings)
    assert cage.starts is not None
    assert cage.start_faces is not None
    np.testing.assert_allclose(cage.starts[cage.start_faces], ROOF.triangles + 0.1, atol=1e-6)


def test_a_cage_of_another_topology_is_refused() -> None:
    with pytest.raises(InputError, match="the cage has 1 faces, the low-poly mesh 2"):
        check_cage(Surface(ROOF.vertices, ROOF.faces[:1]), ROOF)
    with pytest.raises(InputError, match="face 1 of the cage joins other vertices"):
        check_cage(Surface(ROOF.vertices, np.array([[0, 1, 2], [0, 3, 1]])), ROOF)
