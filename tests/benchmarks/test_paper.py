"""The harness runs what it is asked for, sets the paper's figures beside, and prints no number that wasn't measured."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks import paper
from benchmarks.paper_markdown import QUANTITIES, beside, comparisons, plain, table
from benchmarks.systems import Answer, Job, Outcome
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.mesh import Surface

TETRAHEDRON = (
    np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
)
APART: NDArray[np.float64] = np.array([[0, 0], [1, 0], [0, 1.0]], np.float64) + np.arange(0.0, 8.0, 2.0)[:, None, None]
RAW = {
    "all": {"conformal_mean": 0.5, "isometric_mean": None, "faces": 9},
    "off_seam": {"conformal_mean": 0.0567, "isometric_mean": 7e-4},
}
REPORT = {"train": {"raw": {**RAW, "cut_points": 0.1}}}


class FakeRun:
    """Stands for `benchmarks.systems.run`: flexpara is done with raw figures, the others as told; it keeps the jobs."""

    def __init__(self, **statuses: str) -> None:
        self.statuses = statuses
        self.jobs = list[tuple[Job, bool]]()

    def __call__(
        self, job: Job, _surface: Surface, _budget: float, _folder: Path, seams: NDArray[np.float64] | None = None
    ) -> Outcome:
        self.jobs.append((job, seams is not None))
        status = self.statuses.get(job.system, "done")
        if status != "done":
            return Outcome(status, "for a reason")
        return Outcome("done", "", Answer(APART, 12.5, REPORT if job.system == "flexpara" else {"blender": "5"}))


def arguments_for(tmp_path: Path, *more: str) -> Any:
    """The parsed command line for one mesh file."""
    mesh = tmp_path / "bunny.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n")
    return paper.parse(["--models", str(mesh), *more])


def rows_with(run: FakeRun, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, *more: str) -> list[dict[str, Any]]:
    """Rows of a tetrahedron by the name of bunny."""
    monkeypatch.setattr(paper, "run", run)
    asset = asset_from_arrays(*TETRAHEDRON, stem="bunny")
    ended = list(paper.outcomes_of(asset, arguments_for(tmp_path, *more)))
    return paper.with_ratios([paper.row_of(job, asset, outcome) for job, outcome in ended])


def test_slim_gets_the_seams_of_flexpara_of_the_same_mode(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run = FakeRun()
    rows = rows_with(run, monkeypatch, tmp_path, "--systems", "slim,flexpara")
    assert [(job.system, job.mode, seams) for job, seams in run.jobs] == [
        ("flexpara", "multi-chart", False),
        ("slim", "multi-chart", True),
        ("flexpara", "global", False),
        ("slim", "global", True),
    ]
    assert len(rows) == 4


def test_slim_alone_runs_flexpara_without_a_row(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run = FakeRun()
    rows = rows_with(run, monkeypatch, tmp_path, "--systems", "slim", "--modes", "global")
    assert [job.system for job, _ in run.jobs] == ["flexpara", "slim"]
    assert [row["system"] for row in rows] == ["slim"]


def test_what_is_asked_for_reaches_flexpara(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    run = FakeRun()
    rows_with(run, monkeypatch, tmp_path, "--preset", "paper", "--steps", "7", "--charts", "3", "--seed", "5")
    job = run.jobs[0][0]
    assert (job.preset, job.steps, job.charts, job.seed) == ("paper", 7, 3, 5)
    rows_with(run, monkeypatch, tmp_path, "--precision", "bfloat16", "--width", "64")
    assert (run.jobs[-1][0].precision, run.jobs[-1][0].width) == ("bfloat16", 64)


def test_an_ablation_runs_in_its_own_mode_and_gives_slim_no_seams(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    run = FakeRun(slim="not run")
    rows = rows_with(run, monkeypatch, tmp_path, "--systems", "slim,flexpara", "--ablations", "no-upper,bidirectional")
    order = [(job.mode, job.system, job.ablation) for job, _ in run.jobs]
    assert order == [
        ("multi-chart", "flexpara", ""), ("multi-chart", "flexpara", "bidirectional"), ("multi-chart", "slim", ""),
        ("global", "flexpara", ""), ("global", "flexpara", "no-upper"), ("global", "slim", ""),
    ]  # fmt: skip
    assert any("| **flexpara** fast no-upper |" in line for line in table("global", rows).splitlines())


def test_the_papers_ablations_have_lines_of_their_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    rows = [row | {"mesh": "bird"} for row in rows_with(FakeRun(), monkeypatch, tmp_path, "--modes", "global")]
    lines = [line for line in table("global", rows).splitlines() if "paper: FlexPara" in line]
    assert len(lines) == 1 + 5
    cells = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines]
    assert [row[2] for row in cells] == ["0.0371", "0.0250", "0.0340", "0.2800", "0.0270", "0.1290"]
    assert {row[-1] for row in cells[1:]} == {"Table 6"}


def test_systems_without_a_global_mode_have_no_row_there(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    rows = rows_with(FakeRun(), monkeypatch, tmp_path)
    assert [row["system"] for row in rows if row["mode"] == "global"] == ["flexpara", "slim"]
    assert len(rows) == 7


def test_the_papers_figures_stand_beside_those_of_the_same_system(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    rows = rows_with(FakeRun(), monkeypatch, tmp_path)
    found = {(item["mode"], item["system"], item["quantity"]): item for item in comparisons(rows)}
    assert found["global", "flexpara", "conformality"]["paper"] == 0.0634
    assert found["multi-chart", "xatlas", "charts"] | {"label": ""} == {
        "table": "Table 4", "label": "", "model": "Bunny", "mode": "multi-chart", "paper_system": "xatlas",
        "system": "xatlas", "ablation": "", "quantity": "charts", "paper": 47.0, "measured": 4, "raw": {},
        "comparable": True,
    }  # fmt: skip
    assert not found["multi-chart", "flexpara", "seam_length"]["comparable"]
    assert len(found) == 2 + 2 + 3 * 4
    assert found["global", "flexpara", "conformality"]["raw"] == {"all": 0.5, "off_seam": 0.0567}


def test_figure_by_figure_only_what_agrees_in_definition(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    text = beside(rows_with(FakeRun(), monkeypatch, tmp_path))
    assert "| 0.0634 | 0.2182 | 3.44 | 0.5000 all, 0.0567 off seam |" in text
    assert "| Table 2 | Bunny | global | flexpara | seconds | 405.00 | 12.50 | 0.03 |  |" in text
    assert not any(quantity.heading in text for quantity in QUANTITIES.values() if not quantity.comparable)
    assert "None: no run" in beside(
        rows_with(FakeRun(flexpara="failed"), monkeypatch, tmp_path, "--systems", "flexpara")
    )


def test_a_run_that_is_not_done_has_no_number(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    rows = rows_with(FakeRun(flexpara="incomplete", xatlas="not run"), monkeypatch, tmp_path)
    row = next(row for row in rows if row["system"] == "flexpara")
    assert not {"metrics", "seconds"} & set(row)
    line = next(line for line in table("global", rows).splitlines() if "**flexpara**" in line)
    assert not any(character.isdigit() for character in line)
    assert "incomplete: for a reason" in line
    assert "flexpara" not in {item["system"] for item in comparisons(rows)}
    assert {row["isometric_ratio"] for row in rows} == {None}


def test_raw_figures_have_a_line_of_their_own(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    lines = table("global", rows_with(FakeRun(), monkeypatch, tmp_path, "--modes", "global")).splitlines()
    raw = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if "raw" in line]
    assert [cells[2:10] for cells in raw] == [["0.5000", *[""] * 7], ["0.0567", "7.0", *[""] * 6]]
    assert "left out" in raw[1][-1]
    assert any("finished atlas" in line for line in lines)


def test_raw_figures_are_found_where_the_report_has_them() -> None:
    assert paper.raw_figures(REPORT) == RAW
    assert paper.raw_figures({"train": {"paper": REPORT["train"]}}) == RAW
    assert paper.raw_figures({"train": {}}) == paper.raw_figures({}) == {}


def test_the_lines_of_a_table_have_one_number_of_cells(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    rows = rows_with(FakeRun(slim="failed"), monkeypatch, tmp_path)
    rows += [row | {"mesh": "unheard-of"} for row in rows]
    for mode in ("global", "multi-chart"):
        assert len({line.count("|") for line in table(mode, rows).splitlines()}) == 1


def test_the_papers_ratio_to_xatlas_is_printed(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    lines = table("multi-chart", rows_with(FakeRun(), monkeypatch, tmp_path)).splitlines()
    cells = [cell.strip() for cell in next(line for line in lines if "paper: FlexPara" in line).split("|")[1:-1]]
    assert cells == ["bunny", "paper: FlexPara", "", "6.4", "1.14", "", "8", "29.42", "1371.00", "", "", "Table 4"]


def test_settings_are_printed_plainly() -> None:
    assert [plain(value) for value in (600.0, ("a", "b"), (), "fast", 8)] == ["600", "a+b", "none", "fast", "8"]


def test_only_what_the_paper_defines_is_called_comparable() -> None:
    marked = {name for name, quantity in QUANTITIES.items() if "†" in quantity.heading}
    assert marked == {name for name, quantity in QUANTITIES.items() if not quantity.comparable}
    assert marked == {"isometric", "equiareal", "seam_length"}


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("--systems", "xatlas,optcuts"), "expected some of flexpara"),
        (("--systems", ","), "expected some of flexpara"),
        (("--modes", "local"), "expected some of multi-chart,global"),
        (("--ablations", "no-luck"), "expected some of no-triangle"),
        (("--budget", "0"), "more than 0 seconds"),
    ],
)
def test_a_wrong_word_ends_the_program(
    words: tuple[str, str], complaint: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit, match="2"):
        arguments_for(tmp_path, *words)
    assert complaint in capsys.readouterr().err


def test_a_folder_without_meshes_ends_the_program(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit, match="2"):
        paper.parse(["--models", str(tmp_path)])
    assert "no mesh at" in capsys.readouterr().err


def test_a_whole_run_prints_and_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments_for(tmp_path)
    answer = tmp_path / "answer.json"
    mesh = str(tmp_path / "bunny.obj")
    assert paper.main(["--models", mesh, "--systems", "xatlas,slim", "--preset", "none", "--json", str(answer)]) == 0
    printed = capsys.readouterr()
    assert "bunny · multi-chart · xatlas" in printed.err
    assert "| bunny | xatlas |" in printed.out
    assert "not run: no seams of flexpara" in printed.out
    written = json.loads(answer.read_text())
    assert {"cpu", "cores", "commit", "device", "date", "versions", "settings"} <= set(written["about"])
    assert [row["status"] for row in written["rows"]] == ["done", "not run", "not run"]
    assert sum(entry["figures"] for entry in written["not_run"]) + len(written["comparisons"]) == 491
