"""What the baking benchmark measures with: look-ups, decoded normals, angles, bands; and Blender's script as a file."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import pytest

from benchmarks import bake
from flexpara.bake.maps.normals import to_tangent_space
from flexpara.bake.maps.rays import RayScene
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.bake.raster.layout import Planes
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.pagesize import PageSize


def test_images_are_looked_up_between_texel_centres() -> None:
    image = np.arange(16, dtype=np.float32).reshape(4, 4, 1)
    uv = np.array([[0.125, 0.875], [0.25, 0.875], [0.125, 0.75], [0.875, 0.125]])
    np.testing.assert_allclose(bake.sampled(image, uv)[:, 0], [0, 0.5, 2, 15])


def test_decoding_undoes_the_baking_of_tangent_space() -> None:
    rng = np.random.default_rng(1)
    frame = rng.normal(size=(50, 7)).astype(np.float32)
    normal = rng.normal(size=(50, 3)).astype(np.float32)
    local = to_tangent_space(normal, frame)
    assert (
        bake.angles(bake.decoded(local.astype(np.float64), frame.astype(np.float64)), normal.astype(np.float64)).max()
        < 0.2
    )


@pytest.mark.parametrize("degrees", [0.0, 30.0, 180.0])
def test_angles_are_in_degrees(degrees: float) -> None:
    turn = np.radians(degrees)
    first, second = np.array([[2.0, 0, 0]]), np.array([[np.cos(turn), np.sin(turn), 0]])
    np.testing.assert_allclose(bake.angles(first, second), degrees, atol=1e-5)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_camera_sees_the_triangle_it_looks_at(side: float) -> None:
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0]])
    scene = RayScene.of(Surface(corners, np.array([[0, 1, 2]])), Frame((0.0, 0.0, 0.0), 1.0))
    hit, face, weight = bake.seen(scene, 2, side, 64)
    assert abs(hit.mean() - 0.5) < 0.02
    assert (face[hit] == 0).all()
    np.testing.assert_allclose(weight.sum(axis=1), 1, atol=1e-6)


def test_a_band_names_the_texels_of_the_whole_image() -> None:
    whole = GBuffer.of(Planes.of(8, 8), size=PageSize(8, 8))
    band = bake.band_of(whole, 2, 5)
    assert band.shape == (3, 8)
    assert band.page == (8, 8)
    assert band.image_texels(np.array([0, 9])).tolist() == [16, 25]


def test_blender_s_script_needs_nothing_of_ours() -> None:
    tree = ast.parse((Path(bake.__file__).parent / "blender_bake.py").read_text(encoding="utf-8"))
    names = {alias.name for node in ast.walk(tree) if isinstance(node, ast.Import) for alias in node.names}
    names |= {node.module or "" for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    assert names == {"__future__", "sys", "time", "importlib", "typing", "numpy"}
