"""Several meshes, folders of them, and meshes through standard input and output."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path

import numpy as np
import pytest

from flexpara.__main__ import main
from flexpara.runtime.cli.inputs import ending_of

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n"
QUICK = ["--size", "64", "--maps", "none", "--no-preview", "--quiet"]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    folder = tmp_path / "meshes"
    folder.mkdir()
    for name, text in (("b.obj", SQUARE), ("a.obj", SQUARE.replace("1 1 0", "2 1 0")), ("notes.txt", "no mesh")):
        (folder / name).write_text(text, encoding="utf-8")
    return folder


class Stream:
    """A text stream with bytes beneath, as standard input and output are."""

    def __init__(self, data: bytes = b"") -> None:
        self.buffer = io.BytesIO(data)

    def write(self, text: str) -> None:
        self.buffer.write(text.encode())

    def flush(self) -> None:
        """Nothing waits."""


@pytest.mark.usefixtures("instant_training")
def test_a_folder_stands_for_its_meshes(folder: Path, tmp_path: Path) -> None:
    assert main(["unwrap", str(folder), "-o", str(tmp_path / "out"), *QUICK]) == 0
    assert sorted(path.name for path in (tmp_path / "out").glob("*.glb")) == ["a.glb", "b.glb"]


@pytest.mark.usefixtures("instant_training")
def test_files_with_one_texel_density_have_it_all(folder: Path, tmp_path: Path) -> None:
    argv = ["unwrap", str(folder), "-o", str(tmp_path / "out"), "--size", "128", *QUICK[2:]]
    assert main([*argv, "--texel-density", "40"]) == 0
    reports = [json.loads(path.read_text(encoding="utf-8")) for path in (tmp_path / "out").glob("*.report.json")]
    dense = [report["metrics"]["texel_density_mean"] for report in reports]
    assert dense == pytest.approx([40.0, 40.0], rel=1e-4)


@pytest.mark.usefixtures("instant_training")
def test_a_mesh_that_fails_stops_none_of_the_others(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "a.obj").write_text("f 1 2 3\n", encoding="utf-8")
    paths = [str(folder / name) for name in ("a.obj", "b.obj")]
    assert main(["unwrap", *paths, "-o", str(tmp_path / "out"), *QUICK]) == 2
    assert "a.obj" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "out").glob("*.glb")] == ["b.glb"]


def test_two_meshes_of_one_name_and_folders_without_meshes_are_refused(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "a.off").write_text("OFF\n", encoding="utf-8")
    assert main(["unwrap", str(folder), "-o", str(tmp_path / "out")]) == 2
    assert "under one name" in capsys.readouterr().err
    assert main(["unwrap", str(tmp_path), "-o", str(tmp_path / "out")]) == 2
    assert "holds no mesh" in capsys.readouterr().err


@pytest.mark.usefixtures("instant_training")
def test_a_mesh_goes_through_standard_input_and_output(monkeypatch: pytest.MonkeyPatch) -> None:
    out = Stream()
    monkeypatch.setattr(sys, "stdin", Stream(SQUARE.encode()))
    monkeypatch.setattr(sys, "stdout", out)
    assert main(["unwrap", "-", "-o", "-", "--format", "npz", "--size", "64", "--quiet"]) == 0
    out.buffer.seek(0)
    with np.load(out.buffer) as arrays:
        assert set(arrays) == {"positions", "faces", "uv", "charts", "normals", "source_vertex", "polygons"}
        assert arrays["polygons"].tolist() == [0, 0]
        assert arrays["uv"].dtype == np.float32


def test_what_no_stream_holds_is_refused(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["unwrap", "a.obj", "-o", "-", "--format", "gltf"]) == 2
    assert "one mesh and one file" in capsys.readouterr().err
    monkeypatch.setattr(sys, "stdin", Stream())
    assert main(["unwrap", "-", "-o", "out"]) == 2
    assert "standard input is empty" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("data", "ending"),
    [
        (b"glTF\x02\0\0\0", ".glb"),
        (b"ply\nformat ascii 1.0\n", ".ply"),
        (b'\xef\xbb\xbf {"asset": {}}', ".gltf"),
        (b"OFF\n3 1 0\n", ".off"),
        (b"solid by hand\n", ".stl"),
        (b"solid but binary".ljust(80, b"\0") + b"\1\0\0\0" + bytes(50), ".stl"),
        (b"# obj\nv 0 0 0\n", ".obj"),
    ],
)
def test_a_format_is_known_by_how_it_begins(data: bytes, ending: str) -> None:
    assert ending_of(data) == ending
