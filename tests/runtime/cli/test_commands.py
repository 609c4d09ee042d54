"""Commands without torch and OpenGL: what they write again, which uv they measure, whom they leave in peace."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from flexpara.__main__ import main
from flexpara.runtime.io.points.pointfile import is_unwrapped, write_unwrapped


@pytest.fixture
def textured(tmp_path: Path) -> Path:
    """Two triangles, a square in uv, with a picture."""
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    visual = TextureVisuals(uv=square, material=PBRMaterial(baseColorTexture=Image.new("RGB", (4, 4))))
    mesh = trimesh.Trimesh(np.c_[square, np.zeros(4)], [[0, 1, 2], [0, 2, 3]], visual=visual, process=False)
    mesh.export(tmp_path / "square.glb")
    return tmp_path / "square.glb"


@pytest.mark.parametrize("name", ["answer.npz", "answer.csv"])
def test_an_answer_is_known_again_and_a_file_of_anybody_else_is_not(tmp_path: Path, name: str) -> None:
    points, uv = np.zeros((2, 3), np.float32), np.zeros((2, 2), np.float32)
    write_unwrapped(tmp_path / name, points, uv, np.zeros(2, np.int64), np.ones(2, np.float32))
    assert is_unwrapped(tmp_path / name)
    np.savez(tmp_path / "theirs.npz", points=points, uv=uv)
    (tmp_path / "theirs.csv").write_text("x,y,z\n0,0,0\n", encoding="utf-8")
    (tmp_path / "broken.npz").write_bytes(b"PK nothing")
    assert not any(is_unwrapped(tmp_path / other) for other in ("theirs.npz", "theirs.csv", "broken.npz"))


def test_faces_are_written_again_and_not_over_a_file_of_anybody_else(textured: Path) -> None:
    faces = textured.with_name("faces.npz")
    for _ in range(2):
        assert main(["evaluate", str(textured), "--faces", str(faces)]) == 0
    np.savez(faces, charts=[1])
    assert main(["evaluate", str(textured), "--faces", str(faces)]) == 2
    assert main(["evaluate", str(textured), "--faces", str(faces), "--force"]) == 0


def test_the_uv_that_are_measured_are_said_where_they_are_not_the_first(
    textured: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("moderngl")
    out = textured.parent / "out"
    assert main(["unwrap", str(textured), "-o", str(out), "--size", "64", "--maps", "none"]) == 0
    capsys.readouterr()
    assert main(["evaluate", str(out / "square.glb")]) == 0
    assert "textures are read with uv set 1" in capsys.readouterr().err
    assert main(["evaluate", str(out / "square.glb"), "--uv-set", "0"]) == 0
    assert capsys.readouterr().err == ""


def test_files_of_an_earlier_run_are_named(textured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("moderngl")
    command = ["unwrap", str(textured), "-o", str(textured.parent / "out"), "--size", "64", "--no-preview", "--maps"]
    assert main([*command, "ao,chart"]) == 0
    assert "earlier run" not in capsys.readouterr().err
    assert main([*command, "chart"]) == 0
    assert "of an earlier run, whose uv may be others: square_ao.png" in capsys.readouterr().err


def test_a_mesh_in_place_of_the_network_is_named(textured: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(textured.with_name("points.npy"), np.zeros((1, 3), np.float32))
    words = [str(textured), str(textured.with_name("points.npy")), "-o", str(textured.with_name("uv.npz"))]
    assert main(["query", *words]) == 2
    assert "square.glb is no ONNX model" in capsys.readouterr().err


def test_onnxruntime_counts_nobody(tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name != "ORT_DISABLE_TELEMETRY"}
    environment |= {"HOME": str(tmp_path), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    code = "import flexpara.runtime, onnxruntime"
    subprocess.run([sys.executable, "-c", code], check=True, env=environment, timeout=120)
    assert list(tmp_path.rglob("*")) == []
