"""Time over faces: meshes are made once, runs are kept, medians and ratios are what the table shows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from benchmarks.corpus.processes import Ended
from benchmarks.speed import __main__ as speed
from benchmarks.speed.cases import Case, cases, gyroid, make_finer, sampled, scan
from benchmarks.speed.curves import drawn
from flexpara.runtime.geometry.topology import euler_characteristic, is_manifold
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.samples import make_sample

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
    monkeypatch.setattr(speed, "quality", lambda _tool, _path: {"charts": 7, "stretch": 1.01})
    return asked


def row(tool: str, code: int, cpu: float, faces: int = 9) -> dict[str, Any]:
    facts = {"family": "scan", "name": f"scan{faces}", "faces": faces, "charts": 7, "stretch": 1.01}
    return {**facts, "tool": tool, "code": code, "seconds": cpu, "cpu": cpu, "mb": 50.0}


def test_a_scan_is_read_as_it_was_made(tmp_path: Path) -> None:
    first = next(cases(tmp_path, None, 2000))
    surface = load_asset(first.path).surface
    assert (first.family, len(surface.faces)) == ("scan", first.faces)
    np.testing.assert_allclose(surface.vertices, scan(48)[0], atol=1e-7)


def test_a_gyroid_is_closed_and_has_tunnels() -> None:
    pytest.importorskip("skimage")
    _, faces = gyroid(24)
    assert is_manifold(faces)
    assert euler_characteristic(faces) < 0


def test_a_finer_mesh_has_the_same_shape() -> None:
    vertices, faces = make_sample("torus", resolution=8)
    finer = make_finer(vertices, faces)
    assert len(finer[1]) == 4 * len(faces)
    assert is_manifold(finer[1])
    assert euler_characteristic(finer[1]) == 0
    corners = finer[0][finer[1]]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).reshape(4, -1, 3)
    assert np.allclose(normal, normal[:1])


def test_points_lie_near_the_mesh_that_they_are_drawn_on() -> None:
    points = sampled(make_sample("sphere", resolution=32), 5000)
    radius = np.linalg.norm(points, axis=1)
    assert abs(radius / np.median(radius) - 1.0).max() < 0.1
    assert np.abs(points.mean(axis=0)).max() < 0.05


def test_what_was_run_is_not_run_again(tmp_path: Path, calls: list[str]) -> None:
    wanted = [Case("scan", tmp_path / "scan48.obj", 1280), Case("cloud", tmp_path / "cloud9.npy", 9)]
    first = speed.measure(tmp_path, wanted, 2)
    assert len(calls) == len(first) == 8  # clouds are for flexpara alone
    assert speed.measure(tmp_path, wanted, 2) == first
    assert len(speed.measure(tmp_path, wanted, 3)) == 12
    assert len(calls) == 12


def test_no_run_begins_when_it_is_late(tmp_path: Path, calls: list[str]) -> None:
    wanted = [Case("scan", tmp_path / "scan48.obj", 1280)]
    assert len(speed.measure(tmp_path, wanted, 1, lambda: len(calls) == 2)) == 2
    assert len(speed.measure(tmp_path, wanted, 1)) == 3


def test_the_table_has_medians_and_ratios() -> None:
    rows = [row("flexpara", 0, 1.0), row("flexpara", 0, 9.0), row("flexpara", 0, 2.0), row("flexpara", 1, 0.0)]
    assert speed.table([*rows, row("xatlas", 0, 4.0)]).splitlines()[2:] == [
        "| scan9 | 9 | flexpara | 2.0 | 0.50 | 2.0 | 50 | 7 | 1.0100 | 3 |",
        "| scan9 | 9 | xatlas | 4.0 | 1.00 | 4.0 | 50 | 7 | 1.0100 | 1 |",
    ]


def test_a_plot_has_a_line_for_each_tool() -> None:
    rows = [row(tool, 0, faces / 100, faces) for tool in ("flexpara", "xatlas") for faces in (1000, 4000, 16000)]
    plot = drawn("seconds", rows, "seconds")
    assert plot.count("<polyline") == 2
    assert plot.count("<circle") == 6
    assert "flexpara, scan" in plot
