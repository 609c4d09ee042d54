"""Systems run in processes of their own: they end in time, say why they didn't run, and give uv of the same faces."""

from __future__ import annotations

import importlib.util
import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks import systems
from benchmarks.systems import Answer, Job, by_flexpara, in_time, on_shelves, run
from flexpara.runtime.errors import FinishError, FlexparaError, InputError, MissingFileError
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.mesh import Surface


def bent_sheet(rows: int = 12, columns: int = 18) -> tuple[Surface, NDArray[np.float64]]:
    """A quarter of a cylinder's side, developable, and its exact uv per corner."""
    angle, height = np.meshgrid(np.linspace(0, np.pi / 2, columns + 1), np.linspace(0, 1, rows + 1))
    xyz = np.stack([np.cos(angle), np.sin(angle), height], axis=-1).reshape(-1, 3)
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    above = first + columns + 1
    faces = np.concatenate([np.stack([first, first + 1, above + 1], 1), np.stack([first, above + 1, above], 1)])
    uv = np.stack([angle, height], axis=-1).reshape(-1, 2)
    return Surface(xyz, faces), uv[faces]


def in_halves(corner_uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """The same uv cut into two charts along the middle of u."""
    right = corner_uv[..., 0].mean(axis=1) > np.pi / 4
    return corner_uv + np.where(right, 1.0, 0.0)[:, None, None] * np.array([1.0, 0.0])


def test_a_peer_unwraps_the_faces_it_is_given(tmp_path: Path) -> None:
    surface, _ = bent_sheet()
    outcome = run(Job("xatlas"), surface, 60.0, tmp_path)
    assert (outcome.status, outcome.why) == ("done", "")
    assert outcome.answer is not None
    assert outcome.answer.seconds > 0.0
    found = measure(surface, outcome.answer.corner_uv)
    assert found.flipped_faces == 0
    assert found.conformal_mean < 0.01


def test_slim_keeps_the_seams_and_flattens_what_is_developable(tmp_path: Path) -> None:
    pytest.importorskip("igl")
    surface, exact = bent_sheet()
    outcome = run(Job("slim"), surface, 60.0, tmp_path, in_halves(exact))
    assert outcome.answer is not None, outcome.why
    before, after = measure(surface, in_halves(exact)), measure(surface, outcome.answer.corner_uv)
    assert after.charts == before.charts == 2
    assert after.seam_edges == before.seam_edges > 0
    assert (after.flipped_faces, after.overlap_fraction) == (0, 0.0)
    assert after.symmetric_dirichlet_mean < 1.001
    assert after.conformal_mean < 0.02


def test_boxes_on_shelves_lie_apart_in_about_a_square() -> None:
    size = np.random.default_rng(0).uniform(0.1, 1.0, (40, 2))
    low = on_shelves(size)
    high = low + size
    apart = (low[:, None] >= high[None]) | (high[:, None] <= low[None])
    assert (apart.any(axis=2) | np.eye(40, dtype=bool)).all()
    width, height = high.max(axis=0) - low.min(axis=0)
    assert 0.6 < width / height < 1.7
    assert size.prod(axis=1).sum() > 0.6 * width * height
    np.testing.assert_array_equal(on_shelves(np.array([[2.0, 1.0]])), [[0.0, 0.0]])


def test_slim_without_seams_is_not_run(tmp_path: Path) -> None:
    outcome = run(Job("slim"), bent_sheet()[0], 60.0, tmp_path)
    assert outcome.status == "not run"
    assert "run flexpara as well" in outcome.why


def test_a_budget_that_ran_out_gives_no_number(tmp_path: Path) -> None:
    outcome = run(Job("xatlas"), bent_sheet()[0], 0.01, tmp_path)
    assert (outcome.status, outcome.answer) == ("incomplete", None)
    assert "0.01 s" in outcome.why


def test_an_old_result_is_not_taken_for_a_new_one(tmp_path: Path) -> None:
    surface = bent_sheet()[0]
    assert run(Job("xatlas"), surface, 60.0, tmp_path).status == "done"
    assert run(Job("xatlas"), surface, 0.01, tmp_path).status == "incomplete"


def test_what_the_process_started_ends_with_it(tmp_path: Path) -> None:
    alive = tmp_path / "alive"
    child = f"import time, pathlib; time.sleep(1.5); pathlib.Path({str(alive)!r}).touch()"
    parent = f"import subprocess, sys; subprocess.run([sys.executable, '-c', {child!r}])"
    assert in_time([sys.executable, "-c", parent], 0.5) == (None, "")
    assert in_time([sys.executable, "-c", "import time; time.sleep(2)"], 10.0) == (0, "")
    assert not alive.exists()


def test_the_last_line_of_a_process_that_dies_is_kept() -> None:
    code = "import sys; sys.stderr.write('one\\n'); raise SystemExit('boom')"
    assert in_time([sys.executable, "-c", code], 10.0) == (1, "boom")


def test_a_process_without_a_result_has_failed(tmp_path: Path) -> None:
    outcome = run(Job("xatlas", python="/bin/false"), bent_sheet()[0], 10.0, tmp_path)
    assert (outcome.status, outcome.answer) == ("failed", None)
    assert "ended with 1" in outcome.why


def test_an_interpreter_that_is_not_there_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no program, expected a Python interpreter"):
        run(Job("smart-uv", python=str(tmp_path / "python")), bent_sheet()[0], 10.0, tmp_path)


def test_a_mode_that_a_system_has_not_is_not_run(tmp_path: Path) -> None:
    outcome = run(Job("uvunwrap", mode="global"), bent_sheet()[0], 10.0, tmp_path)
    assert (outcome.status, outcome.why) == ("not run", "uvunwrap has no global mode")


@pytest.mark.skipif(importlib.util.find_spec("bpy") is not None, reason="bpy is there")
def test_smart_uv_without_blender_says_how_to_get_it(tmp_path: Path) -> None:
    outcome = run(Job("smart-uv"), bent_sheet()[0], 30.0, tmp_path)
    assert outcome.status == "not run"
    assert "--blender-python" in outcome.why


def test_a_preset_that_flexpara_has_not_is_an_input_error() -> None:
    with pytest.raises(InputError, match="'nonsense'"):
        by_flexpara(Job("flexpara", preset="nonsense"), bent_sheet()[0], None)


@pytest.mark.parametrize(
    ("error", "status"), [(InputError("no such preset"), "not run"), (FinishError("no\natlas"), "failed")]
)
def test_refusals_are_not_run_and_defects_have_failed(
    error: FlexparaError, status: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(_job: Job, _surface: Surface, _seams: NDArray[np.float64] | None) -> Answer:
        raise error

    monkeypatch.setitem(systems.SYSTEMS, "flexpara", refuse)
    task, given, result = tmp_path / "job.json", tmp_path / "surface.npz", tmp_path / "result.npz"
    task.write_text(json.dumps(asdict(Job("flexpara"))))
    np.savez(given, vertices=np.zeros((3, 3)), faces=np.array([[0, 1, 2]]), seams=np.zeros((0, 3, 2)))
    systems.main(str(task), str(given), str(result))
    with np.load(result) as found:
        assert str(found["status"]) == status
        assert str(found["why"]) == " ".join(str(error).split())
