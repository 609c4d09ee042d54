"""OFF by hand: keywords, colours, numbers across lines, both binary dialects."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.io.formats.off import read_off
from flexpara.runtime.io.rawmesh import RawMesh

POINTS = "0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
CORNERS = [[0, 1, 2], [0, 2, 3]]


def read(text: str) -> RawMesh:
    return read_off(text.encode())


@pytest.mark.parametrize(
    "text",
    [
        f"OFF\n4 2 0\n{POINTS}3 0 1 2\n3 0 2 3\n",
        f"OFF 4 2 0\n{POINTS}3 0 1 2\n3 0 2 3\n",
        f"OFF4 2 0\n{POINTS}3 0 1 2\n3 0 2 3\n",
        f"4 2 0\n{POINTS}3 0 1 2\n3 0 2 3\n",
        f"OFF\n4 2\n{POINTS}3 0 1 2\n3 0 2 3\n",
        f"# by hand\nOFF # here\n\n4\n2\n0\n{POINTS}3 0 1 2 # one\n3 0 2 3",
        f"OFF\n4 2 0\n{POINTS}3 0\n1\n2 3\n0 2 3\n",
        f"OFF\n4 1 0\n{POINTS}4 0 1 2 3\n",
        f"OFF\n4 1 0\n{POINTS}4 0\n1\n2\n3\n",
        f"OFF\n4 3 0\n{POINTS}3 0 1 2 7\n2 0 1\n3 0 2 3\n",
    ],
)
def test_two_triangles_in_every_dress(text: str) -> None:
    for end in ("\n", "\r\n", "\r"):
        raw = read(text.replace("\n", end))
        np.testing.assert_array_equal(raw.faces, CORNERS)
        np.testing.assert_array_equal(raw.positions[:, :2], [[0, 0], [1, 0], [1, 1], [0, 1]])


def rows(more: str) -> str:
    return POINTS.replace("\n", f" {more}\n")


def test_the_keyword_says_what_vertices_have() -> None:
    faces = "3 0 1 2\n3 0 2 3\n"
    normals = read(f"NOFF\n4 2 0\n{rows('0 0 1')}{faces}")
    np.testing.assert_array_equal(normals.normals, [[0, 0, 1]] * 4)
    both = read(f"STNOFF\n4 2 0\n{rows('0 0 1 .25 .5')}{faces}")
    np.testing.assert_array_equal(both.normals, [[0, 0, 1]] * 4)
    np.testing.assert_array_equal(both.uv, [[0.25, 0.5]] * 4)
    for color in ("51 0 255", "51 0 255 255", "0.2 0 1", "0.2 0.0 1.0 1.0"):
        for keyword in ("COFF", "OFF"):
            np.testing.assert_array_equal(
                read(f"{keyword}\n4 2 0\n{rows(color)}{faces}").colors, [[51, 0, 255, 255]] * 4
            )


def test_colours_of_faces_split_vertices() -> None:
    raw = read(f"OFF\n4 2 0\n{POINTS}3 0 1 2 255 0 0\n3 0 2 3 0 0 1.0 0.5\n")
    assert raw.colors is not None
    assert raw.colors[raw.faces[0]].tolist() == [[255, 0, 0, 255]] * 3
    assert len(raw.positions) == 6
    indexed = read(f"OFF\n4 2 0\n{POINTS}3 0 1 2 5\n3 0 2 3 6\n")
    assert indexed.colors is None


@pytest.mark.parametrize("order", [">", "<"])
@pytest.mark.parametrize("colored", [True, False])
def test_binary_files_read_in_either_order_with_and_without_colours(order: str, colored: bool) -> None:
    points = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=f"{order}f4")
    data = b"OFF BINARY\n" + np.array([4, 2, 0], dtype=f"{order}i4").tobytes() + points.tobytes()
    for corners in CORNERS:
        data += np.array([3, *corners, *([0] if colored else [])], dtype=f"{order}i4").tobytes()
    raw = read_off(data)
    np.testing.assert_array_equal(raw.faces, CORNERS)
    np.testing.assert_array_equal(raw.positions, points)
    with pytest.raises(InputError, match="not as long as its counts"):
        read_off(data[:-4])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "begins with ''"),
        ("hello", "begins with 'hello'"),
        ("4OFF\n1 1 1\n", "expected three dimensions"),
        ("OFF\n4 2 0\n0 0 0\n1 0\n", "7 numbers before"),
        (f"OFF\n4 2 0\n{POINTS}", "face 0 of the OFF file is not readable at its end, line 6"),
        (f"OFF\n4 2 0\n{POINTS}3 0 1 2\n3 0 1\n", r"face 1 of the OFF file \(line 8\) has 3 corners, 2 follow"),
        (f"OFF\n4 1 0\n{POINTS}3 0 1 two\n", "line 7 of the OFF file has .two."),
        (f"OFF\n4 1 0\n{POINTS}3 0 1 4\n", "face 0 refers to vertex 4, expected 0 to 3"),
        (f"OFF\n4 2 0\n{POINTS}2 0 1\n3 0 1 -1\n", "face 1 refers to vertex -1"),
        (f"OFF\n4 1 0\n{POINTS}2 0 1\n", "all 1 faces of the OFF file have under three corners"),
        (f"OFF\n4 0 0\n{POINTS}", "0 faces"),
        ("OFF\n4 one 0\n", "line 2 of the OFF file has 'one'"),
        ("OFF\n-4 1 0\n", "line 2 of the OFF file has the counts '-4 1'"),
        (f"OFF\n4 1 0\n{POINTS.replace('1 1 0', '1 x 0')}3 0 1 2\n", "line 5 of the OFF file has 'x'"),
    ],
)
def test_damage_is_named_by_its_line(text: str, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read(text)
    assert "\n" not in str(caught.value)


def test_a_vertex_beyond_all_integers_is_refused_by_its_line() -> None:
    text = f"OFF\n3 2 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 {10**30}\n4 0 1 2 1\n"
    with pytest.raises(InputError, match=r"face 0 of the OFF file \(line 6\) refers to vertex 1000"):
        read_off(text.encode())
