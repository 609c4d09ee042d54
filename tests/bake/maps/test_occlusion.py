"""Occlusion, bent normals and thickness against closed forms: plane, corner, ball, bowl, slab; then noise and bunny.

G-buffers are made by hand here: points on faces, one texel each, so that no context is needed.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from flexpara.bake.maps.occlusion import OFFSET, ambient_occlusion, bent_normals, lift, starting_points, thickness
from flexpara.bake.maps.rays import RaySettings
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.runtime.geometry.normals import smooth_normals
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.mesh import Asset, Atlas, Frame, Surface
from flexpara.runtime.samples import make_sample

Scene = tuple[Atlas, Asset]


def scene_of(surface: Surface, normals: np.ndarray | None = None) -> Scene:
    """An atlas without uv; smooth normals unless given."""
    count = np.arange(len(surface.vertices))
    normal = smooth_normals(surface) if normals is None else normals
    asset = Asset(surface.vertices, surface.faces, count, surface)
    chart = np.zeros(len(surface.faces), np.int64)
    uv = np.zeros((len(count), 2), np.float32)
    atlas = Atlas(surface.vertices, surface.faces, uv, normal.astype(np.float32), chart, count, size=8, padding=1)
    return atlas, asset


def points_on(scene: Scene, faces: Any, weights: Any) -> GBuffer:
    """A G-buffer whose texels, in rows of 8, are the points of the given faces (t,) with weights (t, 3)."""
    atlas, asset = scene
    face, weight = np.asarray(faces), np.asarray(weights, np.float64)
    rows = -(-len(face) // 8)
    index = np.full(rows * 8, -1, np.int32)
    index[: len(face)] = face
    flat = np.zeros((rows * 8, 8))
    flat[: len(face), :3] = np.einsum("tc,tci->ti", weight, asset.surface.triangles[face])
    normal = np.einsum("tc,tci->ti", weight, atlas.normals[atlas.faces[face]].astype(np.float64))
    flat[: len(face), 3:6] = normal / np.linalg.norm(normal, axis=1, keepdims=True)
    flat[: len(face), 6:] = weight[:, 1:]
    image = flat.reshape(rows, 8, 8).astype(np.float32)
    return GBuffer(image[..., :3], image[..., 3:6], image[..., 6], image[..., 7], index.reshape(rows, 8))


def spread_over(scene: Scene, count: int, *, seed: int = 0, faces: np.ndarray | None = None) -> GBuffer:
    """Random points of random faces."""
    rng = np.random.default_rng(seed)
    choice = np.arange(len(scene[1].surface.faces)) if faces is None else faces
    return points_on(scene, rng.choice(choice, count), rng.dirichlet([1.0, 1.0, 1.0], count))


def covered(buffer: GBuffer, image: np.ndarray) -> np.ndarray:
    """(t, c) of the texels that hold a surface."""
    return image.reshape(-1, image.shape[-1])[buffer.texels]


def quads(*corners: list[list[float]]) -> Surface:
    """Rectangles of four corners each, two faces each, not joined."""
    first = 4 * np.arange(len(corners))[:, None, None]
    faces = first + np.array([[0, 1, 2], [0, 2, 3]])
    return Surface(np.array(corners, np.float64).reshape(-1, 3), faces.reshape(-1, 3))


FLOOR = [[0.0, -50, 0], [100, -50, 0], [100, 50, 0], [0, 50, 0]]
WALL = [[0.0, -50, 0], [0, 50, 0], [0, 50, 2], [0, -50, 2]]


def floor_point(scene: Scene, x: float) -> GBuffer:
    """The point (x, 0, 0) of the floor, in its first face (0, 1, 2)."""
    second, third = x / 100.0 - 0.5, 0.5
    return points_on(scene, [0], [[1 - second - third, second, third]])


def ball(resolution: int = 48) -> Scene:
    """The unit sphere of the samples, with its own normals."""
    surface = asset_from_arrays(*make_sample("sphere", resolution=resolution)).surface
    return scene_of(surface, surface.vertices / np.linalg.norm(surface.vertices, axis=1, keepdims=True))


def test_a_plane_is_open() -> None:
    scene = scene_of(quads(FLOOR))
    buffer = spread_over(scene, 30)
    np.testing.assert_array_equal(covered(buffer, ambient_occlusion(buffer, *scene)), 1.0)
    np.testing.assert_allclose(covered(buffer, bent_normals(buffer, *scene)), np.tile([0, 0, 1], (30, 1)), atol=0.04)
    np.testing.assert_array_equal(covered(buffer, thickness(buffer, *scene)), 0.0)


def test_texels_without_surface_stay_zero() -> None:
    scene = scene_of(quads(FLOOR))
    buffer = spread_over(scene, 9)
    image = ambient_occlusion(buffer, *scene)
    assert image.shape == (2, 8, 1)
    assert image.dtype == np.float32
    assert (image[1, 1:] == 0).all()


@pytest.mark.parametrize("distance", [50.0, 60.0, 52.0])
def test_a_wall_beside_a_floor_hides_its_view_factor(distance: float) -> None:
    """Half of (1 − x / √(x² + height²)), for a wall that is long (Howell, configuration A-2 of differential areas)."""
    wall = [[0.0, -5000, 0], [0, 5000, 0], [0, 5000, 60], [0, -5000, 60]]
    scene = scene_of(quads(FLOOR, wall))
    buffer = floor_point(scene, distance)
    hidden = 0.5 * (1 - distance / np.hypot(distance, 60))
    found = covered(buffer, ambient_occlusion(buffer, *scene, RaySettings(4096)))
    np.testing.assert_allclose(found, 1 - hidden, atol=3e-3)


def test_occluders_beyond_the_distance_do_not_count() -> None:
    scene = scene_of(quads(FLOOR, WALL))
    buffer = floor_point(scene, 51.0)
    all_of_it = ambient_occlusion(buffer, *scene, RaySettings(1024))[0, 0]
    assert all_of_it < 1.0
    assert ambient_occlusion(buffer, *scene, RaySettings(1024, distance=50.9))[0, 0] == 1.0
    np.testing.assert_array_equal(ambient_occlusion(buffer, *scene, RaySettings(1024, distance=500.0))[0, 0], all_of_it)


def test_bent_normals_lean_away_from_a_wall() -> None:
    """A very high wall at x = 0 leaves a quarter of space: azimuth ± 90°, mean (2 / 3π, 0, 1/3) of the half disk."""
    wall = [[0.0, -9000, 0], [0, 9000, 0], [0, 9000, 9000], [0, -9000, 9000]]
    scene = scene_of(quads([[0.0, -50, 0], [100, -50, 0], [100, 50, 0], [0, 50, 0]], wall))
    buffer = floor_point(scene, 50.0)
    found = covered(buffer, bent_normals(buffer, *scene, RaySettings(4096)))[0]
    np.testing.assert_allclose(found, np.array([2 / np.pi, 0, 1]) / np.hypot(2 / np.pi, 1), atol=0.02)


def test_where_nothing_is_open_the_bent_normal_is_the_normal() -> None:
    atlas, asset = ball()
    inner = replace(asset.surface, faces=asset.surface.faces[:, ::-1])
    scene = scene_of(inner, -atlas.normals)
    buffer = spread_over(scene, 20)
    np.testing.assert_array_equal(covered(buffer, ambient_occlusion(buffer, *scene)), 0.0)
    np.testing.assert_allclose(covered(buffer, bent_normals(buffer, *scene)), covered(buffer, buffer.normal), atol=1e-6)


def test_a_coarse_ball_casts_no_shadow_on_itself() -> None:
    """Smooth normals on faces of 15°: without the lift rays near the horizon meet the neighbouring faces."""
    scene = ball(12)
    buffer = spread_over(scene, 400)
    found = covered(buffer, ambient_occlusion(buffer, *scene, RaySettings(256)))
    assert found.min() > 0.99
    flat = replace(scene[0], normals=np.zeros_like(scene[0].normals))
    unlifted = covered(buffer, ambient_occlusion(buffer, flat, scene[1], RaySettings(256)))
    assert unlifted.mean() < found.mean() - 0.001


def test_a_bowl_is_as_open_as_its_missing_part() -> None:
    """Inside a sphere every equal area fills an equal part of the view: the bowl's opening is its missing area."""
    atlas, asset = ball(64)
    height = asset.surface.triangles.mean(axis=1)[:, 2]
    faces = asset.surface.faces[height < 0.5][:, ::-1]
    bowl = Surface(asset.surface.vertices, faces)
    open_part = 1 - bowl.face_areas().sum() / asset.surface.face_areas().sum()
    assert 0.2 < open_part < 0.3
    scene = scene_of(bowl, -atlas.normals)
    buffer = spread_over(scene, 40)
    found = covered(buffer, ambient_occlusion(buffer, *scene, RaySettings(1024)))
    np.testing.assert_allclose(found, open_part, atol=0.02)
    assert abs(found.mean() - open_part) < 0.003


