"""PLY by hand: every order of bytes and columns, lists and strips, and headers that lie."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError, MeshError
from flexpara.runtime.io.ply.header import ply_header
from flexpara.runtime.io.ply.leftout import left_out
from flexpara.runtime.io.ply.read import read_ply, read_ply_points
from flexpara.runtime.io.rawmesh import RawMesh

ROWS = [[1.5, 2.0, 3.0, 0.0, 0.0, 1.0, 10, 20, 30], [4.0, 5.0, 6.25, 0.0, 1.0, 0.0, 40, 50, 60]]
FIELDS = [("float", name) for name in ("x", "y", "z", "nx", "ny", "nz")] + [
    ("uchar", c) for c in ("red", "green", "blue")
]
KINDS = {"float": "f4", "double": "f8", "uchar": "u1", "int": "i4"}


def head(form: str, elements: str) -> bytes:
    return f"ply\nformat {form} 1.0\ncomment by hand\n{elements}end_header\n".encode()


def vertex(fields: list[tuple[str, str]], count: int = 2) -> str:
    return f"element vertex {count}\n" + "".join(f"property {kind} {name}\n" for kind, name in fields)


def packed(fields: list[tuple[str, str]], rows: list[list[float]], order: str) -> bytes:
    return np.array(
        [tuple(row) for row in rows], dtype=[(name, order + KINDS[kind]) for kind, name in fields]
    ).tobytes()


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_points_normals_and_colours_read_the_same_from_every_form(form: str) -> None:
    text = "\n".join(" ".join(f"{value:g}" for value in row) for row in ROWS).encode() + b"\n"
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(form)
    found = read_ply_points(head(form, vertex(FIELDS)) + (packed(FIELDS, ROWS, order) if order else text))
    np.testing.assert_array_equal(found["points"], [[1.5, 2.0, 3.0], [4.0, 5.0, 6.25]])
    np.testing.assert_array_equal(found["normals"], [[0, 0, 1], [0, 1, 0]])
    np.testing.assert_array_equal(found["colors"], [[10, 20, 30, 255], [40, 50, 60, 255]])
    assert (found["points"].dtype, found["colors"].dtype) == (np.float64, np.uint8)


def test_other_properties_and_elements_are_skipped() -> None:
    fields = [("int", "id"), ("double", "z"), ("double", "y"), ("uchar", "w"), ("double", "x")]
    data = head(
        "binary_little_endian", "element camera 3\nproperty double f\n" + vertex(fields, 1) + "element face 0\n"
    )
    data += np.arange(3.0).tobytes() + packed(fields, [[7, 3.0, 2.0, 9, 1.0]], "<") + b"more"
    found = read_ply_points(data)
    assert list(found) == ["points"]
    np.testing.assert_array_equal(found["points"], [[1.0, 2.0, 3.0]])


def test_the_header_counts_faces_and_knows_where_data_begin() -> None:
    data = head("ascii", vertex(FIELDS) + "element face 5\nproperty list uchar int vertex_indices\n")
    header = ply_header(data + b"1 2 3\n")
    assert header.count("face", "tristrips") == 5
    assert header.start == len(data)
    mac = ply_header(data.replace(b"\n", b"\r") + b"\n")  # the first number of the data may look like a line end
    assert (mac.start, mac.elements) == (header.start, header.elements)
    assert ply_header(b"PLY" + data[3:]) == header


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no PLY header"),
        (b"ply\nformat ascii 1.0\n", "no PLY header"),
        (head("martian", vertex(FIELDS)), "line 2 of the PLY header is 'format martian 1.0'"),
        (head("ascii", "element vertex -4\nproperty float x\n"), "line 4 of the PLY header"),
        (head("ascii", "property float x\n"), "line 4 of the PLY header"),
        (head("ascii", vertex([("quad", "x")])), "line 5 of the PLY header"),
        (b"ply\nelement vertex 1\nproperty float x\nend_header\n", "names no format"),
        (head("ascii", "element dot 1\nproperty float x\n"), "expected an element vertex"),
        (head("ascii", vertex(FIELDS[:2])) + b"1 2\n3 4\n", "expected x y z"),
        (head("ascii", vertex(FIELDS[:3])) + b"1 2 3\n4 5 six\n", "word 'six', expected a number"),
        (head("ascii", vertex(FIELDS[:3])) + b"1.00000 2.00000 3.00000\n", "ends in or before its 2 rows of 'vertex'"),
        (head("ascii", vertex(FIELDS[:3], 10**15)) + b"1 2 3\n", "its 1000000000000000 rows"),
        (head("binary_little_endian", vertex(FIELDS, 10**15)) + b"1 2 3\n", "its 1000000000000000 rows"),
        (head("binary_little_endian", "element a 9\nproperty list uchar int b\n" + vertex(FIELDS)), "9 rows of 'a'"),
        (head("ascii", vertex([*FIELDS, ("float", "x")])), "two properties of one name"),
    ],
)
def test_a_damaged_file_says_so_in_one_line(data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_ply_points(data)
    assert "\n" not in str(caught.value)


def mesh(rows: str, faces: list[str], *, more: str = "", kind: str = "face", extra: str = "") -> RawMesh:
    """An ascii file of x y z [and what extra says] and faces with a list of corners [and what more says]."""
    points = rows.split(",")
    elements = vertex([("float", axis) for axis in "xyz"], len(points)).rstrip("\n") + "\n" + extra
    elements += f"element {kind} {len(faces)}\nproperty list uchar int vertex_indices\n{more}"
    return read_ply(head("ascii", elements) + "\n".join([*points, *faces]).encode(), {}.get)


SQUARE = "0 0 0,1 0 0,1 1 0,0 1 0"


def test_polygons_of_any_size_become_triangles_in_their_order() -> None:
    raw = mesh(SQUARE, ["3 0 1 2", "4 0 1 2 3", "2 0 1", "3 0 2 3"])
    np.testing.assert_array_equal(raw.faces, [[0, 1, 2], [0, 1, 2], [0, 2, 3], [0, 2, 3]])
    assert raw.changes == {"faces_under_three_corners": 1}


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("sizes", [(3, 3), (3, 4), (4, 3)])
def test_binary_lists_read_like_ascii_ones(order: str, sizes: tuple[int, int]) -> None:
    form = "binary_little_endian" if order == "<" else "binary_big_endian"
    elements = vertex([("float", axis) for axis in "xyz"], 4) + "element face 2\nproperty uchar flag\n"
    data = head(form, elements + "property list uchar int vertex_index\n")
    data += np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=f"{order}f4").tobytes()
    for size in sizes:
        data += bytes([7, size]) + np.arange(size, dtype=f"{order}i4").tobytes()
    expected = mesh(SQUARE, [" ".join(map(str, [size, *range(size)])) for size in sizes])
    np.testing.assert_array_equal(read_ply(data, {}.get).faces, expected.faces)


def test_rows_may_go_over_lines_and_headers_may_hold_any_text() -> None:
    data = head("ascii", vertex(FIELDS[:3], 3) + "element face 1\nproperty list uchar int vertex_indices\n")
    data = data.replace(b"by hand", "Maßstab".encode("latin-1")) + b"0 0\n0 1 0 0 0\n1 0 3\n0 1 2"
    np.testing.assert_array_equal(read_ply(data, {}.get).faces, [[0, 1, 2]])


def test_strips_wind_alike_and_begin_anew_behind_minus_1() -> None:
    raw = mesh(SQUARE, ["4 0 1 3 2", "8 0 1 2 -1 1 2 2 3"], kind="tristrips")
    np.testing.assert_array_equal(raw.faces, [[0, 1, 3], [1, 2, 3], [0, 1, 2]])
    with pytest.raises(MeshError, match="no triangle"):
        mesh(SQUARE, ["2 0 1"], kind="tristrips")


def test_uv_of_vertices_are_read_under_each_name() -> None:
    for names in (("s", "t"), ("u", "v"), ("texture_u", "texture_v")):
        extra = "".join(f"property float {name}\n" for name in names)
        raw = mesh("0 0 0 .25 .5,1 0 0 1 0,0 1 0 0 1", ["3 0 1 2"], extra=extra)
        np.testing.assert_array_equal(raw.uv, [[0.25, 0.5], [1, 0], [0, 1]])


@pytest.mark.parametrize(("kind", "full"), [("uchar", 255), ("ushort", 65535), ("float", 1.0), ("int", 255)])
def test_colours_are_read_from_each_type(kind: str, full: float) -> None:
    extra = "".join(f"property {kind} {name}\n" for name in ("red", "green", "blue"))
    raw = mesh(f"0 0 0 {full} 0 0,1 0 0 0 {full} 0,0 1 0 0 0 {full}", ["3 0 1 2"], extra=extra)
    np.testing.assert_array_equal(raw.colors, [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]])


def test_colours_of_faces_and_uv_of_corners_split_together() -> None:
    more = "property list uchar float texcoord\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
    raw = mesh(SQUARE, ["3 0 1 2 6 0 0 1 0 1 1 9 8 7", "3 0 2 3 6 0 0 1 1 0 1 1 2 3"], more=more)
    assert raw.colors is not None
    assert raw.uv is not None
    np.testing.assert_array_equal(raw.positions[raw.faces][:, :, :2], raw.uv[raw.faces])
    np.testing.assert_array_equal(raw.colors[raw.faces][..., :3], np.repeat([[[9, 8, 7]], [[1, 2, 3]]], 3, axis=1))
    assert len(raw.positions) == 6


def test_colours_of_vertices_come_before_those_of_faces() -> None:
    names = "".join(f"property uchar {name}\n" for name in ("red", "green", "blue"))
    raw = mesh("0 0 0 1 2 3,1 0 0 1 2 3,0 1 0 1 2 3", ["3 0 1 2 9 9 9"], extra=names, more=names)
    np.testing.assert_array_equal(raw.colors, [[1, 2, 3, 255]] * 3)
    assert raw.changes["dropped_face_colors"] == 1
    assert mesh(SQUARE, ["3 0 1 2 255 255 255"], more=names).colors is None


@pytest.mark.parametrize(
    ("faces", "message"),
    [
        (["3 0 1 4"], "face 0 refers to vertex 4, expected 0 to 3"),
        (["3 0 1 2", "3 0 1 -2"], "face 1 refers to vertex -2"),
        (["2 0 1"], "under three corners"),
        (["3 0 1"], "list of 3 members"),
        (["-3 0 1"], "word '-3'"),
        (["3 0 1 two"], "word 'two'"),
    ],
)
def test_faces_that_are_none_are_refused(faces: list[str], message: str) -> None:
    with pytest.raises(MeshError, match=message):
        mesh(SQUARE, faces)


def test_lists_of_negative_length_are_refused() -> None:
    elements = vertex(FIELDS[:3], 3) + "element face 1\nproperty list int int vertex_indices\n"
    with pytest.raises(MeshError, match="row 0 of PLY element 'face' has a list of -3"):
        read_ply(head("ascii", elements) + b"0 0 0 1 0 0 0 1 0 -3 0 1 2\n", {}.get)


def test_what_is_not_read_is_counted() -> None:
    splat = [("float", name) for name in ("x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "rot_0")]
    assert left_out(ply_header(head("ascii", vertex(splat, 5)))) == {"skipped_splat_shapes": 5}
    other = [*FIELDS, ("float", "quality"), ("int", "label")]
    assert left_out(ply_header(head("ascii", vertex(other) + "element edge 3\nproperty int vertex1\n"))) == {
        "skipped_properties": 2,
        "skipped_elements": 1,
    }
    assert left_out(ply_header(head("ascii", vertex(FIELDS)))) == {}
