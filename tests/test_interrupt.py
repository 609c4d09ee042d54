"""A run that is interrupted, or out of time, at its beginning, in its search, or after it, still ends with an atlas."""

from __future__ import annotations

import json
import signal
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.__main__ import main
from flexpara.runtime.samples import make_sample
from flexpara.train.charts import charts

if TYPE_CHECKING:
    from pathlib import Path

QUICK = ("--maps", "none", "--format", "glb", "--no-preview", "--size", "256")


@pytest.fixture(scope="module")
def bumpy(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sphere with bumps, which nothing lays out without a search."""
    vertices, faces = make_sample("sphere", resolution=10)
    vertices = vertices * (1.0 + 0.15 * np.sin(5.0 * vertices).prod(axis=1, keepdims=True))
    lines = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()] + [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
    path = tmp_path_factory.mktemp("meshes") / "bumpy.obj"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def report_of(mesh: Path, out: Path, *words: str) -> dict[str, dict]:
    """The report of a run that has to end well."""
    assert main(["unwrap", str(mesh), "-o", str(out), *QUICK, *words]) == 0
    return json.loads((out / f"{mesh.stem}.report.json").read_bytes())


def assert_valid(report: dict[str, dict], told: str) -> None:
    metrics = report["metrics"]
    assert (metrics["flipped_faces"], metrics["overlap_fraction"]) == (0, 0.0)
    assert any(told in note for note in report["train"]["notes"])


@pytest.mark.parametrize("moment", ["split_parts", "best_search", "brought_back", "all_proven"])
def test_the_first_interrupt_ends_with_what_there_is(
    bumpy: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], moment: str
) -> None:
    plain = getattr(charts, moment)

    def interrupted(*arguments: object, **keywords: object) -> object:
        signal.raise_signal(signal.SIGINT)
        return plain(*arguments, **keywords)

    monkeypatch.setattr(charts, moment, interrupted)
    before = signal.getsignal(signal.SIGINT)
    assert_valid(report_of(bumpy, tmp_path, "--charts", "4"), "ended on request")
    assert "interrupt again to stop at once" in capsys.readouterr().err
    assert signal.getsignal(signal.SIGINT) is before


def test_a_budget_that_is_over_before_the_search_ends_with_what_there_is(bumpy: Path, tmp_path: Path) -> None:
    assert_valid(report_of(bumpy, tmp_path, "--time-budget", "0.001"), "by the time budget of 0.001 s")