def test_a_ball_is_as_thick_as_its_radius() -> None:
    """Mean of 2 cos²θ over the cosine-weighted hemisphere is 1 radius; the flat faces of the sample take a little."""
    scene = ball(64)
    buffer = spread_over(scene, 40)
    np.testing.assert_allclose(covered(buffer, thickness(buffer, *scene, RaySettings(1024))), 0.99, atol=0.01)


@pytest.mark.parametrize(("depth", "side"), [(0.25, 50.0), (1.0, 50.0), (1.0, 0.8)])
def test_a_slab_is_as_thick_as_it_is(depth: float, side: float) -> None:
    """Open at its sides: what leaves there does not count, so the small one is as thick as the wide ones."""
    top = [[-side, -side, 0], [side, -side, 0], [side, side, 0], [-side, side, 0]]
    bottom = [[x, y, -depth] for x, y, _ in reversed(top)]
    scene = scene_of(quads(top, bottom))
    buffer = points_on(scene, [0], [[0.5, 0.0, 0.5]])
    radius = Frame.of(scene[1].surface.vertices).scale
    found = covered(buffer, thickness(buffer, *scene, RaySettings(256)))
    np.testing.assert_allclose(found * radius, depth, rtol=0.01)


def test_lift_reaches_the_tangent_planes_and_stays_on_hollow_ground() -> None:
    corner = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]]], np.float32)
    point = np.array([[0.5, 0, 0]], np.float32)
    weights = np.array([[0.5, 0.5, 0]], np.float32)
    leaning = np.array([[[-0.6, 0, 0.8], [0.6, 0, 0.8], [0, 0, 1]]], np.float32)  # apart: convex
    np.testing.assert_allclose(lift(point, corner, leaning, weights), [[0, 0, 0.5 * 2 * 0.3 * 0.8]], atol=1e-6)
    np.testing.assert_array_equal(lift(point, corner, leaning * [-1, 1, 1], weights), [[0, 0, 0]])


