"""Time over faces: meshes are made once, runs are kept, medians and ratios are what the table shows."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from benchmarks import speed
from benchmarks.corpus.processes import Ended
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path


@pytest.fixture
def calls(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The commands that would have been run."""
    asked: list[str] = []

    def pretended(command: list[str], _limit: float) -> Ended:
        asked.append(" ".join(command[1:5]))
        return Ended(0, 2.0, 3.0, 100.0, "", 0)

    monkeypatch.setattr(speed, "run", pretended)
    return asked


def test_a_scan_is_read_as_it_was_made(tmp_path: Path) -> None:
    ((path, faces),) = speed.prepared(tmp_path, 2000)
    surface = load_asset(path).surface
    assert len(surface.faces) == faces
    np.testing.assert_allclose(surface.vertices, speed.scan(speed.RESOLUTIONS[0])[0], atol=1e-7)


def test_what_was_run_is_not_run_again(tmp_path: Path, calls: list[str]) -> None:
    first = speed.measure(tmp_path, 2000, 2)
    assert len(calls) == len(first) == 6
    assert speed.measure(tmp_path, 2000, 2) == first
    assert len(calls) == 6
    assert len(speed.measure(tmp_path, 2000, 3)) == 9


def test_the_table_has_medians_and_ratios() -> None:
    rows: list[dict[str, object]] = [
        {"tool": tool, "faces": 9, "code": code, "seconds": cpu, "cpu": cpu, "mb": 50.0}
        for tool, code, cpu in (
            ("flexpara", 0, 1.0),
            ("flexpara", 0, 9.0),
            ("flexpara", 0, 2.0),
            ("flexpara", 1, 0.0),
            ("xatlas", 0, 4.0),
        )
    ]
    assert speed.table(rows).splitlines()[2:] == [
        "| 9 | flexpara | 2.0 | 2.0 | 0.50 | 50 |",
        "| 9 | xatlas | 4.0 | 4.0 | 1.00 | 50 |",
    ]
