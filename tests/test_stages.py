"""The stages on their own: train then export is unwrap; a run that was cut short is resumed."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest

from flexpara import __main__ as cli
from flexpara.__main__ import main

if TYPE_CHECKING:
    from pathlib import Path

    from flexpara.runtime.mesh import Surface

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"
QUIET = ["--no-preview", "--quiet"]


@pytest.fixture
def square(tmp_path: Path) -> Path:
    path = tmp_path / "square.obj"
    path.write_text(SQUARE, encoding="utf-8")
    return path


@pytest.mark.usefixtures("instant_training")
def test_train_then_export_writes_what_unwrap_writes(square: Path, tmp_path: Path) -> None:
    assert main(["unwrap", str(square), "-o", str(tmp_path / "one"), "--maps", "none", "--size", "64", *QUIET]) == 0
    assert main(["train", str(square), "-o", str(tmp_path / "half"), "--quiet"]) == 0
    trained = tmp_path / "half" / "square.trained.safetensors"
    words = ["--maps", "none", "--size", "64", *QUIET]
    assert main(["export", str(trained), str(square), "-o", str(tmp_path / "two"), *words]) == 0
    for name in ("square.onnx", "square.glb"):
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    report = json.loads((tmp_path / "half" / "square.train.json").read_text(encoding="utf-8"))
    assert report["files"] == ["square.train.json", "square.trained.safetensors"]


@pytest.mark.usefixtures("instant_training")
def test_the_export_of_another_mesh_is_refused(
    square: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["train", str(square), "-o", str(tmp_path), "--quiet"]) == 0
    other = tmp_path / "other.obj"
    other.write_text(SQUARE.replace("1 1 0", "1 2 0"), encoding="utf-8")
    trained = tmp_path / "square.trained.safetensors"
    assert main(["export", str(trained), str(other), "-o", str(tmp_path / "out"), *QUIET]) == 2
    assert "another mesh" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_the_inverse_is_written_on_request(square: Path, tmp_path: Path, instant_training: list[Surface]) -> None:
    argv = ["unwrap", str(square), "-o", str(tmp_path / "out"), "--maps", "none", "--size", "64", "--inverse", *QUIET]
    assert main(argv) == 0
    assert len(instant_training) == 1
    assert (tmp_path / "out" / "square.wrap.onnx").stat().st_size > 1000
    report = json.loads((tmp_path / "out" / "square.report.json").read_text(encoding="utf-8"))
    assert report["inverse"]["rms"] < 0.01


def test_a_run_that_is_cut_short_is_resumed_with_its_own_options(
    square: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def interrupted(_asset: object, options: object, _progress: object, keep: object) -> None:
        seen.append((options, keep))
        raise KeyboardInterrupt

    monkeypatch.setattr(cli, "unwrap_asset", interrupted)
    out = tmp_path / "out"
    paper = ["--preset", "paper", "--mode", "global", "--steps", "9", "--width", "16", "--points", "64"]
    paper += ["--checkpoint-every", "4"]
    assert main(["unwrap", str(square), "-o", str(out), "--maps", "none", *paper, *QUIET]) == 130
    assert main(["unwrap", "--resume", str(out), "--quiet"]) == 130
    assert seen[0] == seen[1]
    assert seen[0][1] == (out / "square.checkpoint", 4)


@pytest.mark.parametrize("words", [["--charts", "3"], ["--maps", "none"], ["mesh.obj"], ["--checkpoint-every", "4"]])
def test_a_resumed_run_takes_no_other_options(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["unwrap", *words, "--resume", str(tmp_path)]) == 2
    assert "resume beside other options" in capsys.readouterr().err


def test_nothing_to_resume_ends_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["unwrap", "--resume", str(tmp_path)]) == 2
    assert "no run to resume" in capsys.readouterr().err


@pytest.mark.parametrize("green", [["--target", "unreal"], ["--normal-format", "directx"]])
def test_usd_does_not_name_normal_maps_that_point_the_other_way(
    green: list[str],
    square: Path,
    tmp_path: Path,
    instant_training: list[Surface],
    capsys: pytest.CaptureFixture[str],
) -> None:
    argv = ["unwrap", str(square), "-o", str(tmp_path / "out"), "--format", "usda", "--size", "64", *green, *QUIET]
    assert main(argv) == 2
    assert "expected opengl" in capsys.readouterr().err
    assert instant_training == []
