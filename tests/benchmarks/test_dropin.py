"""The table beside xatlas: what is handed over, and a run that was ended goes on."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from benchmarks.dropin import Kept, Mesh, level_set, measured

if TYPE_CHECKING:
    from pathlib import Path


def test_a_line_is_measured_once_and_known_to_the_next_run(tmp_path: Path) -> None:
    asked: list[str] = []
    for _ in range(2):
        kept = Kept(tmp_path / "table.json")
        assert kept.line("bunny", lambda: asked.append("bunny") or "| bunny |") == "| bunny |"
    assert asked == ["bunny"]
    assert Kept(tmp_path / "table.json").line("cow", lambda: "| cow |") == "| cow |"
    assert Kept(None).line("bunny", lambda: "| again |") == "| again |"


def test_a_level_set_has_about_the_faces_asked_for_and_edges_that_are_not_manifold() -> None:
    pytest.importorskip("skimage")
    mesh = level_set(20_000)
    assert 17_000 < len(mesh.faces) < 23_000
    sides = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    assert np.unique(sides, axis=0, return_counts=True)[1].max() > 2


def test_uv_are_measured_at_the_corners_they_were_given_for_whatever_cleaning_leaves_out() -> None:
    """Vertex 0 is of no face, one face has no area, and the last is the only one that is turned over."""
    corners = [[9.0, 9.0, 9.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]
    mesh = Mesh("square", np.array(corners), np.array([[1, 2, 3], [1, 1, 2], [1, 4, 3]]))
    uv = mesh.vertices[mesh.faces][:, :, :2]
    found = measured(mesh, uv)
    assert (found["charts"], found["seam_length"]) == (1, 0.0)
    assert found["symmetric_dirichlet_mean"] == pytest.approx(1.0)
