"""`unwrap --pages`: charts of one search on several pages, each with its own material, textures and ONNX file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.__main__ import main
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("moderngl")


@pytest.fixture
def boxes(tmp_path: Path) -> Path:
    """Two boxes, the second of three times the area."""
    second = trimesh.creation.box((1.7, 1.7, 1.7))
    second.apply_translation((4.0, 0.0, 0.0))
    path = tmp_path / "boxes.ply"
    trimesh.util.concatenate([trimesh.creation.box(), second]).export(path)
    return path


def test_two_pages_have_one_density_and_files_of_their_own(boxes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    argv = ["unwrap", str(boxes), "-o", str(out), "--pages", "2", "--maps", "chart", "--size", "128", "--no-preview"]
    assert main([*argv, "--quiet"]) == 0
    names = {entry.name for entry in out.iterdir()}
    assert {"boxes.glb", "boxes_1.onnx", "boxes_2.onnx", "boxes_1_chart.png", "boxes_2_chart.png"} <= names
    report = json.loads((out / "boxes.report.json").read_text(encoding="utf-8"))
    dense = [page["metrics"]["texel_density_mean"] for page in report["pages"].values()]
    assert len(dense) == 2
    assert dense[0] == pytest.approx(dense[1], rel=1e-3)
    assert all(page["metrics"]["overlap_fraction"] == 0.0 for page in report["pages"].values())
    made = load_asset(out / "boxes.glb")
    assert len(made.faces) == 24
    assert len(made.materials) == 2
    assert made.uv is not None
    assert np.ptp(made.uv) <= 1.0


def test_what_pages_cannot_be_is_refused_early(boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["unwrap", str(boxes), "-o", str(tmp_path / "out"), "--pages", "2"]
    assert main([*argv, "--format", "obj"]) == 2
    assert "pass --format glb" in capsys.readouterr().err
    assert main([*argv, "--atlas", "mesh"]) == 2
    assert "2 pages with atlas" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
