"""Scenes on the command line: nothing is lost in silence."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from scenefile import whole_scene

from flexpara.__main__ import main
from flexpara.runtime.io.meshfile import load_asset

QUICK = ["--size", "64", "--maps", "none", "--no-preview"]


def tree_of(path: Path) -> dict[str, Any]:
    data = path.read_bytes()
    return json.loads(data[20 : 20 + int.from_bytes(data[12:16], "little")])


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.glb"
    path.write_bytes(whole_scene().glb())
    return path


@pytest.mark.usefixtures("instant_training")
def test_a_scene_in_gltf_loses_nothing_and_says_nothing(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["unwrap", str(scene), "-o", str(tmp_path / "out"), *QUICK, "--strict"]) == 0
    assert "left out" not in capsys.readouterr().err
    report = json.loads((tmp_path / "out" / "scene.report.json").read_text(encoding="utf-8"))
    assert not [name for name in report["changes"] if name.startswith("skipped_")]
    assert report["written"]["glb"] == {"faces": 14, "flipped": 0, "overlapping": 0, "read_back": True}


@pytest.mark.usefixtures("instant_training")
def test_what_obj_cannot_hold_is_said_line_by_line(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), *QUICK, "--format", "obj"]
    assert main(argv) == 0
    lines = [line for line in capsys.readouterr().err.splitlines() if "note" in line]
    said = ("1 animation left out", "1 skin left out", "1 morph target left out", "1 camera", "1 light")
    said += ("4 nodes of the scene joined", "1 attribute of vertices", "1 uv set beside", "extras of 3 objects")
    said += ("1 extension of glTF", "1 picture of materials")
    assert all(any(fact in line for line in lines) for fact in said)
    report = json.loads((tmp_path / "out" / "scene.report.json").read_text(encoding="utf-8"))
    assert report["changes"]["skipped_animations"] == 1
    assert report["written"]["obj"]["faces"] == 14
    assert len(load_asset(tmp_path / "out" / "scene.obj").faces) == 3 * 8 + 6
    assert main([*argv, "--strict"]) == 2
    assert "1 animation left out" in capsys.readouterr().err


def test_a_texture_that_cannot_be_decoded_is_refused_or_stays(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], instant_training: list[object]
) -> None:
    made = whole_scene()
    made.tree["textures"][0] = {"extensions": {"KHR_texture_basisu": {"source": 0}}}
    made.tree["images"][0]["mimeType"] = "image/ktx2"
    path = tmp_path / "scene.glb"
    path.write_bytes(made.glb())
    assert main(["unwrap", str(path), "-o", str(tmp_path / "out"), "--size", "64"]) == 2
    assert "the base-color texture of material Paint" in capsys.readouterr().err
    assert instant_training == []
    assert main(["unwrap", str(path), "-o", str(tmp_path / "out"), *QUICK]) == 0
    tree = tree_of(tmp_path / "out" / "scene.glb")
    assert tree["textures"][0] == made.tree["textures"][0]
    assert tree["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"] == {"index": 0, "texCoord": 1}
    assert len(load_asset(path).faces) == len(load_asset(tmp_path / "out" / "scene.glb").faces)


@pytest.mark.usefixtures("instant_training")
def test_light_map_uv_go_to_the_set_asked_for_and_all_else_stays(scene: Path, tmp_path: Path) -> None:
    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), "--uv-set", "2", "--maps", "ao", "--size", "64"]
    assert main([*argv, "--target", "godot", "--no-preview", "--quiet"]) == 0
    before, after = (tree_of(path) for path in (scene, tmp_path / "out" / "scene.glb"))
    for old, new in zip(before["meshes"], after["meshes"], strict=True):
        for one, other in zip(old["primitives"], new["primitives"], strict=True):
            sets = {f"TEXCOORD_{number}" for number in range(3)}
            assert set(other["attributes"]) == set(one["attributes"]) | sets
    for old, new in zip(before["materials"], after["materials"], strict=True):
        assert new.pop("occlusionTexture")["texCoord"] == 2
        assert new == old
    report = json.loads((tmp_path / "out" / "scene.report.json").read_text(encoding="utf-8"))
    assert report["settings"]["padding"] == 2


@pytest.mark.usefixtures("instant_training")
def test_one_uv_set_is_all_that_obj_holds(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), "--uv-set", "1", "--format", "obj"]
    assert main(argv) == 2
    assert "holds one set" in capsys.readouterr().err


def test_any_uv_set_can_be_baked_onto(scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["bake", str(scene), "-o", str(tmp_path / "out"), "--maps", "uv-checker", "--size", "64"]
    assert main([*argv, "--uv-set", "0"]) == 0
    assert "scene: 100 % of the faces overlap others in uv" in capsys.readouterr().err
    assert main([*argv, "--uv-set", "0", "--strict"]) == 2
    assert "overlap" in capsys.readouterr().err
    assert main([*argv, "--uv-set", "1"]) == 2
    assert "Board of scene has no uv set 1" in capsys.readouterr().err


@pytest.mark.usefixtures("instant_training")
def test_what_is_not_selected_comes_back_as_it_was(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), "--size", "64", "--no-preview", "--quiet", "--select"]
    assert main([*argv, "Root"]) == 0
    before, after = (tree_of(path) for path in (scene, tmp_path / "out" / "scene.glb"))
    sets = [list(mesh["primitives"][0]["attributes"]) for mesh in after["meshes"]]
    assert "TEXCOORD_1" in sets[0]
    assert sorted(sets[1]) == sorted(before["meshes"][1]["primitives"][0]["attributes"])
    arm, board = (after["meshes"][mesh]["primitives"][0]["material"] for mesh in (1, 0))
    assert after["materials"][arm] == before["materials"][0]
    assert after["materials"][board]["name"] == "Paint"
    assert board != arm
    assert main([*argv, "Leg"]) == 2
    assert "no node and no mesh is called 'Leg'" in capsys.readouterr().err


def shown(tree: dict[str, Any], mesh: int, primitive: int) -> tuple[str, str, int]:
    """Material, name of its occlusion picture, and the uv set that this is read with."""
    material = tree["materials"][tree["meshes"][mesh]["primitives"][primitive]["material"]]
    info = material["occlusionTexture"]
    picture = tree["images"][tree["textures"][info["index"]]["source"]]
    return material["name"], picture["name"], info.get("texCoord", 0)


@pytest.mark.usefixtures("instant_training")
def test_each_mesh_can_have_an_atlas_with_textures_of_its_own(scene: Path, tmp_path: Path) -> None:
    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), "--atlas", "mesh", "--maps", "ao", "--size", "64"]
    assert main([*argv, "--no-preview", "--quiet"]) == 0
    tree = tree_of(tmp_path / "out" / "scene.glb")
    assert shown(tree, 0, 0) == ("Paint", "scene_Board_ao", 0)
    assert shown(tree, 0, 1) == ("Glass", "scene_Board_ao", 0)
    assert shown(tree, 1, 0) == ("Paint", "scene_Arm_ao", 0)
    names = {path.name for path in (tmp_path / "out").iterdir()}
    pages = {f"scene_{page}{ending}" for page in ("Board", "Arm") for ending in (".onnx", "_ao.png")}
    assert names == pages | {"scene.glb", "scene.report.json"}
    report = json.loads((tmp_path / "out" / "scene.report.json").read_text(encoding="utf-8"))
    assert set(report["pages"]) == {"scene_Board", "scene_Arm"}
    assert report["written"]["glb"] == {"faces": 14, "flipped": 0, "overlapping": 0, "read_back": True}


@pytest.mark.usefixtures("instant_training")
def test_each_material_can_have_an_atlas_and_all_else_stays(scene: Path, tmp_path: Path) -> None:
    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), "--atlas", "material", "--maps", "ao", "--size", "64"]
    assert main([*argv, "--no-preview", "--quiet"]) == 0
    before, after = (tree_of(path) for path in (scene, tmp_path / "out" / "scene.glb"))
    assert [shown(after, *place)[1] for place in ((0, 0), (0, 1), (1, 0))] == [
        "scene_Paint_ao",
        "scene_Glass_ao",
        "scene_Paint_ao",
    ]
    for name in ("nodes", "scenes", "cameras", "extensions"):
        assert after[name] == before[name]


def test_several_atlases_want_a_format_that_holds_them(
    scene: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], instant_training: list[object]
) -> None:
    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), "--atlas", "mesh", "--format", "obj"]
    assert main(argv) == 2
    assert "several atlases with format obj, expected glb or gltf" in capsys.readouterr().err
    assert instant_training == []


@pytest.mark.usefixtures("instant_training")
def test_a_foreign_texture_of_a_page_is_refused_before_the_work(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def never(*_: object, **__: object) -> None:
        raise AssertionError

    argv = ["unwrap", str(scene), "-o", str(tmp_path / "out"), "--atlas", "material", "--maps", "ao", "--size", "64"]
    assert main(argv) == 0
    foreign = next((tmp_path / "out").glob("*_ao.png"))
    kept = tmp_path / "other" / foreign.name
    kept.parent.mkdir()
    kept.write_bytes(b"somebody's")
    monkeypatch.setattr("flexpara.__main__.unwrap_asset_pages", never)
    assert main([*argv[:3], str(kept.parent), *argv[4:]]) == 2
    assert foreign.name in capsys.readouterr().err
    assert kept.read_bytes() == b"somebody's"
