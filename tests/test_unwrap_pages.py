"""`unwrap --pages`: charts of one search on several pages, each with its own material, textures and ONNX file."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.__main__ import main
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.sessions.session import UnwrapSession

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


def test_pages_as_tiles_are_one_layout_with_an_image_each(boxes: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    argv = ["unwrap", str(boxes), "-o", str(out), "--pages", "2", "--udim", "--maps", "chart", "--size", "128x64"]
    assert main([*argv, "--format", "obj,npz", "--quiet"]) == 0
    names = {entry.name for entry in out.iterdir()}
    assert {"boxes.obj", "boxes_chart.1001.png", "boxes_chart.1002.png", "boxes_1.onnx", "boxes_2.onnx"} <= names
    arrays = np.load(out / "boxes.npz")
    tile = np.floor(arrays["uv"][arrays["faces"]].mean(axis=1)).astype(int)
    assert np.unique(tile, axis=0).tolist() == [[0, 0], [1, 0]]
    assert (np.floor(arrays["uv"][arrays["faces"]]) == tile[:, None]).all()
    for number in (0, 1):
        session = UnwrapSession(out / f"boxes_{number + 1}.onnx")
        faces = arrays["faces"][tile[:, 0] == number]
        uv, _, _ = session.unwrap(arrays["positions"][faces].mean(axis=1))
        assert np.abs(uv - (arrays["uv"][faces].mean(axis=1) - (number, 0)))[:, 0].max() < 0.01
    assert json.loads((out / "boxes.report.json").read_text(encoding="utf-8"))["tiles"] == [1001, 1002]


def test_stacked_charts_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    twins = [trimesh.creation.box(), trimesh.creation.box()]
    twins[1].apply_translation((3.0, 0.0, 0.0))
    trimesh.util.concatenate(twins).export(tmp_path / "twins.ply")
    argv = [
        "unwrap",
        str(tmp_path / "twins.ply"),
        "-o",
        str(tmp_path / "out"),
        "--stack",
        "identical",
        "--maps",
        "none",
    ]
    assert main([*argv, "--size", "64"]) == 0
    assert "charts lie on others and share their texels" in capsys.readouterr().err


def test_tiles_are_no_gltf(boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["unwrap", str(boxes), "-o", str(tmp_path / "out"), "--udim"]) == 2
    assert "glTF does not know, expected obj" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_what_pages_cannot_be_is_refused_early(boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    argv = ["unwrap", str(boxes), "-o", str(tmp_path / "out"), "--pages", "2"]
    assert main([*argv, "--format", "obj"]) == 2
    assert "pass --format glb" in capsys.readouterr().err
    assert main([*argv, "--atlas", "mesh"]) == 2
    assert "pages or udim with atlas" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