def test_rays_start_just_off_the_face_on_the_normal_s_side() -> None:
    scene = scene_of(quads(FLOOR))
    buffer = spread_over(scene, 5)
    frame = Frame.of(scene[1].surface.vertices)
    texels = buffer.texels
    up, normal = starting_points(buffer, *scene, frame, texels)
    down, _ = starting_points(buffer, *scene, frame, texels, inwards=True)
    np.testing.assert_allclose(up[:, 2] - down[:, 2], 2 * OFFSET, rtol=1e-4)
    np.testing.assert_allclose(normal, np.tile([0, 0, 1], (5, 1)), atol=1e-6)
    turned = replace(buffer, normal=-buffer.normal)
    np.testing.assert_allclose(starting_points(turned, *scene, frame, texels)[0], down, atol=1e-7)


def test_the_place_and_size_of_a_mesh_do_not_matter() -> None:
    scene = ball(16)
    far = replace(scene[1].surface, vertices=scene[1].surface.vertices * 1e-3 + [1e3, -2e3, 5e2])
    moved = scene_of(far, scene[0].normals)
    here, there = spread_over(scene, 64), spread_over(moved, 64)
    for function in (ambient_occlusion, thickness):
        np.testing.assert_allclose(function(there, *moved), function(here, *scene), atol=2e-2)


