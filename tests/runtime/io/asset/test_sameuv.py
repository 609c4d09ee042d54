"""The uv of another file on the triangles of a mesh: shuffled, turned over, two-sided; and files of other triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.io.asset.sameuv import matched, uv_of_same
from flexpara.runtime.io.meshfile import asset_from_arrays
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample


def written(path: Path, points: np.ndarray, corners: np.ndarray, faces: np.ndarray) -> Path:
    """An OBJ file of six digits: corner c of a face has its own uv, corners (f, 3, 2)."""
    rows = [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in points.tolist()]
    rows += [f"vt {u:.6f} {v:.6f}" for u, v in corners.reshape(-1, 2).tolist()]
    for number, face in enumerate((faces + 1).tolist()):
        rows.append("f " + " ".join(f"{vertex}/{3 * number + k + 1}" for k, vertex in enumerate(face)))
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    return path


def test_uv_come_to_the_corners_they_belong_to_though_the_file_has_another_order(tmp_path: Path) -> None:
    points, faces = make_sample("sphere", resolution=8)
    asset = asset_from_arrays(points, faces)
    rng = np.random.default_rng(0)
    vertex, face = rng.permutation(len(points)), rng.permutation(len(faces))
    place = np.argsort(vertex)
    other = np.stack([np.roll(place[row], rng.integers(3)) for row in faces[face]])
    corners = points[vertex][other][:, :, :2] * 0.4 + 0.5  # uv that tell where a corner lies
    file = written(tmp_path / "other.obj", points[vertex], corners, other)
    expected = asset.surface.triangles[:, :, :2] * 0.4 + 0.5
    assert np.abs(uv_of_same(asset, file) - expected).max() < 2e-6
    assert np.abs(corners - expected).max() > 0.1  # in the file's order it would be wrong


def test_triangles_that_are_turned_over_in_the_other_file_are_found_too() -> None:
    points, faces = make_sample("cube", resolution=4)
    found = matched(Surface(points, faces), Surface(points, faces[:, ::-1]))
    assert np.array_equal(faces[:, ::-1].reshape(-1)[found], faces)


def test_two_sides_of_one_triangle_take_the_uv_of_theirs_in_order() -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=np.float64)
    twice = Surface(points, np.array([[0, 1, 2], [3, 5, 4]]))
    assert matched(twice, twice).tolist() == [[0, 1, 2], [3, 4, 5]]


def test_other_triangles_no_uv_and_no_file_are_refused_with_a_remedy(tmp_path: Path) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=np.float64)
    square = asset_from_arrays(points, np.array([[0, 1, 2], [0, 2, 3]]))
    across = np.array([[0, 1, 3], [1, 2, 3]])
    other = written(tmp_path / "across.obj", points, points[across][:, :, :2], across)
    with pytest.raises(InputError, match=r"2 of 2 triangles of mesh are not in .*write the atlas from this very mesh"):
        uv_of_same(square, other)
    bare = tmp_path / "bare.obj"
    bare.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\n", encoding="utf-8")
    with pytest.raises(InputError, match="has no uv"):
        uv_of_same(square, bare)
    with pytest.raises(MissingFileError):
        uv_of_same(square, tmp_path / "none.obj")
