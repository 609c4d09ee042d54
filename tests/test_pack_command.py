"""`flexpara pack` from its words to its files: formats kept, textures moved, several meshes on one page."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

import flexpara
from flexpara.__main__ import main
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from pathlib import Path

pytest.importorskip("moderngl")

from flexpara.bake.files.images import read_image

PLATE = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
property float s
property float t
element face 1
property list uchar int vertex_indices
end_header
0 0 0 0 0
2 0 0 1 0
2 1 0 1 0.5
0 1 0 0 0.5
4 0 1 2 3
"""
RED, BLUE = (255, 0, 0), (0, 0, 255)


def packed(*meshes: Path, out: Path, words: tuple[str, ...] = ()) -> int:
    return main(["pack", *map(str, meshes), "-o", str(out), "--size", "64", "--quiet", *words])


def color_at(picture: np.ndarray, uv: np.ndarray) -> list[int]:
    """Colour at a point of uv, v up, as stored."""
    size = len(picture)
    column, row = int(uv[0] * size), int((1.0 - uv[1]) * size)
    return picture[row, column, :3].tolist()


def test_an_obj_stays_an_obj_line_by_line_and_its_texture_moves(house: Path, tmp_path: Path) -> None:
    assert packed(house, out=tmp_path / "out") == 0
    lines = (tmp_path / "out" / "house.obj").read_text(encoding="utf-8").splitlines()
    assert [line for line in lines if line.startswith(("v ", "o "))] == [
        line for line in house.read_text(encoding="utf-8").splitlines() if line.startswith(("v ", "o "))
    ]
    assert sum(line.startswith("f ") for line in lines) == 2
    made = load_asset(tmp_path / "out" / "house.obj")
    assert made.uv is not None
    corner_uv, picture = made.uv[made.faces], read_image(tmp_path / "out" / "house_base-color.png")
    assert color_at(picture, corner_uv[0].mean(axis=0)) == list(RED)
    assert color_at(picture, corner_uv[2].mean(axis=0)) == list(BLUE)
    assert np.ptp(corner_uv.reshape(-1, 2), axis=0).max() > 0.9


def test_several_meshes_share_a_page_and_its_textures(house: Path, tmp_path: Path) -> None:
    path = tmp_path / "plate.ply"
    path.write_text(PLATE, encoding="utf-8")
    assert packed(house, path, out=tmp_path / "out", words=("--preview",)) == 0
    files = {entry.name for entry in (tmp_path / "out").iterdir()}
    assert {"house.obj", "house.mtl", "plate.ply", "packed_base-color.png", "packed.preview.png"} <= files
    assert not any(name.startswith(("house_", "plate_")) for name in files)
    report = json.loads((tmp_path / "out" / "packed.report.json").read_text(encoding="utf-8"))
    assert [source["stem"] for source in report["sources"]] == ["house", "plate"]
    assert report["metrics"]["charts"] == 3
    assert report["metrics"]["overlap_fraction"] == 0.0
    picture = read_image(tmp_path / "out" / "packed_base-color.png")
    made = load_asset(tmp_path / "out" / "house.obj")
    assert made.uv is not None
    assert color_at(picture, made.uv[made.faces[2]].mean(axis=0)) == list(BLUE)


def test_what_a_format_cannot_hold_is_in_the_report(tmp_path: Path) -> None:
    (tmp_path / "plate.ply").write_text(PLATE, encoding="utf-8")
    assert packed(tmp_path / "plate.ply", out=tmp_path / "out", words=("--format", "glb")) == 0
    report = json.loads((tmp_path / "out" / "plate.report.json").read_text(encoding="utf-8"))
    assert report["changes"] == {"polygons_as_triangles": 1}


def test_the_api_packs_and_saves(house: Path, tmp_path: Path) -> None:
    result = flexpara.pack(house, size=64, padding=1)
    assert result.atlas.size == 64
    assert result.report["pack"]["islands"] == 2
    written = result.save(tmp_path / "out", maps=(), preview=False, formats=("ply",))
    assert {path.name for path in written} == {"house.ply", "house.report.json"}


def test_a_mesh_without_uv_is_refused_with_the_remedy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trimesh.creation.box().export(tmp_path / "box.ply")
    assert packed(tmp_path / "box.ply", out=tmp_path / "out") == 2
    assert "unwrap it first" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_congruent_islands_share_their_texels_and_that_is_said(
    house: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("--maps", "none", "--stack", "identical", "--rotation", "90", "--whole-texels")
    assert main(["pack", str(house), "-o", str(tmp_path / "out"), "--size", "64", *words]) == 0
    assert "1 charts lie on others" in capsys.readouterr().err
    report = json.loads((tmp_path / "out" / "house.report.json").read_text(encoding="utf-8"))
    assert report["pack"]["stacked"] == 1
    assert report["metrics"]["overlap_fraction"] == 0.0
    made = load_asset(tmp_path / "out" / "house.obj")
    assert made.uv is not None
    corner_uv = made.uv[made.faces]
    assert np.ptp(corner_uv[:2].reshape(-1, 2), axis=0).min() > 0.9
    assert np.allclose(np.sort(corner_uv[:2].reshape(-1, 2), axis=0), np.sort(corner_uv[2:].reshape(-1, 2), axis=0))
    assert np.allclose(64.0 * corner_uv, np.rint(64.0 * corner_uv), atol=1e-5)


def test_networks_are_refused(house: Path, tmp_path: Path) -> None:
    assert packed(house, out=tmp_path / "out", words=("--inverse",)) == 2
