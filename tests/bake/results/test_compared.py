"""Unwraps compared: a sheet, a table and a page, over those of the last time and never over a file of anybody else."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

import flexpara
from flexpara.__main__ import main

pytest.importorskip("igl")
pytest.importorskip("moderngl")


@pytest.fixture
def mesh(tmp_path: Path) -> Path:
    lines = ["v 0 0 0", "v 1 0 0", "v 0 1 0", "v 0 0 1", "f 1 3 2", "f 1 2 4", "f 2 3 4", "f 3 1 4"]
    path = tmp_path / "mesh.obj"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def compare(mesh: Path, *words: str) -> int:
    return main(["unwrap", str(mesh), "-o", str(mesh.parent / "out"), "--compare", *words, "--size", "64"])


def test_sheet_table_and_page_are_written_and_replace_those_of_the_last_time(mesh: Path) -> None:
    assert compare(mesh, "1,auto", "--report") == 0
    out = mesh.parent / "out"
    assert sorted(path.name for path in out.iterdir()) == [f"mesh.compare.{end}" for end in ("html", "json", "png")]
    page = (out / "mesh.compare.html").read_text(encoding="utf-8")
    assert all(words in page for words in ("mesh, charts compared", "at most 1", "at most auto"))
    assert (out / "mesh.compare.png").read_bytes().startswith(b"\x89PNG")
    rows = json.loads((out / "mesh.compare.json").read_text(encoding="utf-8"))["compared"]
    assert [row["asked"] for row in rows] == [1, "auto"]
    assert compare(mesh, "2") == 0


def test_a_file_of_anybody_else_is_refused_before_the_work(mesh: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def work(*_: object) -> None:
        raise AssertionError("the work was begun")

    monkeypatch.setattr("flexpara.__main__.unwrap_asset", work)
    theirs = mesh.parent / "out" / "mesh.compare.png"
    theirs.parent.mkdir()
    theirs.write_bytes(b"theirs")
    assert compare(mesh, "1,2") == 2
    assert theirs.read_bytes() == b"theirs"


def test_a_result_is_shown_in_a_line() -> None:
    points, faces = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]])
    result = flexpara.unwrap((points, faces), size=64)
    assert repr(result) == "UnwrapResult('mesh', 1 faces: 1 charts of mean stretch 1.0000)"
    assert "faces=int64 (1, 3)" in repr(result.atlas)
    assert len(repr(result.asset)) < 600
