"""Point cloud files: formats, what is a cloud at all, and hostile files."""

from __future__ import annotations

import hashlib
import zipfile
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flexpara.runtime.errors import InputError, MissingFileError, ShapeError
from flexpara.runtime.io.points.cloudfile import is_cloud, load_cloud

RNG = np.random.default_rng(3)
POINTS = RNG.normal(size=(9, 3))
NORMALS = POINTS / np.linalg.norm(POINTS, axis=1, keepdims=True)
COLORS = RNG.integers(0, 256, (9, 3)).astype(np.uint8)


@pytest.mark.parametrize("name", ["a.xyz", "a.txt", "a.csv", "a.npy"])
@pytest.mark.parametrize("oriented", [True, False])
def test_tables_read_with_and_without_normals(tmp_path: Path, name: str, oriented: bool) -> None:
    table = np.hstack([POINTS, NORMALS]) if oriented else POINTS
    if name == "a.npy":
        np.save(tmp_path / name, table)
    else:
        np.savetxt(tmp_path / name, table, fmt="%.17g", delimiter="," if name == "a.csv" else " ")
    cloud = load_cloud(tmp_path / name)
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert (cloud.normals is not None) == oriented
    if cloud.normals is not None:
        np.testing.assert_allclose(cloud.normals, NORMALS, atol=1e-15)
    assert cloud.stem == "a"
    assert cloud.sha256 == hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()


def test_six_columns_of_whole_numbers_are_colours(tmp_path: Path) -> None:
    np.savetxt(tmp_path / "a.xyz", np.hstack([POINTS, COLORS]), header="x y z r g b")
    cloud = load_cloud(tmp_path / "a.xyz")
    assert cloud.normals is None
    assert cloud.colors is not None
    np.testing.assert_array_equal(cloud.colors[:, :3], COLORS)


def test_a_line_of_names_is_skipped(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\ufeff# scan\nx;y;z\n" + "\n".join(f"{i};{i * i};1" for i in range(5)), "utf-8")
    np.testing.assert_array_equal(load_cloud(tmp_path / "a.csv").points[3], [3, 9, 1])


def test_npz_takes_named_arrays_or_the_only_one(tmp_path: Path) -> None:
    np.savez(tmp_path / "named.npz", points=POINTS, normals=NORMALS, colors=COLORS, uv=np.zeros(3))
    np.savez_compressed(tmp_path / "only.npz", anything=np.hstack([POINTS, NORMALS]))
    named, only = load_cloud(tmp_path / "named.npz"), load_cloud(tmp_path / "only.npz")
    np.testing.assert_array_equal(named.points, only.points)
    assert named.normals is not None
    assert only.normals is not None
    np.testing.assert_array_equal(named.normals, only.normals)
    assert named.colors is not None
    assert only.colors is None


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
def test_ply_from_trimesh_reads_with_its_colours(tmp_path: Path, encoding: str) -> None:
    trimesh.PointCloud(POINTS.astype(np.float32), COLORS).export(tmp_path / "a.ply", encoding=encoding)
    cloud = load_cloud(tmp_path / "a.ply")
    np.testing.assert_allclose(cloud.points, POINTS, atol=1e-6)
    assert cloud.colors is not None
    np.testing.assert_array_equal(cloud.colors[:, :3], COLORS)


def test_a_cloud_is_told_from_a_mesh(tmp_path: Path) -> None:
    trimesh.PointCloud(POINTS).export(tmp_path / "cloud.ply")
    trimesh.Trimesh(POINTS[:3], [[0, 1, 2]], process=False).export(tmp_path / "mesh.ply")
    (tmp_path / "broken.ply").write_bytes(b"ply\nnothing")
    answers = {name: is_cloud(tmp_path / name) for name in ("cloud.ply", "mesh.ply", "broken.ply", "none.ply")}
    assert answers == {"cloud.ply": True, "mesh.ply": False, "broken.ply": False, "none.ply": False}
    assert is_cloud(Path("a.XYZ"))
    assert is_cloud(Path("a.npy"))
    assert not is_cloud(Path("a.obj"))


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.obj", b"v 1 2 3", r"expected \.ply"),
        ("a.xyz", b"", "no text of numbers"),
        ("a.csv", b"x,y,z\n", "the cloud has 0 points"),
        ("a.xyz", b"1 2 3\n4 5 six\n", "mend or remove"),
        ("a.xyz", b"1 2\n3 4\n", "line 1 has 2 numbers"),
        ("a.xyz", b"1 2 3\n4 5 6 7\n", "line 2 has 4 numbers, expected 3"),
        ("a.csv", b"1,2,3,4\n4,5,6,7\n", r"shape \(2, 4\)"),
        ("a.csv", b"1,2,3\n4,,6\n7,8,9\n1,1,2\n", "first: point 1"),
        ("a.xyz", b"1 2 3\n4 5 6\n7 8 nan\n1 1 1\n", "1 of 4 points .*first: point 2"),
        ("a.xyz", b"\xff\xfe\x00", "no text"),
        ("a.npy", b"", "no .npy file"),
        ("a.npy", b"nothing", "no .npy file"),
        ("a.npz", b"PK nothing", "no .npz file"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 5\nend_header\n", "expected x y z"),
    ],
)
def test_damaged_files_say_so_in_one_line(tmp_path: Path, name: str, content: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message) as caught:
        load_cloud(tmp_path / name)
    assert "\n" not in str(caught.value)
    assert name in str(caught.value)
    assert caught.value.exit_code == 2


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"none\.xyz does not exist"):
        load_cloud(tmp_path / "none.xyz")


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    objects = np.array([[1, 2, 3]], dtype=object)
    np.save(tmp_path / "a.npy", objects, allow_pickle=True)
    np.savez(tmp_path / "a.npz", objects)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(InputError, match="plain numbers"):
            load_cloud(tmp_path / name)


def test_a_transpose_and_names_without_points_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", POINTS.T)
    with pytest.raises(ShapeError, match="transpose"):
        load_cloud(tmp_path / "a.npy")
    np.savez(tmp_path / "a.npz", one=POINTS, two=POINTS)
    with pytest.raises(InputError, match="'points'"):
        load_cloud(tmp_path / "a.npz")


def test_a_header_that_promises_more_than_the_file_holds_is_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", POINTS)
    whole = (tmp_path / "a.npy").read_bytes()
    longer = whole.replace(b"(9, 3), }" + b" " * 12, b"(9000000000000, 3), }")
    assert len(longer) == len(whole)
    assert longer != whole
    (tmp_path / "a.npy").write_bytes(longer)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("points.npy", longer)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(InputError, match="header promises"):
            load_cloud(tmp_path / name)


@pytest.mark.parametrize("kind", ["npy", "npz", "xyz", "ply"])
def test_no_damaged_byte_gets_past_the_errors(tmp_path: Path, kind: str) -> None:
    path = tmp_path / f"a.{kind}"
    if kind == "npy":
        np.save(path, POINTS)
    elif kind == "npz":
        np.savez_compressed(path, points=POINTS, normals=POINTS)
    elif kind == "xyz":
        np.savetxt(path, POINTS)
    else:
        trimesh.PointCloud(POINTS).export(path)
    whole = np.frombuffer(path.read_bytes(), dtype=np.uint8)
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(200):
        damaged = whole[: rng.integers(len(whole) // 2, len(whole) + 1)].copy()
        damaged[rng.integers(0, len(damaged), 3)] = rng.integers(0, 256, 3)
        path.write_bytes(damaged.tobytes())
        try:
            assert np.isfinite(load_cloud(path).points).all()
        except InputError:
            refused += 1
    assert refused > 20
