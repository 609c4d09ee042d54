"""High to low: planes by hand, layers and backs, misses, spheres in closed form, several meshes; then bunny."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.highpoly.cage import CageSettings, Rays
from flexpara.bake.highpoly.highmesh import atlas_of, merge_assets, uv_per_unit
from flexpara.bake.highpoly.highpoly import HighSurface, Projector, first_front
from flexpara.bake.maps.rays import RayScene
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.runtime.errors import InputError
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.material import Material
from flexpara.runtime.mesh import Asset, Atlas, Frame, Surface
from flexpara.runtime.pack.packing import atlas_from_uv
from flexpara.runtime.samples import make_sample

MakeGBuffer = Callable[[Atlas, int], GBuffer]

Pair = tuple[Atlas, Asset]


def plane(height: float, *, slope: float = 0.0, up: bool = True, low: float = -1.0, high: float = 2.0) -> Asset:
    """A square over x, y in [low, high] at z = height + slope · x."""
    corners = np.array([[x, y, height + slope * x] for x, y in ((low, low), (high, low), (high, high), (low, high))])
    faces = np.array([[0, 1, 2], [0, 2, 3]]) if up else np.array([[0, 2, 1], [0, 3, 2]])
    return Asset(corners, faces, np.arange(4), Surface(corners, faces), stem="plane")


def seen_by(
    buffer: GBuffer, atlas: Atlas, asset: Asset, highs: list[Asset], settings: CageSettings | None = None
) -> HighSurface:
    return Projector.of(atlas, asset, highs, settings).surface(buffer, None)


def down_rays(points: list[list[float]], front: float, back: float) -> Rays:
    point = np.array(points, np.float32)
    count = len(point)
    up = np.tile(np.array([0, 0, 1], np.float32), (count, 1))
    return Rays(point, up, np.full(count, front, np.float32), np.full(count, back, np.float32))


@pytest.mark.parametrize("height", [-0.1, 0.0, 0.1])
def test_a_plane_above_or_below_is_found_where_it_is(make_gbuffer: MakeGBuffer, quad: Pair, height: float) -> None:
    atlas, asset = quad
    buffer = make_gbuffer(atlas, 16)
    found = seen_by(buffer, atlas, asset, [plane(height)], CageSettings(0.1))
    np.testing.assert_allclose(found.height, height, atol=1e-6)
    np.testing.assert_allclose(found.gbuffer.position, buffer.position + np.array([0, 0, height]), atol=1e-6)
    np.testing.assert_allclose(found.gbuffer.normal, np.broadcast_to([0, 0, 1], (16, 16, 3)), atol=1e-6)
    assert not found.missed.any()
    assert found.report()["missed"] == 0


def test_the_outermost_front_is_taken(make_gbuffer: MakeGBuffer, quad: Pair) -> None:
    """Of details that float above the surface, what lies on top."""
    atlas, asset = quad
    highs = [plane(0.0), plane(0.05), plane(0.5)]
    found = seen_by(make_gbuffer(atlas, 8), atlas, asset, highs, CageSettings(0.1))
    np.testing.assert_allclose(found.height, 0.05, atol=1e-6)
    assert set(found.gbuffer.face.reshape(-1)) <= {2, 3}  # those of the second mesh


def test_backs_are_passed_unless_they_count(make_gbuffer: MakeGBuffer, quad: Pair) -> None:
    atlas, asset = quad
    buffer = make_gbuffer(atlas, 8)
    highs = [plane(0.08, up=False), plane(0.05, up=False), plane(-0.02)]
    found = seen_by(buffer, atlas, asset, highs, CageSettings(0.1))
    np.testing.assert_allclose(found.height, -0.02, atol=1e-6)
    counted = seen_by(buffer, atlas, asset, highs, CageSettings(0.1, ignore_backs=False))
    np.testing.assert_allclose(counted.height, 0.08, atol=1e-6)


def test_hits_say_how_far_the_ray_went() -> None:
    surface = merge_assets([plane(0.5, up=False), plane(0.25)]).surface
    scene = RayScene.of(surface, Frame((0.0, 0.0, 0.0), 1.0))
    hits = first_front(scene, down_rays([[0.2, 0.3, 0], [0.2, 0.3, 0.9], [5, 5, 0]], 1.0, 0.5))
    assert hits.hit.tolist() == [True, False, False]
    np.testing.assert_allclose(hits.distance[0], 0.75, atol=1e-5)


def test_rays_end_at_their_reach() -> None:
    scene = RayScene.of(plane(-0.6).surface, Frame((0.0, 0.0, 0.0), 1.0))
    assert first_front(scene, down_rays([[0.5, 0.5, 0]], 0.1, 0.5)).hit.tolist() == [False]
    assert first_front(scene, down_rays([[0.5, 0.5, 0]], 0.1, 0.7)).hit.tolist() == [True]
    beyond = RayScene.of(merge_assets([plane(0.05, up=False), plane(-0.6)]).surface, Frame((0.0, 0.0, 0.0), 1.0))
    assert first_front(beyond, down_rays([[0.5, 0.5, 0]], 0.1, 0.5)).hit.tolist() == [False]


def test_missed_texels_take_the_nearest_point_and_are_counted(make_gbuffer: MakeGBuffer, quad: Pair) -> None:
    """The high-poly plane ends at x = ½: texels beyond it take its border."""
    atlas, asset = quad
    buffer = make_gbuffer(atlas, 16)
    half = plane(0.0, low=-1.0, high=0.5)
    moved = half.positions + np.array([0, 0.5, 0])
    half = replace(half, positions=moved, surface=Surface(moved, half.faces))
    found = seen_by(buffer, atlas, asset, [half])
    assert found.missed[:, 8:].all()
    assert not found.missed[:, :8].any()
    np.testing.assert_allclose(found.gbuffer.position[:, 8:, 0], 0.5, atol=1e-6)
    np.testing.assert_allclose(found.gbuffer.position[:, 8:, 1], buffer.position[:, 8:, 1], atol=1e-5)
    assert found.report() == {"texels": 256, "missed": 128, "missed_share": 0.5, "highest": 0.0, "lowest": 0.0}


def test_texels_without_surface_stay_without(make_gbuffer: MakeGBuffer, two_charts: Pair) -> None:
    atlas, asset = two_charts
    buffer = make_gbuffer(atlas, 32)
    found = seen_by(buffer, atlas, asset, [plane(0.0)], CageSettings(1.0))
    np.testing.assert_array_equal(found.gbuffer.face < 0, buffer.face < 0)
    np.testing.assert_array_equal(found.gbuffer.texels, buffer.texels)
    assert (found.height[buffer.face < 0] == 0).all()


def test_a_ball_around_a_coarse_ball(make_gbuffer: MakeGBuffer, sphere: Pair) -> None:
    """Rays along the low-poly's normals meet the sphere of radius 1.05 at that distance from the centre."""
    atlas, asset = sphere
    vertices, faces = make_sample("sphere", resolution=96)
    high = asset_from_arrays(vertices * 1.05, faces)
    buffer = make_gbuffer(atlas, 64)
    found = seen_by(buffer, atlas, asset, [high], CageSettings(0.05))
    position = found.gbuffer.position.reshape(-1, 3)[buffer.texels]
    np.testing.assert_allclose(np.linalg.norm(position, axis=1), 1.05, atol=2e-3)
    normal = found.gbuffer.normal.reshape(-1, 3)[buffer.texels]
    np.testing.assert_allclose(normal, position / 1.05, atol=0.01)
    height = found.height.reshape(-1)[buffer.texels]
    assert not found.missed.any()
    assert 0.049 < height.min() < 0.052
    assert height.max() < 0.08  # 0.05 and the sagitta of the coarse faces


