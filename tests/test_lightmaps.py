"""Light maps as engines want them: a uv set in [0, 1]², nothing over anything, nothing mirrored, texels apart."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pygltflib
import pytest
import trimesh
from trimesh.visual import TextureVisuals

from flexpara.__main__ import main
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.io.gltf.uvsets import uv_of_set
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("moderngl")

SIZE = 128


@pytest.mark.parametrize("target", ["unity", "unreal", "godot"])
def test_light_map_uv_follow_the_engine(tmp_path: Path, target: str) -> None:
    mesh = trimesh.creation.box((3.0, 2.0, 1.0))
    mesh.visual = TextureVisuals(uv=np.tile([[0.25, 0.5]], (len(mesh.vertices), 1)))
    mesh.export(tmp_path / "crate.glb")
    argv = ["unwrap", str(tmp_path / "crate.glb"), "-o", str(tmp_path / "out"), "--uv-set", "1", "--maps", "ao"]
    assert main([*argv, "--target", target, "--size", str(SIZE), "--no-preview", "--quiet"]) == 0
    made = load_asset(tmp_path / "out" / "crate.glb")
    uv = uv_of_set(made, 1)[made.faces]
    assert (uv >= 2 / SIZE - 1e-6).all()
    assert (uv <= 1 - 2 / SIZE + 1e-6).all()
    found = measure(made.surface, uv, size=SIZE)
    assert (found.overlap_fraction, found.mirrored_charts, found.flipped_faces) == (0.0, 0, 0)
    assert found.chart_gap_texels is None or found.chart_gap_texels >= 4.0 - 1e-3
    np.testing.assert_allclose(uv_of_set(made, 0), np.tile([[0.25, 0.5]], (len(made.positions), 1)), atol=1e-6)
    file = pygltflib.GLTF2().load(str(tmp_path / "out" / "crate.glb"))
    assert file is not None
    texture = file.materials[0].occlusionTexture
    assert texture is not None
    assert texture.texCoord == 1
    report = json.loads((tmp_path / "out" / "crate.report.json").read_text(encoding="utf-8"))
    assert report["settings"]["padding"] == 2
