"""Points with uv and chart: what is written reads back exactly, by us and by trimesh."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from flexpara.runtime.errors import ShapeError
from flexpara.runtime.io.ply.write import write_cloud_ply
from flexpara.runtime.io.points.cloud import cloud_from_arrays
from flexpara.runtime.io.points.cloudfile import is_cloud, load_cloud, write_cloud_npz

RNG = np.random.default_rng(4)
POINTS = RNG.normal(size=(6, 3))
UV = RNG.random((6, 2)).astype(np.float32)
CHART = np.array([0, 1, 2, 0, 7, 1])
NORMALS = -POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
PLAIN = cloud_from_arrays(POINTS)
FULL = cloud_from_arrays(POINTS, normals=-POINTS, colors=RNG.integers(0, 256, (6, 4)).astype(np.uint8))


def test_ply_gives_back_points_normals_colours_uv_and_chart(tmp_path: Path) -> None:
    write_cloud_ply(tmp_path / "a.ply", FULL, UV, CHART)
    assert is_cloud(tmp_path / "a.ply")
    again = load_cloud(tmp_path / "a.ply")
    np.testing.assert_array_equal(again.points, POINTS)
    np.testing.assert_array_equal(np.asarray(again.colors), np.asarray(FULL.colors))
    np.testing.assert_allclose(np.asarray(again.normals), NORMALS, atol=1e-7)
    other = trimesh.load(tmp_path / "a.ply")
    assert isinstance(other, trimesh.PointCloud)
    np.testing.assert_array_equal(other.vertices, POINTS)
    rows = other.metadata["_ply_raw"]["vertex"]["data"]
    np.testing.assert_array_equal(np.stack([rows["s"], rows["t"]], axis=1), UV)
    np.testing.assert_array_equal(rows["chart"], CHART)


def test_a_plain_cloud_gets_uv_and_chart_only(tmp_path: Path) -> None:
    write_cloud_ply(tmp_path / "a.ply", PLAIN, UV, CHART)
    head = (tmp_path / "a.ply").read_bytes().partition(b"end_header")[0].decode()
    names = [line.split()[-1] for line in head.splitlines() if line.startswith("property")]
    assert names == ["x", "y", "z", "s", "t", "chart"]


def test_npz_gives_back_every_array(tmp_path: Path) -> None:
    write_cloud_npz(tmp_path / "a.npz", FULL, UV, CHART)
    write_cloud_npz(tmp_path / "plain.npz", PLAIN, UV, CHART)
    with np.load(tmp_path / "a.npz") as arrays, np.load(tmp_path / "plain.npz") as plain:
        assert sorted(arrays.files) == ["chart", "colors", "normals", "points", "uv"]
        assert sorted(plain.files) == ["chart", "points", "uv"]
        np.testing.assert_array_equal(arrays["uv"], UV)
        np.testing.assert_array_equal(arrays["chart"], CHART)
    again = load_cloud(tmp_path / "a.npz")
    np.testing.assert_array_equal(again.points, POINTS)
    np.testing.assert_allclose(np.asarray(again.normals), NORMALS, atol=1e-15)


def test_the_same_points_give_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_cloud_npz(tmp_path / f"{name}.npz", FULL, UV, CHART)
        write_cloud_ply(tmp_path / f"{name}.ply", FULL, UV, CHART)
    for kind in ("npz", "ply"):
        assert (tmp_path / f"a.{kind}").read_bytes() == (tmp_path / f"b.{kind}").read_bytes()


def test_lengths_that_differ_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"expected \(6, 2\) and \(6,\)"):
        write_cloud_ply(tmp_path / "a.ply", PLAIN, UV[:5], CHART)
    with pytest.raises(ShapeError, match="shapes"):
        write_cloud_npz(tmp_path / "a.npz", PLAIN, UV, CHART[:5])
    assert list(tmp_path.iterdir()) == []
