"""Polygons come back whole from a real unwrap, in every format that holds them, with mirrored charts too."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

import flexpara

ABSENT = [name for name in ("torch", "igl", "onnx") if find_spec(name) is None]
pytestmark = pytest.mark.skipif(bool(ABSENT), reason=f"{', '.join(ABSENT)} not installed")


def box_of_quads(rows: int) -> tuple[np.ndarray, list[list[int]]]:
    """Vertices of a cube from −1 to 1, and its quads, rows × rows on each side."""
    places: dict[tuple[float, ...], int] = {}
    quads: list[list[int]] = []
    line = np.linspace(-1.0, 1.0, rows + 1).round(9)
    for axis in range(3):
        for side in (-1.0, 1.0):
            for i, j in np.ndindex(rows, rows):
                ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)][:: int(side)]
                corner = [np.roll(np.array([side, line[a], line[b]]), axis) for a, b in ring]
                quads.append([places.setdefault(tuple(point.tolist()), len(places)) for point in corner])
    return np.array(list(places)), quads


def written(folder: Path, vertices: np.ndarray, quads: list[list[int]]) -> Path:
    lines = [f"v {x} {y} {z}" for x, y, z in vertices.tolist()]
    lines += [f"f {' '.join(str(number + 1) for number in quad)}" for quad in quads]
    path = folder / "quads.obj"
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def polygons_in(path: Path) -> list[int]:
    """Corners of each polygon of a file, as a reader of lines finds them."""
    data = path.read_bytes()
    if path.suffix == ".obj":
        return [len(line.split()) - 1 for line in data.decode().splitlines() if line.startswith("f ")]
    if path.suffix == ".usda":
        (counts,) = re.findall(r"faceVertexCounts = \[([^\]]*)\]", data.decode())
        return [int(word) for word in counts.split(",")]
    head, _, body = data.partition(b"end_header\n")
    vertices, faces = (int(number) for number in re.findall(rb"element \w+ (\d+)", head))
    width = sum({"double": 8, "float": 4}[kind.decode()] for kind in re.findall(rb"property (double|float) ", head))
    sizes, place = [], vertices * width
    for _ in range(faces):
        sizes.append(body[place])
        place += 1 + 4 * sizes[-1]
    assert place == len(body)
    return sizes


@pytest.mark.parametrize("symmetry", ["none", "x"])
def test_six_quads_of_a_cube_are_six_quads(tmp_path: Path, symmetry: str) -> None:
    result = flexpara.unwrap(written(tmp_path, *box_of_quads(1)), size=64, symmetry=symmetry)
    files = result.save(tmp_path / "out", formats="obj,ply,usda,npz", maps="none")
    for path in (path for path in files if path.suffix in (".obj", ".ply", ".usda")):
        assert polygons_in(path) == [4] * 6, path.suffix
    assert result.report["metrics"]["symmetric_dirichlet_mean"] == pytest.approx(1.0, abs=1e-6)


def test_no_seam_of_mirrored_charts_runs_along_a_diagonal(tmp_path: Path) -> None:
    vertices, quads = box_of_quads(4)
    ball = vertices / np.linalg.norm(vertices, axis=1, keepdims=True)
    source = written(tmp_path, ball * (1.5, 1.0, 0.8) * (1.0 + 0.4 * np.abs(ball[:, :1])), quads)
    result = flexpara.unwrap(source, size=64, symmetry="x", seam_price=0.0002)
    assert result.report["metrics"]["charts"] > 1
    (path,) = (path for path in result.save(tmp_path / "out", formats="obj", maps="none") if path.suffix == ".obj")
    assert polygons_in(path) == [4] * len(quads)
