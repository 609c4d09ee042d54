"""OBJ files that are written anew have the scene's names: nodes as objects, materials with their own factors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenefile import whole_scene

from flexpara.runtime.io.gltf.instances import every_instance, instance_faces
from flexpara.runtime.io.loops import first_faces, loops_of
from flexpara.runtime.io.meshfile import asset_from_arrays, load_asset
from flexpara.runtime.io.obj.named import Named, named, plain_names
from flexpara.runtime.io.obj.write import write_obj
from flexpara.runtime.pack.packing import atlas_from_uv


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "scene.glb"
    path.write_bytes(whole_scene().glb())
    return path


def written(source: Path, texture: str | None = None) -> Path:
    asset, path = load_asset(source), source.with_suffix(".obj")
    spread, _ = every_instance(atlas_from_uv(asset), asset)
    loops = loops_of(spread, asset)
    names = named(asset, instance_faces(asset), first_faces(asset, loops), texture)
    write_obj(spread, path, texture=texture, loops=loops, names=names)
    return path


def test_nodes_are_objects_and_materials_are_used_where_they_are(source: Path) -> None:
    lines = written(source).read_text(encoding="utf-8").splitlines()
    found = [line for line in lines if line.startswith(("o ", "usemtl "))]
    board = ["usemtl Paint", "usemtl Glass"]
    assert found == ["o A", *board, "o B", *board, "o C", *board, "o Arm", "usemtl Paint"]
    assert sum(line.startswith("f ") for line in lines) == 3 * 8 + 6


def test_materials_keep_their_factors_and_are_read_again(source: Path) -> None:
    asset = load_asset(written(source))
    glass = next(entry for entry in asset.materials if entry.name == "Glass")
    assert glass.base_color_factor == (0.2, 0.4, 1.0, 0.5)
    assert glass.alpha_mode == "BLEND"
    assert asset.face_material is not None
    assert np.bincount(asset.face_material).tolist() == [3 * 4 + 6, 3 * 4]


def test_a_baked_picture_is_that_of_all_materials(source: Path) -> None:
    library = written(source, "scene_base-color.png").with_suffix(".mtl").read_text(encoding="utf-8")
    assert library.count("newmtl") == library.count("map_Kd scene_base-color.png") == 2
    assert library.count("Kd 1 1 1") == 2


def test_a_mesh_without_materials_has_one_for_its_picture_alone() -> None:
    asset = asset_from_arrays(np.eye(3), np.array([[0, 1, 2]]))
    one = np.zeros(1, np.int64)
    assert named(asset, one, one, None) == Named({}, ())
    assert named(asset, one, one, "a.png") == plain_names("a.png")
    assert plain_names("a.png").marks == {0: ["usemtl atlas"]}


def test_names_of_two_lines_stay_on_one(source: Path) -> None:
    made = whole_scene()
    made.tree["materials"][0]["name"] = "Pa\nint  2"
    made.tree["nodes"][1]["name"] = "A\nf 1 1 1"
    source.write_bytes(made.glb())
    text = written(source).read_text(encoding="utf-8")
    assert "usemtl Pa int 2\n" in text
    assert "o A f 1 1 1\n" in text
