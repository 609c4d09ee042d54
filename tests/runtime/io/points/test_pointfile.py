"""Point files: what is written reads back, what is wrong says so in one line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from flexpara.runtime.errors import InputError, MissingFileError, ShapeError
from flexpara.runtime.io.points.pointfile import check_output, read_points, write_unwrapped

POINTS = np.random.default_rng(1).normal(size=(7, 3))


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_npy_and_npz_read_back_exactly_in_their_precision(tmp_path: Path, dtype: type[np.floating]) -> None:
    points = POINTS.astype(dtype)
    np.save(tmp_path / "a.npy", points)
    np.savez(tmp_path / "only.npz", anything=points)
    np.savez(tmp_path / "named.npz", other=np.zeros(3), points=points)
    for name in ("a.npy", "only.npz", "named.npz"):
        read = read_points(tmp_path / name)
        assert read.dtype == dtype
        np.testing.assert_array_equal(read, points)


def test_integers_become_float64(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.arange(6).reshape(2, 3))
    read = read_points(tmp_path / "a.npy")
    assert read.dtype == np.float64
    np.testing.assert_array_equal(read, [[0, 1, 2], [3, 4, 5]])


@pytest.mark.parametrize(
    "content",
    [
        "1,2,3\n4,5,6\n",
        "x,y,z\n1,2,3\n4,5,6",
        "# made by hand\nx;y;z;name\n1;2;3;a\n4;5;6;b\n",
        "1 2 3\n\n4  5 6\n",
        "X\tY\tZ\tred\r\n1\t2\t3\t255\r\n4\t5\t6\t0\r\n",
        "\ufeffx,y,z\n1,2,3\n4,5,6\n",
    ],
)
def test_csv_reads_with_and_without_a_line_of_names(tmp_path: Path, content: str) -> None:
    (tmp_path / "a.csv").write_text(content, encoding="utf-8")
    np.testing.assert_array_equal(read_points(tmp_path / "a.csv"), [[1, 2, 3], [4, 5, 6]])


def test_no_points_are_allowed(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("x,y,z\n")
    np.save(tmp_path / "a.npy", np.zeros((0, 3)))
    assert read_points(tmp_path / "a.csv").shape == (0, 3)
    assert read_points(tmp_path / "a.npy").shape == (0, 3)


def test_ply_gives_the_vertices_of_a_cloud_and_of_a_mesh(tmp_path: Path) -> None:
    single = POINTS.astype(np.float32)
    trimesh.PointCloud(single).export(tmp_path / "cloud.ply")
    trimesh.Trimesh(single, [[0, 1, 2]], process=False).export(tmp_path / "mesh.ply")
    np.testing.assert_array_equal(read_points(tmp_path / "cloud.ply"), single)
    np.testing.assert_array_equal(read_points(tmp_path / "mesh.ply"), single)


def test_nothing_is_unpickled(tmp_path: Path) -> None:
    objects = np.array([[1, 2, 3]], dtype=object)
    np.save(tmp_path / "a.npy", objects, allow_pickle=True)
    np.savez(tmp_path / "a.npz", objects)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(InputError, match="plain numbers"):
            read_points(tmp_path / name)


@pytest.mark.parametrize(
    ("array", "hint"), [(POINTS.T, "transpose"), (POINTS[0], "convert"), (POINTS[:, :2], "convert"), (POINTS + 1j, "")]
)
def test_another_shape_is_refused(tmp_path: Path, array: np.ndarray, hint: str) -> None:
    np.save(tmp_path / "a.npy", array)
    with pytest.raises(ShapeError, match=rf"expected \(n, 3\).*{hint}"):
        read_points(tmp_path / "a.npy")


def test_points_that_are_not_finite_are_counted(tmp_path: Path) -> None:
    points = POINTS.copy()
    points[2, 1], points[5, 0] = np.nan, np.inf
    np.save(tmp_path / "a.npy", points)
    with pytest.raises(InputError, match=r"2 of 7 points .*first: point 2"):
        read_points(tmp_path / "a.npy")


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.npy", b"nothing"),
        ("a.npy", b""),
        ("a.npz", b"PK nothing"),
        ("a.csv", b""),
        ("a.csv", b"x,y,z\n1,2,three\n"),
        ("a.csv", b"1,2\n3,4\n"),
        ("a.csv", b"\xff\xfe\x00"),
        ("a.ply", b"ply\nformat ascii 1.0\nelement vertex 999999999999\nend_header\n"),
        ("a.ply", b"nothing"),
        ("a.obj", b"v 1 2 3"),
    ],
)
def test_damaged_files_say_so_in_one_line(tmp_path: Path, name: str, content: bytes) -> None:
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=r"a\.") as caught:
        read_points(tmp_path / name)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("count", [b"(8, 3)", b"(9000000000000, 3)"])
def test_a_header_that_promises_more_than_the_file_holds_is_refused(tmp_path: Path, count: bytes) -> None:
    np.save(tmp_path / "a.npy", POINTS)
    whole = (tmp_path / "a.npy").read_bytes()
    longer = whole.replace(b"(7, 3), }" + b" " * (len(count) - 6), count + b", }")
    assert longer != whole
    assert len(longer) == len(whole)
    (tmp_path / "a.npy").write_bytes(longer)
    with pytest.raises(InputError, match="cut off or damaged"):
        read_points(tmp_path / "a.npy")


def test_a_missing_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match=r"none\.npy does not exist"):
        read_points(tmp_path / "none.npy")


def answer(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    uv = rng.random((n, 2)).astype(np.float32)
    return uv, rng.integers(0, 9, n), rng.random(n).astype(np.float32)


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
@pytest.mark.parametrize("n", [0, 1, 7])
def test_answers_read_back_exactly(tmp_path: Path, n: int, dtype: type[np.floating]) -> None:
    points, (uv, chart, score) = POINTS[:n].astype(dtype), answer(n)
    write_unwrapped(tmp_path / "uv.npz", points, uv, chart, score)
    write_unwrapped(tmp_path / "uv.csv", points, uv, chart, score)
    with np.load(tmp_path / "uv.npz") as arrays:
        for name, array in (("points", points), ("uv", uv), ("chart", chart), ("score", score)):
            np.testing.assert_array_equal(arrays[name], array)
            assert arrays[name].dtype == array.dtype
    lines = (tmp_path / "uv.csv").read_text().splitlines()
    assert lines[0] == "x,y,z,u,v,chart,score"
    assert len(lines) == n + 1
    table = np.array([line.split(",") for line in lines[1:]], dtype=np.float64).reshape(n, 7)
    np.testing.assert_array_equal(table[:, :3].astype(dtype), points)
    np.testing.assert_array_equal(table[:, 3:5].astype(np.float32), uv)
    np.testing.assert_array_equal(table[:, 5], chart)
    np.testing.assert_array_equal(table[:, 6].astype(np.float32), score)
    np.testing.assert_array_equal(read_points(tmp_path / "uv.csv").astype(dtype), points)


def test_the_same_answer_gives_the_same_bytes(tmp_path: Path) -> None:
    for name in ("a.npz", "b.npz"):
        write_unwrapped(tmp_path / name, POINTS, *answer(7))
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_wrong_outputs_are_refused_early(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"expected \.npz or \.csv"):
        check_output(tmp_path / "uv.txt")
    with pytest.raises(ShapeError, match="shapes"):
        write_unwrapped(tmp_path / "uv.npz", POINTS, *answer(6))
    assert list(tmp_path.iterdir()) == []
