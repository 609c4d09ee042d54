"""`flexpara bake` from its words to its files: engine targets, layers, UDIM, high-poly meshes."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

from flexpara.__main__ import main

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("moderngl")

from flexpara.bake.files.images import read_image

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"


@pytest.fixture
def square(tmp_path: Path) -> Path:
    """A unit square that is its own uv."""
    path = tmp_path / "square.obj"
    path.write_text(SQUARE, encoding="utf-8")
    return path


def baked(mesh: Path, *words: str) -> tuple[set[str], dict[str, Any]]:
    """The files of a bake at 32², without its report, and that report."""
    out = mesh.parent / "out"
    assert main(["bake", str(mesh), "-o", str(out), "--size", "32", "--quiet", *words]) == 0
    report = json.loads((out / "square.bake.json").read_text(encoding="utf-8"))
    return {path.name for path in out.iterdir()} - {"square.bake.json"}, report


def test_a_target_names_its_files(square: Path) -> None:
    files, report = baked(square, "--maps", "normal,ao", "--rays", "4", "--target", "unreal")
    assert files == {"T_square_N.png", "T_square_ORM.png"}
    assert report["settings"]["target"] == "unreal"
    assert report["settings"]["rays"] == 4


def test_every_option_is_in_the_report(square: Path) -> None:
    _, report = baked(square, "--maps", "position", "--normal-format", "directx", "--rays", "9", "--seed", "7")
    asked = {"normal_format": "directx", "rays": 9, "seed": 7, "maps": ["position"], "padding": 2, "high": []}
    assert {name: report["settings"][name] for name in asked} == asked
    assert {"udim", "cage", "match_names", "fields", "layers", "texture_format"} <= set(report["settings"])
    numbers = report["textures"]["settings"]
    assert numbers["closing"] == {
        "visible": 0.5 / 255,
        "beside": 1e-3,
        "inside": 0.1,
        "reach": 2.0,
        "steps": 100,
        "accuracy": 1e-6,
    }
    assert {"ray_offset", "curvature_radius", "texture_sharpening", "high_layers", "border_reach"} <= set(numbers)


def test_layers_share_one_file(square: Path) -> None:
    files, report = baked(square, "--maps", "normal,position", "--layers", "--exr-bits", "16")
    assert files == {"square.exr"}
    assert report["textures"]["clean_mip"] >= 0


def test_udim_gives_an_image_for_each_square(square: Path) -> None:
    square.write_text(SQUARE.replace("vt 1 ", "vt 2 "), encoding="utf-8")
    files, report = baked(square, "--maps", "position", "--udim")
    assert files == {"square_position.1001.exr", "square_position.1002.exr"}
    assert report["tiles"] == [1001, 1002]


def test_a_high_poly_mesh_gives_the_height(square: Path) -> None:
    high = square.with_name("high.obj")
    high.write_text("v -1 -1 .01\nv 2 -1 .01\nv 2 2 .01\nv -1 2 .01\nf 1 2 3\nf 1 3 4\n", encoding="utf-8")
    _, report = baked(square, "--maps", "height", "--high", str(high), "--cage", "0.05")
    assert report["high"]["missed"] == 0
    assert report["high"]["highest"] == pytest.approx(0.01, abs=1e-6)
    assert report["high"]["lowest"] == 0.0  # nothing lies behind the low-poly mesh


@pytest.mark.parametrize(
    "words",
    [
        ["--target", "cryengine"],
        ["--udim", "--layers"],
        ["--layers", "--target", "unreal"],
        ["--rays", "0"],
        ["--samples", "3"],
        ["--layers", "--exr-compression", "jpeg"],
        ["--maps", "height"],
        ["--high", "absent.obj"],
        ["--cage", "0.1"],
        ["--match-names"],
        ["--exr-bits", "16"],
    ],
)
def test_what_cannot_be_done_ends_with_2_and_leaves_nothing(
    words: list[str], square: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = square.parent / "out"
    assert main(["bake", str(square), "-o", str(out), "--size", "32", "--quiet", *words]) == 2
    assert "error:" in capsys.readouterr().err
    assert not out.exists() or not list(out.iterdir())


@pytest.mark.parametrize("words", [["--maps", "position"], ["--maps", "position", "--layers"]])
def test_a_file_that_finds_no_room_ends_with_2_and_leaves_nothing(words: list[str], square: Path) -> None:
    limit = "import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN)"
    limit += "; resource.setrlimit(resource.RLIMIT_FSIZE, (2000, 2000))"
    argv = ["bake", str(square), "-o", str(square.parent / "out"), "--size", "256", *words]
    code = f"{limit}; import sys; from flexpara.__main__ import main; sys.exit(main({argv!r}))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert "expected" in done.stderr
    assert done.stderr.startswith("flexpara: error: square")
    assert not (square.parent / "out").exists()


def test_the_whole_image_is_filled_unless_a_background_is_asked_for(square: Path) -> None:
    small = SQUARE.replace("vt 1 0", "vt .5 0").replace("vt 1 1", "vt .5 .5").replace("vt 0 1", "vt 0 .5")
    square.write_text(small, encoding="utf-8")
    _, report = baked(square, "--maps", "uv-checker,chart")
    whole = read_image(square.parent / "out" / "square_chart.png")
    assert (whole == whole[-1, 0]).all()
    assert report["textures"]["clean_mip"] == 5  # of 32 texels: the full chain
    assert list(report["textures"]["constant"]) == ["chart"]
    _, report = baked(square, "--maps", "chart,ao", "--rays", "4", "--background", "#ff8000")
    chart, ao = (read_image(square.parent / "out" / f"square_{name}.png") for name in ("chart", "ao"))
    np.testing.assert_array_equal(chart[0, -1], [255, 128, 0])
    assert ao[0, -1] == 255
    assert report["textures"]["clean_mip"] < 5
    assert report["settings"]["background"] == "#ff8000"


def test_auto_bakes_what_there_is(square: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["bake", str(square), "-o", str(square.parent / "out"), "--size", "32"]) == 2
    assert "maps is auto, which finds nothing to bake in square.obj; pass for instance" in capsys.readouterr().err
    high = square.with_name("high.obj")
    high.write_text("v -1 -1 .01\nv 2 -1 .01\nv 2 2 .02\nv -1 2 .01\nf 1 2 3\nf 1 3 4\n", encoding="utf-8")
    files, _ = baked(square, "--high", str(high), "--cage", "0.05")
    assert files == {"square_normal.png"}


def test_maps_that_are_the_same_all_over_are_said_to_be_so(square: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = square.parent / "out"
    assert main(["bake", str(square), "-o", str(out), "--size", "32", "--maps", "normal,position"]) == 0
    assert capsys.readouterr().err == "flexpara: note: the map normal is the same all over (0, 0, 1); leave it out\n"


def roof(square: Path, kind: str) -> Path:
    """A high-poly of two slopes over the square, 90 degrees apart, as a file without normals."""
    vertices = [[-1, -1, -1], [0.5, -1, 0.5], [0.5, 2, 0.5], [-1, 2, -1], [2, -1, -1], [2, 2, -1]]
    faces = [[0, 1, 2], [0, 2, 3], [1, 4, 5], [1, 5, 2]]
    path = square.parent / f"roof.{kind}"
    trimesh.Trimesh(vertices, faces, process=False).export(path)
    return path


@pytest.mark.parametrize(("kind", "words"), [("stl", ()), ("ply", ()), ("ply", ("--crease-angle", "89"))])
def test_flat_faces_of_a_high_poly_without_normals_bake_to_flat_colours(
    square: Path, kind: str, words: tuple[str, ...]
) -> None:
    asked = "--maps", "normal", "--texture-format", "exr", "--cage", "1"
    baked(square, "--high", str(roof(square, kind)), *asked, *words)
    image = read_image(square.parent / "out" / "square_normal.exr")
    slope = np.sqrt(0.5)
    assert image[:, :16] == pytest.approx(np.broadcast_to([-slope, 0.0, slope], (32, 16, 3)), abs=1e-3)
    assert image[:, 16:] == pytest.approx(np.broadcast_to([slope, 0.0, slope], (32, 16, 3)), abs=1e-3)


def test_a_crease_angle_above_that_of_the_edge_bakes_a_gradient(square: Path) -> None:
    asked = "--maps", "normal", "--texture-format", "exr", "--cage", "1", "--crease-angle", "91"
    baked(square, "--high", str(roof(square, "ply")), *asked)
    across = read_image(square.parent / "out" / "square_normal.exr")[16, :, 0]
    assert (np.diff(across) > 0.0).all()


def test_an_unwrap_takes_its_maps_from_a_high_poly_mesh_as_a_bake_does(square: Path) -> None:
    out, high = square.parent / "unwrapped", square.with_name("high.obj")
    high.write_text("v -1 -1 .01\nv 2 -1 .01\nv 2 2 .02\nv -1 2 .01\nf 1 2 3\nf 1 3 4\n", encoding="utf-8")
    words = ["--high", str(high), "--cage", "0.05", "--maps", "auto,height", "--size", "32", "--quiet"]
    assert main(["unwrap", str(square), "-o", str(out), "--no-preview", *words]) == 0
    report = json.loads((out / "square.report.json").read_text(encoding="utf-8"))
    assert (report["outputs"]["high"], report["outputs"]["maps"]) == (["high.obj"], ["normal", "height"])
    assert 0.0 < report["high"]["highest"] < 0.02
    material = trimesh.load(out / "square.glb", force="mesh").visual.material  # pyright: ignore[reportAttributeAccessIssue]
    assert material.normalTexture is not None
    assert main(["bake", str(out / "square.glb"), "-o", str(square.parent / "out"), *words]) == 0
    for name in ("square_normal.png", "square_height.exr"):
        ours, theirs = (read_image(square.parent / folder / name) for folder in ("unwrapped", "out"))
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--high", "absent.obj"], "absent.obj"),
        (["--cage", "0.1"], "cage or match-names without high"),
        (["--high", "square.obj", "--pages", "2"], "several atlases with high"),
        (["--high", "square.obj", "--udim", "--format", "obj"], "udim with high"),
    ],
)
def test_an_unwrap_refuses_before_its_work_what_maps_cannot_be_taken_from(
    words: list[str], said: str, square: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(square.parent)
    assert main(["unwrap", "square.obj", "-o", "out", "--size", "32", *words]) == 2
    assert said in capsys.readouterr().err
    assert not (square.parent / "out").exists()
