"""STL by hand: binary and ascii are told apart by size, not by the first word."""

from __future__ import annotations

import struct

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.io.formats.stl import read_stl

CORNERS = np.array([[[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]], dtype=np.float32)


def binary(header: bytes = b"", count: int = 2, attribute: bytes = b"\0\0") -> bytes:
    records = [struct.pack("<3f", 0, 0, 1) + corner.astype("<f4").tobytes() + attribute for corner in CORNERS]
    return header.ljust(80, b" ")[:80] + struct.pack("<I", count) + b"".join(records)


def ascii(name: str = "x") -> str:
    text = f"solid {name}\n"
    for corners in CORNERS:
        lines = "".join(f"   vertex {x:g} {y:g} {z:g}\n" for x, y, z in corners)
        text += f" facet normal 0 0 1\n  outer loop\n{lines}  endloop\n endfacet\n"
    return text + f"endsolid {name}\n"


@pytest.mark.parametrize("header", [b"", b"solid of an exporter", b"solid facet vertex endsolid"])
def test_a_binary_file_of_the_right_size_is_binary_whatever_its_header(header: bytes) -> None:
    raw = read_stl(binary(header))
    np.testing.assert_array_equal(raw.positions[raw.faces], CORNERS)
    assert raw.normals is None
    assert raw.smoothing is not None
    assert raw.smoothing.tolist() == [0, 0]
    assert not any(raw.changes.values())


def test_bytes_behind_the_last_triangle_are_counted() -> None:
    raw = read_stl(binary(b"solid") + b"made by hand")
    np.testing.assert_array_equal(raw.positions[raw.faces], CORNERS)
    assert {name: count for name, count in raw.changes.items() if count} == {"trailing_bytes": 12}


def test_attributes_of_facets_which_no_output_holds_are_counted() -> None:
    assert read_stl(binary(attribute=b"\1\2")).changes["skipped_facet_values"] == 2


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("encoding", ["utf-8", "latin-1", "utf-8-sig"])
def test_ascii_files_read_in_any_case_and_encoding(end: str, encoding: str) -> None:
    for text in (ascii("Körper"), ascii("vertex 1 2 3 facet").upper(), " " + ascii().replace("vertex ", "vertex\t")):
        raw = read_stl(text.replace("\n", end).encode(encoding))
        np.testing.assert_array_equal(raw.positions[raw.faces], CORNERS)


def test_all_solids_of_a_file_are_one_mesh() -> None:
    raw = read_stl((ascii("one") + ascii("two")).encode())
    assert len(raw.faces) == 4
    assert raw.changes == {"joined_solids": 2}
    assert read_stl(ascii("one").encode()).changes == {"joined_solids": 0}


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "has 0 bytes"),
        (b"nothing", "has 7 bytes"),
        (binary(count=3), "expected 234 for the 3 triangles"),
        (binary(count=0), "expected 84 for the 0 triangles"),
        (b"\0" * 84, "0 triangles"),
        (b"solid nothing\nendsolid\n", "no line that starts with 'vertex'"),
        (b"solid nothing\n", "no facet"),
        (ascii().replace("vertex 1 1 0", "vertex 1 one 0").encode(), r"line 12 holds what is no number \('1 one 0'"),
        (ascii().replace("vertex 1 1 0", "vertex 1 1").encode(), "line 12 has 2 numbers"),
        (ascii().replace("vertex 1 1 0", "").encode(), "5 vertices .last: line 13."),
    ],
)
def test_damage_is_named(data: bytes, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        read_stl(data)
    assert "\n" not in str(caught.value)
