"""The frontier's table resumes where it was cut off, judges a layout, and draws what it has."""

from __future__ import annotations

from typing import TYPE_CHECKING
from xml.etree import ElementTree

import numpy as np
import pytest

import benchmarks.frontier.__main__ as frontier
from benchmarks.frontier.plot import Axis, drawn
from benchmarks.frontier.quality import quality_of
from benchmarks.frontier.verdicts import beaten_by, rises, sentences

if TYPE_CHECKING:
    from pathlib import Path

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n"
ROW = {"charts": 2, "stretch": 1.01, "seam": 3.0, "said": ""}


def made(tool: str, **facts: object) -> frontier.Row:
    """A row of a tool."""
    return {"mesh": "egg", "tool": tool, "seconds": 1.0, **ROW, **facts}


def test_what_was_run_is_not_run_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = tmp_path / "square.obj"
    mesh.write_text(SQUARE)
    asked: list[str] = []

    def pretended(path: Path, tool: str, _arguments: object) -> frontier.Row:
        asked.append(tool)
        return {"mesh": path.stem, "tool": tool, "seconds": 1.0, **ROW}

    monkeypatch.setattr(frontier, "row_of", pretended)
    words = [str(mesh), "-o", str(tmp_path / "out"), "--settings", "default,one chart; 1.025"]
    for _ in range(2):
        assert frontier.main(words) == 0
    assert asked == ["xatlas", "uvunwrap", "default", "one chart, 1.025"]
    results = tmp_path / "out" / "results.jsonl"
    results.write_text(results.read_text()[:-20])
    frontier.main(words)
    assert asked[4:] == ["one chart, 1.025"]
    assert (tmp_path / "out" / "square.svg").is_file()


def test_no_row_is_begun_once_time_is_up_and_the_next_run_begins_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mesh, asked = tmp_path / "square.obj", list[str]()
    mesh.write_text(SQUARE)
    monkeypatch.setattr(frontier, "row_of", lambda path, tool, _: asked.append(tool) or made(tool, mesh=path.stem))
    words = [str(mesh), "-o", str(tmp_path / "out"), "--settings", "default", "--peers", "xatlas"]
    now = iter([0.0, 0.0, 9.0, 0.0, 0.0])
    monkeypatch.setattr(frontier, "monotonic", lambda: next(now))
    assert frontier.main([*words, "--for", "5"]) == 3
    assert asked == ["xatlas"]
    assert frontier.main([*words, "--for", "5"]) == 0
    assert asked == ["xatlas", "default"]


def test_a_peer_is_beaten_by_a_shorter_seam_at_no_more_distortion() -> None:
    rows = [made("xatlas", stretch=1.01, seam=5.0), made("longer", stretch=1.0, seam=6.0)]
    rows += [made("stretched", stretch=1.02, seam=1.0), made("better", stretch=1.01, seam=4.0)]
    assert beaten_by(rows, "xatlas", ("xatlas",)) == ["better"]
    assert sentences("egg", rows[:3], ("xatlas", "uvunwrap")) == ["- egg, xatlas: beaten by no setting"]
    assert beaten_by([made("xatlas", said="exit 1"), *rows[1:]], "xatlas", ("xatlas",)) == []


def test_more_charts_that_cost_more_are_named() -> None:
    costs = {"charts 4": 0.03, "one chart": 0.05, "default": 0.0312, "charts 16": 0.031}
    rows = [made(tool, objective=cost) for tool, cost in costs.items()]
    ((few, more, by),) = rises(rows)
    assert (few, more) == (4, 8)
    assert by == pytest.approx(0.0012)
    assert sentences("egg", rows, ()) == ["- egg, 4 limits on charts: 8 charts cost 0.0012 more than 4"]
    assert sentences("egg", rows[:2], ()) == ["- egg, 2 limits on charts: more charts never cost more"]


def test_a_layout_is_judged_without_an_evaluator_from_outside(tmp_path: Path) -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    np.savez(tmp_path / "layout.npz", vertices=vertices, faces=faces, corner_uv=vertices[faces][..., :2])
    found = quality_of(tmp_path / "layout.npz", "none")
    assert (found["charts"], found["flips"], found["seam"]) == (1, 0, 0.0)
    assert found["stretch"] == pytest.approx(1.0)
    assert "jaggedness" not in found


def test_a_plot_is_well_formed_and_has_a_point_for_each_row() -> None:
    rows = [{"tool": "a & b", **ROW}, {"tool": "xatlas", **ROW, "stretch": 1.0, "seam": 0.0}]
    svg = ElementTree.fromstring(drawn("mesh", rows))
    assert len(svg.findall("{*}circle")) == 2


def test_an_axis_counts_in_ones_twos_and_fives() -> None:
    assert Axis([0.9, 11.0], 0.0, 1.0).ticks() == [1.0, 2.0, 5.0, 10.0]


def test_an_unknown_setting_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        frontier.parse(["--settings", "best"])
    assert "no setting or peer best" in capsys.readouterr().err
