"""An OBJ file comes back line by line, with other uv; its materials with the pictures that were baked."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flexpara.runtime.io.asset.shading import shaded
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.io.obj.rewrite import rewrite_obj
from flexpara.runtime.mesh import Asset, Atlas

SOURCE = """# a plan
mtllib parts.mtl
o Floor
v 0 0 0 1 0 0
v 1 0 0 0 1 0
v 1 1 0 0 0 1
v 0 1 0 1 1 1
v 0 0 1 0 0 0
vt 0.5 0.5
vn 0 0 1
g left wing
s 1
usemtl Oak planks
f 1/1/1 2/1/1 \\
  3/1/1 4/1/1
l 1/1 2/1 5/1
p 5
o Sail
s off
usemtl Cloth
f -4 -5 -1
"""
LIBRARY = "newmtl Oak planks\nNs 20\nKd 0.5 0.5 0.5\nmap_Kd oak.png\nmap_Bump -bm 1 oak_b.png\nnewmtl Cloth\nKd 1 0 0\n"


@pytest.fixture
def asset(tmp_path: Path) -> Asset:
    (tmp_path / "source.obj").write_text(SOURCE, encoding="utf-8")
    (tmp_path / "parts.mtl").write_text(LIBRARY, encoding="utf-8")
    return load_asset(tmp_path / "source.obj")


def atlas_of(asset: Asset) -> Atlas:
    count = len(asset.positions)
    uv = np.column_stack([np.arange(count) / 8, np.arange(count) / 16]).astype(np.float32)
    normals = np.zeros((count, 3), np.float32) if asset.normals is None else asset.normals.astype(np.float32)
    chart = np.zeros(len(asset.faces), np.int64)
    return Atlas(asset.positions, asset.faces, uv, normals, chart, np.arange(count), 16, 1)


def written(asset: Asset, folder: Path, pictures: dict[str, str]) -> list[str]:
    assert asset.obj is not None
    path = folder / "result.obj"
    rewrite_obj(atlas_of(asset), asset, asset.obj, path, pictures)
    return path.read_text(encoding="utf-8").splitlines()


def test_every_line_but_uv_faces_and_libraries_is_the_file_s(asset: Asset, tmp_path: Path) -> None:
    lines = written(asset, tmp_path, {})
    kept = [line for line in SOURCE.splitlines() if line.split()[0] in ("#", "o", "v", "vn", "g", "s", "usemtl", "p")]
    assert [line for line in lines if line.split()[0] in ("o", "v", "vn", "g", "s", "usemtl", "p", "#")][1:] == kept
    assert [line for line in lines if line.startswith("l ")] == ["l 1 2 5"]
    assert [line for line in lines if line.startswith("mtllib")] == ["mtllib result.mtl"]


@pytest.mark.parametrize("face", ["f 1 2 2", "f 1 2"])
def test_a_polygon_without_area_or_a_third_corner_is_left_out(face: str, tmp_path: Path) -> None:
    faces = f"f 1 2 3\n{face}\n"
    (tmp_path / "thin.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\n" + faces, encoding="utf-8")
    asset = shaded(load_asset(tmp_path / "thin.obj"), 30.0)
    assert len(asset.faces) == 1
    assert [line for line in written(asset, tmp_path, {}) if line.startswith("f")] == ["f 1/1/1 2/2/1 3/3/1"]


def test_vertices_of_two_numbers_come_back_with_three(tmp_path: Path) -> None:
    (tmp_path / "flat.obj").write_text("v 0 0\nv 1 0\nv 0 1\nf 1 2 3\n", encoding="utf-8")
    asset = shaded(load_asset(tmp_path / "flat.obj"), 30.0)
    assert [line for line in written(asset, tmp_path, {}) if line.startswith("v ")] == ["v 0 0 0", "v 1 0 0", "v 0 1 0"]


def test_polygons_keep_positions_and_normals_and_get_the_new_uv(asset: Asset, tmp_path: Path) -> None:
    lines = written(asset, tmp_path, {})
    quad, triangle = (line.split()[1:] for line in lines if line.startswith("f "))
    assert [word.split("/")[0] for word in quad] == ["1", "2", "3", "4"]
    assert {word.split("/")[2] for word in quad} == {"1"}
    assert [word.split("/")[0] for word in triangle] == ["2", "1", "5"]
    uv = np.array([line.split()[1:] for line in lines if line.startswith("vt ")], float)
    again = load_asset(tmp_path / "result.obj")
    assert again.uv is not None
    np.testing.assert_array_equal(again.positions[again.faces], asset.positions[asset.faces])
    np.testing.assert_allclose(again.uv[again.faces], atlas_of(asset).uv[asset.faces], atol=1e-7)
    assert len(uv) == 7  # four corners of the quad, three of the triangle
    assert [material.name for material in again.materials] == ["Oak planks", "Cloth"]


def test_baked_pictures_take_the_place_of_those_on_the_old_uv(asset: Asset, tmp_path: Path) -> None:
    assert asset.obj is not None
    written(asset, tmp_path, {"base-color": "result_base-color.png"})
    library = (tmp_path / "result.mtl").read_text(encoding="utf-8").splitlines()
    new = ["map_Kd result_base-color.png"]
    assert library == ["newmtl Oak planks", *new, "Ns 20", "Kd 1 1 1", "newmtl Cloth", *new, "Kd 1 1 1"]
    assert asset.obj.pictures(["base-color", "ao"]) == 1
    assert asset.obj.pictures([]) == 2


def test_what_other_formats_have_no_word_for_is_counted(asset: Asset) -> None:
    assert asset.obj is not None
    assert asset.obj.beyond_meshes() == {"skipped_names": 5, "skipped_lines": 1, "skipped_points": 1}


def test_another_program_reads_it(asset: Asset, tmp_path: Path) -> None:
    written(asset, tmp_path, {})
    found = trimesh.load(tmp_path / "result.obj", process=False, force="mesh")
    assert isinstance(found, trimesh.Trimesh)
    assert len(found.faces) == 3
    np.testing.assert_allclose(found.area, asset.surface.face_areas().sum())


def test_normals_come_in_where_the_file_has_none(tmp_path: Path) -> None:
    path = tmp_path / "source.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\n", encoding="utf-8")
    lines = written(shaded(load_asset(path), 30.0), tmp_path, {})
    assert [line for line in lines if line.startswith("vn ")] == ["vn 0.0 0.0 1.0", "vn 0.0 1.0 0.0"]
    corners = [word.split("/") for line in lines if line.startswith("f ") for word in line.split()[1:]]
    assert [corner[0] for corner in corners] == ["1", "2", "3", "2", "1", "4"]
    assert [corner[2] for corner in corners] == ["1", "1", "1", "2", "2", "2"]


def test_corners_with_the_same_uv_share_its_line(tmp_path: Path) -> None:
    """Whatever else splits their vertices."""
    path = tmp_path / "source.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 1\nf 1 2 3\nf 2 1 4\n", encoding="utf-8")
    asset = shaded(load_asset(path), 30.0)
    assert asset.obj is not None
    atlas = replace(atlas_of(asset), uv=asset.positions[:, [0, 2]].astype(np.float32))
    rewrite_obj(atlas, asset, asset.obj, tmp_path / "result.obj", {})
    lines = (tmp_path / "result.obj").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith("vt ")] == ["vt 0.0 0.0", "vt 1.0 0.0", "vt 0.0 1.0"]
    assert [line for line in lines if line.startswith("f ")] == ["f 1/1/1 2/2/1 3/2/1", "f 2/2/2 1/1/2 4/3/2"]
