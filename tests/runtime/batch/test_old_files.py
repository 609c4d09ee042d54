"""A batch's folder that 0.1.0 wrote, kept here: `format_1`, a cube that was unwrapped and a file that was refused."""

from __future__ import annotations

import hashlib
import shutil
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.report.gather import results_in
from flexpara.runtime.batch.manifest import read_entries
from flexpara.runtime.batch.status import page_of, status_of
from flexpara.runtime.errors import ForeignFileError
from flexpara.runtime.files import OutputFolder
from flexpara.runtime.sessions.session import UnwrapSession

OLD = Path(__file__).parent / "format_1"


def test_its_manifest_is_read_and_its_hashes_are_those_of_its_files() -> None:
    found = read_entries(OLD / "manifest.jsonl")
    assert {name: entry.status for name, entry in found.items()} == {"cube.obj": "done", "words.obj": "failed"}
    for name, told in found["cube.obj"].files.items():
        assert hashlib.sha256((OLD / "cube" / name).read_bytes()).hexdigest() == told


def test_its_status_and_page_are_shown() -> None:
    status = status_of(OLD)
    assert status.lines()[:4] == ["assets    2", "done      1", "failed    1", "left      0"]
    assert "1 of 2 done" in page_of(OLD, status)


def test_its_report_is_shown_and_says_which_files_may_be_replaced(tmp_path: Path) -> None:
    assert len(results_in([OLD / "cube" / "cube.report.json"])) == 1
    folder = Path(shutil.copytree(OLD / "cube", tmp_path / "cube"))
    OutputFolder(folder, "cube").check(["cube.glb", "cube.onnx"])
    (folder / "cube.obj").write_text("", encoding="utf-8")
    with pytest.raises(ForeignFileError):
        OutputFolder(folder, "cube").check(["cube.obj"])


def test_its_onnx_file_answers_as_it_did() -> None:
    points = np.array([[0.5, 0.5, 0.0], [0.5, 0.5, 1.0], [1.0, 0.5, 0.5]])
    answer = UnwrapSession(OLD / "cube" / "cube.onnx").unwrap(points)
    assert answer.chart.tolist() == [0, 0, 0]
    expected = [[0.17003362, 0.17003363], [0.81891763, 0.17003365], [0.49447563, 0.17003363]]
    assert answer.uv == pytest.approx(np.array(expected), abs=1e-5)
