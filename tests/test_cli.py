"""The command line, by calling main(): what it writes, and each bad input one by one."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import TYPE_CHECKING

import numpy as np
import pytest

import flexpara
import flexpara.bake.raster.context
from flexpara import __main__ as cli
from flexpara.__main__ import main

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from flexpara.runtime.mesh import Surface

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
UV_SQUARE = """v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
f 1/1 2/2 3/3
f 1/1 3/3 4/4
"""


@pytest.fixture
def square(tmp_path: Path) -> Path:
    """A unit square that is its own uv."""
    path = tmp_path / "square.obj"
    path.write_text(UV_SQUARE, encoding="utf-8")
    return path


@pytest.fixture
def fails(capsys: pytest.CaptureFixture[str]) -> Callable[..., str]:
    """Run a command that must end with a code and exactly one line on stderr; returns the line."""

    def run(code: int, *argv: object) -> str:
        capsys.readouterr()
        assert main([str(word) for word in argv]) == code
        printed = capsys.readouterr()
        assert printed.out == ""
        assert printed.err.startswith("flexpara: error: ")
        assert printed.err.count("\n") == 1
        assert printed.err.endswith("\n")
        return printed.err

    return run


def _points(folder: Path) -> Path:
    """Three points on the square."""
    np.save(folder / "points.npy", np.array([[0.1, 0.2, 0.0], [0.5, 0.5, 0.0], [0.9, 0.4, 0.0]]))
    return folder / "points.npy"


def text_file(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_help_and_version_end_with_0(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    assert "unwrap" in capsys.readouterr().out
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.strip() == flexpara.__version__
    assert main(["unwrap", "--help"]) == 0
    assert "--charts" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("argv", "named"),
    [
        (["unwrp", "a.obj"], "unwrp"),
        (["unwrap", "a.obj"], "--output"),
        (["unwrap", "-o", "out"], "MESH"),
        (["unwrap", "a.obj", "-o", "out", "--charts", "many"], "many"),
        (["unwrap", "a.obj", "-o", "out", "--bogus"], "--bogus"),
        (["unwrap", "a.obj", "-o"], "-o"),
    ],
)
def test_a_wrong_command_line_names_the_word_and_the_help(
    argv: list[str], named: str, fails: Callable[..., str]
) -> None:
    line = fails(2, *argv)
    assert named in line
    assert "--help" in line


@pytest.mark.parametrize(
    ("option", "value", "named"),
    [
        ("--charts", 0, "charts is 0"),
        ("--charts", -3, "charts is -3"),
        ("--size", 8, "size is 8"),
        ("--size", 100_000, "size is 100000"),
        ("--padding", -1, "padding is -1"),
        ("--padding", 1000, "padding is 1000"),
        ("--seed", -1, "seed is -1"),
        ("--preset", "slow", '"slow"'),
        ("--maps", "normal,shiny", "shiny"),
        ("--format", "glb,fbx", "fbx"),
        ("--format", "", "format"),
    ],
)
def test_a_value_out_of_range_is_refused_before_the_mesh_is_read(
    option: str, value: object, named: str, tmp_path: Path, fails: Callable[..., str]
) -> None:
    assert named in fails(2, "unwrap", tmp_path / "absent.obj", "-o", tmp_path / "out", option, value)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("name", "text", "named"),
    [
        ("absent.obj", None, "absent.obj"),
        ("notes.txt", "not a mesh", "notes.txt"),
        ("broken.glb", "not a mesh", "broken.glb"),
        ("empty.obj", "", "empty.obj"),
        ("points.obj", TRIANGLE, "points.obj"),
        ("nan.obj", TRIANGLE.replace("1 0 0", "nan 0 0") + "f 1 2 3\n", "nan.obj"),
        ("inf.obj", TRIANGLE.replace("1 0 0", "inf 0 0") + "f 1 2 3\n", "inf.obj"),
        ("flat.obj", TRIANGLE + "f 1 1 2\nf 2 2 3\n", "degenerate"),
    ],
)
def test_a_bad_mesh_is_one_line_and_leaves_nothing(
    name: str, text: str | None, named: str, tmp_path: Path, fails: Callable[..., str]
) -> None:
    if text is not None:
        text_file(tmp_path, name, text)
    assert named in fails(2, "unwrap", tmp_path / name, "-o", tmp_path / "out")
    assert named in fails(2, "evaluate", tmp_path / name)
    assert named in fails(2, "bake", tmp_path / name, "-o", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_mesh_without_uv_can_be_neither_evaluated_nor_baked(tmp_path: Path, fails: Callable[..., str]) -> None:
    mesh = text_file(tmp_path, "bare.obj", TRIANGLE + "f 1 2 3\n")
    assert "uv" in fails(2, "evaluate", mesh)
    assert "uv" in fails(2, "bake", mesh, "-o", tmp_path / "out")


def test_an_onnx_file_that_is_not_ours_is_refused(tmp_path: Path, fails: Callable[..., str]) -> None:
    points = _points(tmp_path)
    foreign = text_file(tmp_path, "foreign.onnx", "not a network")
    assert "foreign.onnx" in fails(2, "query", foreign, points, "-o", tmp_path / "uv.npz")
    assert "absent.onnx" in fails(2, "query", tmp_path / "absent.onnx", points, "-o", tmp_path / "uv.npz")
    assert not (tmp_path / "uv.npz").exists()


def test_an_unknown_sample_lists_those_there_are(tmp_path: Path, fails: Callable[..., str]) -> None:
    line = fails(2, "sample", "teapot", "-o", tmp_path / "teapot.ply")
    assert "teapot" in line
    assert "trefoil" in line


def test_a_sample_is_written_once_and_not_over_another_file(tmp_path: Path, fails: Callable[..., str]) -> None:
    mesh = tmp_path / "new" / "torus.ply"
    assert main(["sample", "torus", "-o", str(mesh)]) == 0
    first = mesh.read_bytes()
    assert "--force" in fails(2, "sample", "torus", "-o", mesh)
    assert main(["sample", "torus", "-o", str(mesh), "--force"]) == 0
    assert mesh.read_bytes() == first
    assert len(flexpara.runtime.load_asset(mesh).faces) > 100


def test_a_sample_of_no_known_format_is_refused(tmp_path: Path, fails: Callable[..., str]) -> None:
    assert ".docx" in fails(2, "sample", "torus", "-o", tmp_path / "torus.docx")
    assert list(tmp_path.iterdir()) == []


def test_evaluate_shows_the_metrics_of_an_isometric_square(square: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["evaluate", str(square), "--json"]) == 0
    metrics = json.loads(capsys.readouterr().out)
    assert metrics["charts"] == 1
    assert metrics["flipped_faces"] == 0
    assert metrics["symmetric_dirichlet_mean"] == pytest.approx(1.0)
    assert main(["evaluate", str(square)]) == 0
    table = capsys.readouterr().out
    assert "charts" in table
    assert "flipped" in table


QUICK = ("--size", "64", "--maps", "none", "--no-preview")


@pytest.mark.usefixtures("instant_training")
def test_unwrap_writes_every_file_and_says_what_came_out(
    square: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["unwrap", str(square), "-o", str(out), "--size", "64", "--maps", "auto,chart"]) == 0
    printed = capsys.readouterr()
    assert printed.err.startswith("flexpara: note: square: the map chart is the same all over (")
    assert printed.err.count("\n") == 1
    pictures = {"square_chart.png"}
    expected = {"square.glb", "square.onnx", "square.report.json", "square.preview.png"} | pictures
    assert {path.name for path in out.iterdir()} == expected
    assert all(str(out / name) in printed.out for name in expected)
    assert "flipped faces" in printed.out
    assert main(["query", str(out / "square.onnx"), str(_points(tmp_path)), "-o", str(tmp_path / "uv.npz")]) == 0
    with np.load(tmp_path / "uv.npz") as answer:
        assert answer["uv"].shape == (3, 2)


@pytest.mark.usefixtures("instant_training")
def test_bake_takes_the_uv_of_any_mesh(square: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "maps"
    argv = ["bake", str(square), "-o", str(out), "--maps", "position,normal", "--size", "32", "--texture-format", "exr"]
    for _ in range(2):
        assert main(argv) == 0
        assert {path.name for path in out.iterdir()} == {"square_position.exr", "square_normal.exr", "square.bake.json"}
        assert "square_position.exr" in capsys.readouterr().out


@pytest.mark.usefixtures("instant_training")
def test_quiet_says_nothing(square: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["unwrap", str(square), "-o", str(tmp_path / "out"), "--quiet", *QUICK]) == 0
    assert capsys.readouterr() == ("", "")


@pytest.mark.usefixtures("instant_training")
def test_what_was_dropped_is_said_in_one_line_unless_quiet(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = text_file(tmp_path, "dirty.obj", TRIANGLE + "v 9 9 9\nf 1 2 3\nf 1 1 2\n")
    assert main(["unwrap", str(mesh), "-o", str(tmp_path / "loud"), *QUICK]) == 0
    line = capsys.readouterr().err
    assert line.startswith("flexpara: note: dirty: ")
    assert "1 face without area" in line
    assert line.count("\n") == 1
    assert main(["unwrap", str(mesh), "-o", str(tmp_path / "quiet"), "--quiet", *QUICK]) == 0
    assert capsys.readouterr() == ("", "")


def test_a_foreign_file_is_refused_before_training(
    square: Path, tmp_path: Path, fails: Callable[..., str], instant_training: list[Surface]
) -> None:
    foreign = text_file(tmp_path, "square.glb", "mine")
    assert "--force" in fails(2, "unwrap", square, "-o", tmp_path, *QUICK)
    assert foreign.read_text(encoding="utf-8") == "mine"
    assert instant_training == []


def test_the_input_is_never_overwritten(
    square: Path, fails: Callable[..., str], instant_training: list[Surface]
) -> None:
    assert "square.obj" in fails(2, "unwrap", square, "-o", square.parent, "--format", "obj", "--force", *QUICK)
    assert square.read_text(encoding="utf-8") == UV_SQUARE
    assert instant_training == []


def test_interrupting_ends_with_130_and_one_line(
    square: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, fails: Callable[..., str]
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "unwrap_asset", interrupt)
    assert "interrupted" in fails(130, "unwrap", square, "-o", tmp_path / "out")
    assert not list((tmp_path / "out").glob("*"))


def test_a_defect_keeps_its_traceback(square: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def defect(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(cli, "unwrap_asset", defect)
    with pytest.raises(ZeroDivisionError):
        main(["unwrap", str(square), "-o", str(tmp_path / "out")])


def test_preset_fast_needs_no_torch(square: Path) -> None:
    argv = ["unwrap", "square.obj", "-o", "out", "--maps", "none", "--no-preview", "--quiet"]
    code = f"import sys; sys.modules['torch'] = None; from flexpara.__main__ import main; sys.exit(main({argv!r}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=square.parent, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert (square.parent / "out" / "square.onnx").exists()


@pytest.mark.parametrize(
    ("absent", "argv", "extra"),
    [
        ("torch", ["unwrap", "square.obj", "-o", "out", "--preset", "paper"], "flexpara[train]"),
        ("igl", ["unwrap", "square.obj", "-o", "out", "--maps", "none", "--no-preview"], "flexpara[unwrap]"),
        ("moderngl", ["unwrap", "square.obj", "-o", "out", "--maps", "chart"], "flexpara[bake]"),
        ("moderngl", ["bake", "square.obj", "-o", "out", "--maps", "position"], "flexpara[bake]"),
        ("OpenImageIO", ["bake", "square.obj", "-o", "out", "--maps", "position"], "flexpara[bake]"),
    ],
)
def test_a_missing_dependency_ends_with_3_and_says_how_to_install_it(
    absent: str, argv: list[str], extra: str, square: Path
) -> None:
    code = f"import sys; sys.modules[{absent!r}] = None; from flexpara.__main__ import main; sys.exit(main({argv!r}))"
    done = subprocess.run([sys.executable, "-c", code], cwd=square.parent, capture_output=True, text=True, check=False)
    assert done.returncode == 3, done.stderr
    assert extra in done.stderr
    assert absent in done.stderr
    assert done.stderr.count("\n") == 1
    assert not (square.parent / "out").exists()


def test_doctor_marks_what_is_missing_and_ends_with_0(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["doctor"]) == 0
    report = capsys.readouterr().out
    for word in ("flexpara", "numpy", "torch", "CPU", "ONNX", "OpenGL"):
        assert word in report
    monkeypatch.setitem(sys.modules, "torch", None)
    assert main(["doctor"]) == 0
    assert 'pip install "flexpara[train]"' in capsys.readouterr().out
