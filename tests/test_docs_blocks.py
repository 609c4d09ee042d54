"""Every block of the documents runs: commands of flexpara, Python, JSON; a page's blocks in their order, in one folder.

Files that the pages name lie there, as small surfaces; sizes of images are made small, samples are spheres.  Other
programs (pip, git) are known by name and not run, and blocks of other languages are shown.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from PIL import Image
from trimesh.visual import TextureVisuals
from trimesh.visual.material import SimpleMaterial

from flexpara.__main__ import main
from flexpara.runtime.samples import make_sample

pytest.importorskip("moderngl")
pytest.importorskip("manifold3d")
ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
PAGES = sorted([ROOT / "README.md", ROOT / "integrations" / "blender" / "README.md", *DOCS.rglob("*.md")])
BLOCK = re.compile(r"^( *)```(\w+)[^\n]*\n(.*?)^\1```", re.MULTILINE | re.DOTALL)
NOT_RUN = {"pip", "git", "cd", "zip", "scripts/demo", "scripts/docs", ".", "apt-get"}
SHOWN = {"cpp", "rust", "js", "html", "csharp", "mermaid", "text"}
"""Not run here; test_docs_languages runs those of the first four that it can."""
SIZED = ("unwrap", "bake", "pack")
SIZE = "64"


def blocks(page: Path) -> list[tuple[str, str]]:
    """Language and text of each block."""
    found = BLOCK.findall(page.read_text(encoding="utf-8"))
    return [(language, re.sub(f"^{indent}", "", text, flags=re.MULTILINE)) for indent, language, text in found]


def commands(text: str) -> list[str]:
    """The commands of a shell block, without comments."""
    lines = [line.partition(" #")[0].strip() for line in text.splitlines()]
    return [part.strip() for line in lines if line and not line.startswith("#") for part in line.split("&&")]


RUNS = [page for page in PAGES if any(language not in SHOWN for language, _ in blocks(page))]


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The files that pages name."""
    folder = tmp_path_factory.mktemp("inputs")
    part = trimesh.Trimesh(*make_sample("bracket", resolution=8), process=False)
    ball = trimesh.Trimesh(*make_sample("sphere", resolution=8), process=False)
    for name in ("part.stl", "bunny.obj", "high.obj", "generated.glb"):
        (part if name == "part.stl" else ball).export(folder / name)
    uv = np.clip(ball.vertices[:, :2] * 0.4 + 0.5, 0.0, 1.0)
    image = Image.fromarray(np.full((8, 8, 3), 120, np.uint8))
    visual: Any = TextureVisuals(uv, material=SimpleMaterial(image=image))
    textured = trimesh.Trimesh(ball.vertices, ball.faces, visual=visual, process=False)
    for name in ("textured.glb", "scene.glb", "low.glb", "in.glb", "peer.glb", "table.glb"):
        scene = trimesh.Scene()
        scene.add_geometry(textured, node_name="Box", geom_name="Box")
        scene.export(folder / name)
    textured.export(folder / "chair.obj")
    (folder / "incoming").mkdir()
    part.export(folder / "incoming" / "first.obj")
    points, _ = trimesh.sample.sample_surface_even(trimesh.creation.icosphere(3), 400, seed=1)
    trimesh.PointCloud(points).export(folder / "scan.ply")
    np.save(folder / "points.npy", ball.vertices.astype(np.float32))
    return folder


@pytest.fixture
def place(inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of its own with these files, and a program `flexpara` on PATH."""
    subprocess.run(["cp", "-r", f"{inputs}/.", str(tmp_path)], check=True)
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "flexpara"
    program.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m flexpara "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{program.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def run_shell(command: str) -> None:
    """One command: those of flexpara are run, here where no stream is involved."""
    words = shlex.split(command)
    if words[0] != "flexpara":
        assert words[0] in NOT_RUN, command
        return
    if words[1] in SIZED:
        at = words.index("--size") if "--size" in words else 2
        words[at : at + 2 * ("--size" in words)] = ["--size", SIZE]
    if " ao" in command.replace(",", " "):
        words += ["--rays", "4"]
    if words[1] == "sample":
        words[2:3] = ["sphere", "--resolution", "8"]
    if "<" in words:
        subprocess.run(" ".join(words), shell=True, check=True)
        return
    assert main([*words[1:], *(["--force"] if words[1] in (*SIZED, "sample", "report") else [])]) == 0, command


def names_of(folder: Path) -> dict[str, Any]:
    """What a page of Python may take for granted: vertices, faces and points of a surface."""
    vertices, faces = make_sample("sphere", resolution=8)
    out = folder / "out" / "bunny.onnx"
    if not out.exists():
        assert main(["unwrap", "bunny.obj", "-o", "out/", "--size", SIZE, "--maps", "none", "--quiet"]) == 0
    return {"vertices": vertices, "faces": faces, "points": vertices.astype(np.float32)}


@pytest.mark.parametrize("page", RUNS, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_every_block_of_a_page_runs(page: Path, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
    found = blocks(page)
    names = names_of(place) if any(language == "python" for language, _ in found) else {}
    for language, text in found:
        if language == "sh":
            for command in commands(text):
                run_shell(command)
        elif language == "python":
            exec(compile(text, f"{page.name}, a block", "exec"), names)
        elif language == "json":
            json.loads(text)
        else:
            assert language in SHOWN, f"{page.name} has a block of {language}"
    capsys.readouterr()


def test_a_block_that_fails_is_noticed(place: Path) -> None:
    """Guards the test above."""
    with pytest.raises(AssertionError):
        run_shell("flexpara unwrap nothing.obj -o out/")
    with pytest.raises(AssertionError):
        run_shell("rm -r /")
    assert blocks(ROOT / "docs" / "index.md")[0][0] == "sh"
    assert place.is_dir()
