"""Plain OBJ files are read by array operations: to the same mesh as line by line, and whatever is odd is left alone."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
import pytest

from flexpara.runtime.io.obj import lines
from flexpara.runtime.io.obj.plain import plain_lines
from flexpara.runtime.io.obj.read import read_obj

HEAD = "# made by hand\no thing\nv 0 0 0\nv 1 0 0\nv 1 1 0.5e-3\nv -0 1 0\n"
UV = "vt 0 0\nvt 1 0\nvt 1 1\n"
NORMALS = "vn 0 0 1\n"
PLAIN = {
    "positions": HEAD + "f 1 2 3\nf 1 3 4\n",
    "polygons": HEAD + "f 1 2 3 4\nf 4 3 2\n",
    "uv": HEAD + UV + "f 1/1 2/2 3/3\nf 1/1 3/3 4/2\n",
    "normals": HEAD + NORMALS + "f 1//1 2//1 3//1\n",
    "both": HEAD + UV + NORMALS + "f 1/1/1 2/2/1 3/3/1\n",
    "colours": "v 0 0 0 1 0 0\nv 1 0 0 0 1 0\nv 0 1 0 0 0 1\nf 1 2 3\n",
    "relative": "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nf -3 -2 -1\n",
    "windows": (HEAD + "f 1 2 3\n").replace("\n", "\r\n"),
    "no last line end": HEAD + "f 1 2 3",
    "materials": HEAD + "mtllib a b.mtl\nusemtl red\nf 1 2 3\nusemtl blue  \nf 1 3 4\ns 1\ng x\nl 1 2\np 1\n",
    "blanks": HEAD + "\n\nf  1  2   3 \n",
}
ODD = {
    "comment after a face": HEAD + "f 1 2 3 # last\n",
    "comment after a vertex": "v 0 0 0 # a\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "tab": HEAD + "f\t1 2 3\n",
    "joined lines": HEAD + "f 1 2 \\\n3\n",
    "mixed corners": HEAD + UV + "f 1/1 2/2 3\n",
    "mixed slashes": HEAD + UV + NORMALS + "f 1/1/1 2/2/1 3//1\n",
    "an empty index": HEAD + UV + "f 1/ 2/ 3/\n",
    "a keyword behind a space": HEAD + " f 1 2 3\n",
    "some vertices with colours": "v 0 0 0 1 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    "a face of two corners": HEAD + "f 1 2\nf 1 2 3\n",
    "not a number": "v 0 0 0\nv nan 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 4\n",
    "old line ends": (HEAD + "f 1 2 3\n").replace("\n", "\r"),
    "a mark": "\ufeff" + HEAD + "f 1 2 3\n",
    "an accent": "o caf\u00e9\n" + HEAD + "f 1 2 3\n",
}


def nothing(_: str) -> bytes | None:
    return None


def assert_same(one: Any, other: Any) -> None:
    assert type(one) is type(other)
    for field in fields(one):
        first, second = getattr(one, field.name), getattr(other, field.name)
        if isinstance(first, np.ndarray):
            assert first.dtype == second.dtype
            np.testing.assert_array_equal(first, second)
        elif field.name == "materials":
            assert [material.name for material in first] == [material.name for material in second]
        elif is_dataclass(first):
            assert_same(first, second)
        else:
            assert first == second


@pytest.mark.parametrize("name", PLAIN)
def test_a_plain_file_is_read_as_line_by_line(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    data = PLAIN[name].encode()
    assert plain_lines(data) is not None
    fast = read_obj(data, nothing)
    monkeypatch.setattr(lines, "plain_lines", lambda _: None)
    assert_same(fast, read_obj(data, nothing))


@pytest.mark.parametrize("name", ODD)
def test_an_odd_file_is_read_line_by_line(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    data = ODD[name].encode()
    found = read_obj(data, nothing)
    monkeypatch.setattr(lines, "plain_lines", lambda _: None)
    assert_same(found, read_obj(data, nothing))


@pytest.mark.parametrize("name", [name for name in ODD if name != "a keyword behind a space"])
def test_what_is_odd_is_not_taken_for_plain(name: str) -> None:
    assert plain_lines(ODD[name].encode()) is None


@pytest.mark.parametrize("number", ["0.1", "1e-320", "123456789.123456789", "-7.0000000000000001e22", "+.5", "5."])
def test_numbers_are_those_that_python_reads(number: str) -> None:
    plain = plain_lines(f"v {number} 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\n".encode())
    assert plain is not None
    assert plain.tables[0][0, 0] == float(number)
