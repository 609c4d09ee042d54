"""The maps that need rays, as users ask for them: registered, in the right space, the same in windows, read back."""

from __future__ import annotations

from dataclasses import replace

import moderngl
import numpy as np
import pytest

from flexpara.bake.baker import bake
from flexpara.bake.maps.catalogue import MAP_NAMES, find_map
from flexpara.bake.maps.normals import in_tangent_space
from flexpara.bake.maps.rays import RaySettings
from flexpara.bake.raster.gbuffer import GBuffer, rasterize
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Asset, Atlas, Surface

Pair = tuple[Atlas, Asset]


def beside_a_wall(pair: Pair, height: float = 100.0) -> Pair:
    """The pair's mesh with a wall at its left edge, which is in the way of rays but not in the atlas."""
    atlas, asset = pair
    wall = np.array([[0.0, -50, 0], [0, 50, 0], [0, 50, height], [0, -50, height]])
    count = len(asset.surface.vertices)
    faces = np.concatenate([asset.surface.faces, count + np.array([[0, 1, 2], [0, 2, 3]])])
    surface = Surface(np.concatenate([asset.surface.vertices, wall]), faces)
    return atlas, replace(asset, surface=surface)


def test_they_are_registered() -> None:
    assert {"ao", "bent-normal", "bent-normal-object", "thickness", "curvature", "height"} <= set(MAP_NAMES)
    assert find_map("ao").background == (1, 1, 1)
    assert find_map("bent-normal", normal_format="directx").space == "tangent, Y down"


def test_the_number_of_rays_is_passed_on(quad: Pair, context: moderngl.Context) -> None:
    """With 4 rays occlusion has five values."""
    buffer = rasterize(context, quad[0], 16)
    pixels = find_map("ao", rays=RaySettings(4)).compute(buffer, *beside_a_wall(quad))
    assert set(np.unique(pixels)) <= {0.0, 0.25, 0.5, 0.75, 1.0}
    assert len(np.unique(pixels)) > 2


def test_vectors_go_into_the_frames_of_the_tangents(quad: Pair, context: moderngl.Context) -> None:
    """On the square u runs along x and v along y, so object and tangent space are the same."""
    buffer = rasterize(context, quad[0], 8)
    vector = np.array([0.36, 0.48, 0.8], np.float32)

    def constant(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> np.ndarray:
        del atlas, asset
        return np.broadcast_to(vector, (*gbuffer.shape, 3))

    for name, flip in (("opengl", 1), ("directx", -1)):
        pixels = in_tangent_space(constant, name)(buffer, *quad)  # type: ignore[arg-type]
        np.testing.assert_allclose(pixels, np.broadcast_to(vector * [1, flip, 1], (8, 8, 3)), atol=1e-6)


def test_bent_normals_lean_away_from_a_wall_in_both_spaces(quad: Pair, context: moderngl.Context) -> None:
    scene = beside_a_wall(quad)
    buffer = rasterize(context, scene[0], 16)
    local = find_map("bent-normal").compute(buffer, *scene)
    world = find_map("bent-normal-object").compute(buffer, *scene)
    np.testing.assert_allclose(local, world, atol=1e-5)
    assert world[..., 0].min() > 0.3
    turned = replace(scene[0], uv=scene[0].uv[[1, 2, 3, 0]])  # u runs along −y, v along x
    buffer = rasterize(context, turned, 16)
    local = find_map("bent-normal").compute(buffer, turned, scene[1])
    np.testing.assert_allclose(np.linalg.norm(local, axis=2), 1, atol=1e-5)
    assert np.abs(local[..., 1]).min() > 0.3
    assert np.abs(local[..., 0]).mean() < 0.1


def test_height_needs_a_high_poly_mesh() -> None:
    with pytest.raises(InputError, match="high-poly mesh, expected one; pass --high"):
        find_map("height")


@pytest.mark.parametrize("name", ["ao", "bent-normal", "thickness", "curvature"])
def test_windows_change_nothing(fine_sphere: Pair, name: str) -> None:
    whole = bake(*fine_sphere, [name], size=96, padding=0)[name].pixels
    tiled = bake(*fine_sphere, [name], size=96, limit=40, padding=0)[name].pixels
    covered = bake(*fine_sphere, ["face-id"], size=96, padding=0)["face-id"].pixels[..., 0] >= 0
    assert whole.shape == tiled.shape
    np.testing.assert_allclose(tiled[covered], whole[covered], atol=1e-6)