def test_same_seed_same_map_and_other_seed_other_noise() -> None:
    scene = scene_of(quads(FLOOR, [[0.0, -90, 0], [0, 90, 0], [0, 90, 60], [0, -90, 60]]))
    buffer = spread_over(scene, 200, faces=np.array([0, 1]))
    first = ambient_occlusion(buffer, *scene, RaySettings(16, seed=1))
    np.testing.assert_array_equal(first, ambient_occlusion(buffer, *scene, RaySettings(16, seed=1)))
    assert np.abs(first - ambient_occlusion(buffer, *scene, RaySettings(16, seed=2))).max() > 0.02


def test_batches_make_no_difference_and_progress_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    scene = ball(16)
    buffer = spread_over(scene, 300)
    expected = thickness(buffer, *scene)
    told: list[tuple[int, int]] = []
    monkeypatch.setattr("flexpara.bake.maps.occlusion.BATCH", 64 * 7)
    found = thickness(buffer, *scene, RaySettings(progress=lambda done, total: told.append((done, total))))
    np.testing.assert_array_equal(found, expected)
    assert told[-1] == (300, 300)
    assert len(told) == 43


@pytest.fixture
def bunny(models: Path) -> Scene:
    return scene_of(load_asset(models / "bunny.obj").surface)


def test_noise_falls_with_the_number_of_rays(bunny: Scene) -> None:
    """Against 4096 other rays; random directions would leave 0.03 at 64 rays."""
    buffer = spread_over(bunny, 2000)
    reference = covered(buffer, ambient_occlusion(buffer, *bunny, RaySettings(4096, seed=7)))
    for count, bar in ((16, 0.045), (64, 0.016), (256, 0.006), (1024, 0.0025)):
        error = covered(buffer, ambient_occlusion(buffer, *bunny, RaySettings(count))) - reference
        assert np.sqrt((error**2).mean()) < bar
        assert abs(error.mean()) < bar / 10


def test_bunny_is_darker_in_its_creases_than_outside(bunny: Scene) -> None:
    surface = bunny[1].surface
    buffer = spread_over(bunny, 4000)
    occlusion = covered(buffer, ambient_occlusion(buffer, *bunny))[:, 0]
    position = surface.triangles[buffer.face.reshape(-1)[buffer.texels]].mean(axis=1)
    outer = np.linalg.norm(Frame.of(surface.vertices).apply(position), axis=1) > 0.85
    assert occlusion[outer].mean() > occlusion.mean() + 0.02
    assert occlusion.min() < 0.6
    bent = covered(buffer, bent_normals(buffer, *bunny))
    cosine = np.einsum("ti,ti->t", bent, covered(buffer, buffer.normal))
    assert cosine[occlusion > 0.99].min() > 0.97
    assert cosine[occlusion < 0.7].mean() < 0.98


def test_rays_of_a_page_meet_the_other_pages() -> None:
    both = scene_of(quads(FLOOR, WALL))
    atlas, floor = scene_of(quads(FLOOR))
    alone = ambient_occlusion(floor_point((atlas, floor), 1.0), atlas, floor)
    page = ambient_occlusion(floor_point((atlas, floor), 1.0), atlas, replace(floor, whole=both[1].surface))
    whole = ambient_occlusion(floor_point(both, 1.0), *both)
    assert alone[0, 0, 0] == 1.0
    assert page[0, 0, 0] == whole[0, 0, 0] < 0.8