def test_parts_see_only_their_partners(make_gbuffer: MakeGBuffer, two_charts: Pair) -> None:
    """Chart 0 at z = 0 and chart 1 at z = 1; each sees the plane of its name, though the other lies nearer."""
    atlas, asset = two_charts
    low = replace(asset, materials=(Material("a_low"), Material("b_low")), face_material=np.array([0, 0, 1, 1]))
    highs = [replace(plane(0.9), stem="a_high"), replace(plane(0.2), stem="b_high")]
    buffer = make_gbuffer(atlas, 32)
    found = seen_by(buffer, atlas, low, highs, CageSettings(1.0, match_names=True))
    np.testing.assert_allclose(found.height[buffer.face // 2 == 0], 0.9, atol=1e-5)
    np.testing.assert_allclose(found.height[buffer.face // 2 == 1], -0.8, atol=1e-5)
    assert set(found.gbuffer.face[buffer.face // 2 == 1]) <= {2, 3}
    with pytest.raises(InputError, match="named like b"):
        seen_by(buffer, atlas, low, highs[:1], CageSettings(1.0, match_names=True))


def test_no_high_poly_mesh_is_refused(make_gbuffer: MakeGBuffer, quad: Pair) -> None:
    with pytest.raises(InputError, match="pass --high"):
        seen_by(make_gbuffer(quad[0], 8), *quad, [])


def test_merged_meshes_keep_faces_normals_and_materials() -> None:
    red = replace(plane(0.0), colors=np.full((4, 4), 9, np.uint8), materials=(Material("red"),), stem="first")
    bent = replace(plane(1.0), normals=np.tile([1.0, 0, 0], (4, 1)), materials=(Material("a"), Material("b")))
    bent = replace(bent, face_material=np.array([1, 0]), uv=np.ones((4, 2)))
    merged = merge_assets([red, bent, plane(2.0)])
    np.testing.assert_allclose(merged.surface.triangles[2:4], bent.surface.triangles)
    np.testing.assert_allclose(merged.positions[merged.faces][4:], plane(2.0).surface.triangles)
    np.testing.assert_array_equal(merged.surface.faces, merged.weld[merged.faces])
    assert merged.normals is not None
    assert merged.colors is not None
    assert merged.uv is not None
    assert merged.face_material is not None
    np.testing.assert_allclose(merged.normals[[0, 4, 8]], [[0, 0, 1], [1, 0, 0], [0, 0, 1]], atol=1e-12)
    assert merged.colors[[0, 4], 0].tolist() == [9, 255]
    assert merged.uv[[0, 4, 8], 0].tolist() == [0, 1, 0]
    assert [material.name for material in merged.materials] == ["red", "a", "b", "material"]
    assert merged.face_material.tolist() == [0, 0, 2, 1, 3, 3]
    assert merge_assets([bent]) is bent
    assert merge_assets([red, plane(2.0)]).uv is None


def test_the_atlas_of_a_mesh_has_the_density_asked_for() -> None:
    asset = replace(plane(0.0), uv=plane(0.0).positions[:, :2] * 0.1)
    np.testing.assert_allclose(uv_per_unit(asset.surface.triangles, asset.surface.triangles[..., :2] * 0.1), 0.1)
    atlas = atlas_of(asset, 0.25)
    np.testing.assert_allclose(uv_per_unit(atlas.positions[atlas.faces], atlas.corner_uv), 0.25, rtol=1e-6)
    np.testing.assert_array_equal(atlas_of(plane(0.0), 0.25).uv, 0)


def test_a_mesh_baked_onto_itself_finds_itself(make_gbuffer: MakeGBuffer, models: Path) -> None:
    """Low-poly and high-poly the same: height 0, the same faces, nothing missed."""
    spot = load_asset(models / "spot.obj")
    assert spot.uv is not None
    spot = replace(spot, uv=spot.uv * 0.9 + 0.06)
    atlas = atlas_from_uv(spot)
    buffer = make_gbuffer(atlas, 256)
    found = seen_by(buffer, atlas, spot, [spot], CageSettings(0.001))
    covered = buffer.face >= 0
    assert found.missed.mean() < 1e-3
    diagonal = float(np.linalg.norm(np.ptp(spot.positions, axis=0)))
    assert np.percentile(np.abs(found.height[covered]), 99.5) < 1e-5 * diagonal
    assert (found.gbuffer.face == buffer.face)[covered].mean() > 0.95  # rays through edges may end beside them
    np.testing.assert_allclose(found.gbuffer.position[covered], buffer.position[covered], atol=2e-3 * diagonal)


@pytest.fixture
def coarse_bunny(models: Path, pair: Callable[..., Pair]) -> tuple[Pair, Asset]:
    """A box around bunny, unwrapped as six squares, and bunny."""
    high = load_asset(models / "bunny.obj")
    low, top = high.positions.min(axis=0), high.positions.max(axis=0)
    corner = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (top - low) + low
    sides = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * 0.3 + 0.015
    uv = np.concatenate([square + np.array([column, row]) / 3 for row in range(2) for column in range(3)])
    faces = (4 * np.arange(6)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    atlas, asset = pair(corner[sides.reshape(-1)], faces, uv)
    return (atlas, replace(asset, surface=Surface(corner, sides.reshape(-1)[faces]))), high


def test_a_box_around_bunny_sees_all_of_its_sides(make_gbuffer: MakeGBuffer, coarse_bunny: tuple[Pair, Asset]) -> None:
    (atlas, asset), high = coarse_bunny
    found = seen_by(make_gbuffer(atlas, 192), atlas, asset, [high], CageSettings(0.5))
    texels = found.gbuffer.texels
    assert found.report()["missed_share"] < 0.05
    hit = ~found.missed.reshape(-1)[texels]
    assert (found.height.reshape(-1)[texels][hit] < 1e-3).all()  # bunny lies inside its box
    assert len(np.unique(found.gbuffer.face.reshape(-1)[texels])) > 5000
    inside = found.gbuffer.position.reshape(-1, 3)[texels]
    assert (inside >= high.positions.min(axis=0) - 1e-3).all()
    assert (inside <= high.positions.max(axis=0) + 1e-3).all()
