"""Every map of a high-poly mesh on the low-poly's texture: planes by hand, then what a renderer sees of bunny."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.baker import bake
from flexpara.bake.highpoly.cage import CageSettings
from flexpara.bake.highpoly.highmaps import OWN, HighSource
from flexpara.bake.maps.catalogue import MAP_NAMES
from flexpara.bake.maps.rays import RayScene, RaySettings
from flexpara.bake.maps.tangents import vertex_tangents
from flexpara.runtime.errors import InputError
from flexpara.runtime.geometry.normals import smooth_normals
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.material import Material
from flexpara.runtime.mesh import Asset, Atlas, Frame, Surface
from flexpara.runtime.pack.packing import atlas_from_uv
from flexpara.runtime.samples import make_sample

Pair = tuple[Atlas, Asset]


def slope(rise: float = 0.5) -> Asset:
    """A square over [−1, 2]² at z = rise · (x − ½), with colours and a material."""
    corners = np.array([[x, y, rise * (x - 0.5)] for x, y in ((-1, -1), (2, -1), (2, 2), (-1, 2))])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    colors = np.array([[255, 0, 0, 255]] * 4, np.uint8)
    material = Material("red", base_color_factor=(0.5, 1.0, 1.0, 1.0))
    return Asset(corners, faces, np.arange(4), Surface(corners, faces), colors=colors, materials=(material,))


def baked(pair: Pair, source: HighSource, *names: str) -> dict[str, np.ndarray]:
    """Pixels of maps baked through the whole baker, without gutters."""
    maps = [source.find_map(name) for name in names]
    return {name: texture.pixels for name, texture in bake(*pair, maps, size=16).items()}


def test_each_map_is_that_of_the_high_poly_surface(quad: Pair) -> None:
    source = HighSource([slope()], CageSettings(0.5))
    found = baked(quad, source, "normal", "normal-object", "height", "position", "vertex-color", "ao", "curvature")
    x = np.broadcast_to((np.arange(16) + 0.5) / 16, (16, 16))
    tilted = np.array([-0.5, 0, 1]) / np.hypot(0.5, 1)
    np.testing.assert_allclose(found["normal"], np.broadcast_to(tilted, (16, 16, 3)), atol=1e-5)
    np.testing.assert_allclose(found["normal-object"], np.broadcast_to(tilted, (16, 16, 3)), atol=1e-5)
    np.testing.assert_allclose(found["height"][..., 0], 0.5 * (x - 0.5), atol=1e-5)
    np.testing.assert_allclose(found["position"][..., 2], 0.5 * (x - 0.5), atol=1e-5)
    np.testing.assert_allclose(found["vertex-color"], np.broadcast_to([1, 0, 0], (16, 16, 3)), atol=1e-6)
    np.testing.assert_array_equal(found["ao"], 1)
    np.testing.assert_allclose(found["curvature"], 0.5, atol=1e-6)
    assert source.report()["texels"] == 256
    assert source.report()["missed"] == 0
    np.testing.assert_allclose(source.report()["highest"], 0.234375, atol=1e-5)
    np.testing.assert_allclose(source.report()["lowest"], -0.234375, atol=1e-5)


def test_directx_turns_green_down(quad: Pair) -> None:
    turned = slope()
    swapped = turned.positions[:, [1, 0, 2]]
    high = replace(
        turned, positions=swapped, faces=turned.faces[:, ::-1], surface=Surface(swapped, turned.faces[:, ::-1])
    )
    source = HighSource([high], CageSettings(0.5))
    up = bake(*quad, [source.find_map("normal")], size=8)["normal"].pixels
    entry = source.find_map("normal", normal_format="directx")
    down = bake(*quad, [entry], size=8)["normal"].pixels
    assert (up[..., 1] < -0.4).all()
    np.testing.assert_allclose(down, up * [1, -1, 1], atol=1e-6)


def test_base_colour_is_that_of_the_high_poly_material(quad: Pair) -> None:
    plain = replace(slope(), colors=None)
    found = baked(quad, HighSource([plain], CageSettings(0.5)), "base-color")["base-color"]
    np.testing.assert_allclose(found[..., :3], np.broadcast_to([0.5, 1, 1], (16, 16, 3)), atol=1e-6)


def test_maps_of_the_low_poly_mesh_stay(quad: Pair) -> None:
    source = HighSource([slope()])
    for name in OWN:
        own = bake(*quad, [source.find_map(name)], size=8)[name].pixels
        np.testing.assert_array_equal(own, bake(*quad, [name], size=8)[name].pixels, name)
    assert source.report()["texels"] == 0


@pytest.mark.parametrize("name", sorted({*MAP_NAMES} - {*OWN, "vertex-color"}))
def test_all_other_maps_are_those_of_the_high_poly_mesh(name: str, quad: Pair) -> None:
    source = HighSource([slope()])
    bake(*quad, [source.find_map(name)], size=8)
    assert source.report()["texels"] == 64


def test_bent_normals_are_those_of_the_high_poly_mesh(quad: Pair) -> None:
    """Beside a wall of the high-poly mesh that the low-poly lacks."""
    wall = np.array([[-0.1, -50, -1], [-0.1, 50, -1], [-0.1, 50, 90], [-0.1, -50, 90]])
    walled = Asset(
        wall, np.array([[0, 1, 2], [0, 2, 3]]), np.arange(4), Surface(wall, np.array([[0, 1, 2], [0, 2, 3]]))
    )
    source = HighSource([slope(0.0), walled], CageSettings(0.2))
    entry = source.find_map("bent-normal", rays=RaySettings(256))
    pixels = bake(*quad, [entry], size=8)["bent-normal"].pixels
    assert (pixels[..., 0] > 0.4).all()


def test_windows_change_nothing_and_are_counted_once(fine_sphere: Pair) -> None:
    vertices, faces = make_sample("sphere", resolution=48)
    high = asset_from_arrays(vertices * 1.02, faces)
    covered = bake(*fine_sphere, ["face-id"], size=96, padding=0)["face-id"].pixels[..., 0] >= 0
    whole, parts = HighSource([high]), HighSource([high])
    names = ("normal", "height")
    one = bake(*fine_sphere, [whole.find_map(name) for name in names], size=96, padding=0)
    many = bake(*fine_sphere, [parts.find_map(name) for name in names], size=96, padding=0, limit=40)
    for name in names:
        np.testing.assert_allclose(many[name].pixels[covered], one[name].pixels[covered], atol=1e-6)
    assert parts.report() == whole.report()


def test_no_high_poly_mesh_is_refused() -> None:
    with pytest.raises(InputError, match="pass --high"):
        HighSource([])


def seen(scene: RayScene, *, side: int, pixels: int = 128) -> tuple[np.ndarray, ...]:
    """What an orthographic camera on the z axis sees: hit (r,), face (r,), weights (r, 3)."""
    place = (np.arange(pixels) + 0.5) / pixels * 2 - 1
    origin = np.stack([np.tile(place, pixels), np.repeat(place, pixels), np.full(pixels**2, 3.0 * side)], axis=1)
    direction = np.tile(np.array([0, 0, -side], np.float32), (pixels**2, 1))
    hits = scene.cast(origin.astype(np.float32), direction)
    return hits.hit, hits.face, np.stack([1 - hits.second - hits.third, hits.second, hits.third], axis=1)


def test_the_low_poly_mesh_with_its_map_looks_like_the_high_poly_mesh(models: Path) -> None:
    """Spot's own mesh, dented, as the high-poly one: the map must bring the dents back to within a degree or two."""
    low = load_asset(models / "spot.obj")
    assert low.uv is not None
    low = replace(low, uv=low.uv * 0.9 + 0.06)
    atlas = atlas_from_uv(low)
    normal = smooth_normals(low.surface)
    wave = 0.004 * np.sin(12 * low.surface.vertices).sum(axis=1, keepdims=True)
    dented = Surface(low.surface.vertices + wave * normal, low.surface.faces)
    smooth = smooth_normals(dented)
    high = Asset(dented.vertices, dented.faces, np.arange(len(dented.vertices)), dented, normals=smooth)
    size = 512
    image = bake(atlas, low, [HighSource([high]).find_map("normal")], size=size)["normal"].pixels
    frame = Frame.of(low.surface.vertices)
    hit, face, weight = seen(RayScene.of(low.surface, frame), side=1)
    other, true_face, true_weight = seen(RayScene.of(dented, frame), side=1)
    both = hit & other
    uv = np.einsum("tc,tci->ti", weight[both], atlas.corner_uv[face[both]])
    texel = np.floor(np.stack([(1 - uv[:, 1]) * size, uv[:, 0] * size], axis=1)).astype(int)
    local = image[texel[:, 0], texel[:, 1]]
    frames = np.column_stack([atlas.normals, vertex_tangents(atlas)])
    axes = np.einsum("tc,tci->ti", weight[both], frames[atlas.faces[face[both]]])
    across = np.cross(axes[:, :3], axes[:, 3:6]) * np.sign(axes[:, 6:])
    shown = local[:, :1] * axes[:, 3:6] + local[:, 1:2] * across + local[:, 2:] * axes[:, :3]
    true = np.einsum("tc,tci->ti", true_weight[both], smooth_normals(dented)[dented.faces[true_face[both]]])
    assert angle(shown, true).mean() < 2.0
    assert angle(axes[:, :3], true).mean() > 1.5 * angle(shown, true).mean()


def angle(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(t,) degrees between vectors."""
    lengths = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
    return np.degrees(np.arccos(np.clip(np.einsum("ti,ti->t", first, second) / lengths, -1, 1)))
