"""Assets without normals get some: vertices split where they differ, nothing else changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from flexpara.runtime.io.asset.shading import shaded
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.mesh import Asset

QUADS = "4 3 2 1,5 6 7 8,1 2 6 5,2 3 7 6,3 4 8 7,4 1 5 8"
CORNERS = "0 0 0,1 0 0,1 1 0,0 1 0,0 0 1,1 0 1,1 1 1,0 1 1"


def cube_obj(folder: Path, *, smoothing: str = "") -> Asset:
    """A cube of six quads, read of a file; smoothing: a line before its faces."""
    lines = [*(f"v {corner}" for corner in CORNERS.split(",")), smoothing, *(f"f {quad}" for quad in QUADS.split(","))]
    path = folder / "cube.obj"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return load_asset(path)


def facing(asset: Asset) -> np.ndarray:
    """(f, 3) cosines between the normals of corners and those of their faces."""
    assert asset.normals is not None
    return np.einsum("fcx,fx->fc", asset.normals[asset.faces], asset.surface.face_normals())


@pytest.mark.parametrize("smoothing", ["", "s off", "s 0"])
def test_a_cube_has_24_vertices_with_the_normals_of_its_sides(tmp_path: Path, smoothing: str) -> None:
    asset = shaded(cube_obj(tmp_path, smoothing=smoothing), 30.0)
    assert len(asset.positions) == 24
    assert facing(asset) == pytest.approx(1.0)


def test_a_cube_in_one_smoothing_group_has_8_vertices(tmp_path: Path) -> None:
    asset = shaded(cube_obj(tmp_path, smoothing="s 1"), 30.0)
    assert len(asset.positions) == 8
    assert facing(asset) == pytest.approx(1.0 / np.sqrt(3.0))


def test_a_cube_is_smooth_where_the_angle_allows(tmp_path: Path) -> None:
    asset = cube_obj(tmp_path)
    assert [len(shaded(asset, angle).positions) for angle in (89.0, 91.0)] == [24, 8]


def test_faces_before_the_first_group_are_flat(tmp_path: Path) -> None:
    path = tmp_path / "fan.obj"
    text = "v 0 0 0\nv 0 1 0\nv -1 0 0\nv 1 0 0\nv 0 0 1\nf 1 2 3\ns 7\nf 2 1 4\ns off\nf 1 2 5\n"
    path.write_text(text, encoding="utf-8")
    smoothing = load_asset(path).smoothing
    assert smoothing is not None
    assert smoothing.tolist() == [0, 1, 0]


def test_facets_of_stl_files_are_flat_below_the_angle(tmp_path: Path) -> None:
    path = tmp_path / "ball.stl"
    trimesh.creation.icosphere(subdivisions=3).export(path)
    assert facing(shaded(load_asset(path), 30.0)) == pytest.approx(1.0)


def test_a_ball_without_normals_keeps_its_vertices() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    asset = asset_from_arrays(ball.vertices, ball.faces)
    found = shaded(asset, 30.0)
    assert len(found.positions) == len(asset.positions)
    assert found.normals == pytest.approx(found.positions, abs=0.05)


def test_normals_of_a_file_stay() -> None:
    asset = asset_from_arrays(np.eye(3), [[0, 1, 2]], normals=np.eye(3))
    assert shaded(asset, 30.0) is asset


def test_split_vertices_keep_what_the_file_says_of_them_and_the_surface_stays() -> None:
    box = trimesh.creation.box()
    uv, colors = np.random.default_rng(1).random((8, 2)), np.arange(32, dtype=np.uint8).reshape(8, 4)
    asset = asset_from_arrays(box.vertices, box.faces, uv=uv, colors=colors)
    found = shaded(asset, 30.0)
    assert len(found.positions) == 24
    assert found.surface is asset.surface
    assert asset.uv is not None
    assert found.uv is not None
    assert asset.colors is not None
    assert found.colors is not None
    assert found.positions[:8].tolist() == asset.positions.tolist()
    assert found.positions[found.faces].tolist() == asset.positions[asset.faces].tolist()
    assert found.uv[found.faces].tolist() == asset.uv[asset.faces].tolist()
    assert found.colors[found.faces].tolist() == asset.colors[asset.faces].tolist()
    assert found.weld[found.faces].tolist() == asset.surface.faces.tolist()
    assert found.unsplit is not None
    assert found.unsplit[found.faces].tolist() == asset.faces.tolist()
