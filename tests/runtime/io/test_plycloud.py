"""PLY points by hand: every order of bytes and columns, and headers that lie."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.io.plycloud import ply_header, read_ply_points

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
    np.testing.assert_array_equal(found["colors"], [[10, 20, 30], [40, 50, 60]])
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
    assert header.faces == 5
    assert header.start == len(data)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "no PLY header"),
        (b"ply\nformat ascii 1.0\n", "no PLY header"),
        (head("martian", vertex(FIELDS)), "damaged"),
        (head("ascii", "element vertex -4\nproperty float x\n"), "damaged"),
        (head("ascii", "property float x\n"), "damaged"),
        (head("ascii", vertex([("quad", "x")])), "damaged"),
        (head("ascii", "element dot 1\nproperty float x\n"), "expected an element vertex"),
        (head("ascii", vertex(FIELDS[:2])) + b"1 2\n3 4\n", "expected x y z"),
        (head("ascii", vertex(FIELDS[:3])) + b"1 2 3\n4 5 six\n", "not readable"),
        (head("ascii", vertex(FIELDS[:3])) + b"1.00000 2.00000 3.00000\n", "1 lines of vertices"),
        (head("ascii", vertex(FIELDS[:3], 10**15)) + b"1 2 3\n", "header promises 1000000000000000 vertices"),
        (head("binary_little_endian", vertex(FIELDS, 10**15)) + b"1 2 3\n", "header promises"),
        (head("binary_little_endian", "element a 9\nproperty list uchar int b\n" + vertex(FIELDS)), "lists"),
        (head("ascii", vertex([*FIELDS, ("float", "x")])), "repeated"),
    ],
)
def test_a_damaged_file_says_so_in_one_line(data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_ply_points(data)
    assert "\n" not in str(caught.value)
