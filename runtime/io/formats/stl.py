"""STL, binary and ascii → RawMesh: three vertices a triangle, in the file's order, each facet flat.

Its normal is that of its corners; the one in the file is left out.

Which of the two a file is, its size says: binary are 84 bytes and 50 a triangle, whatever the first word is.
"""

from __future__ import annotations

import re

import numpy as np

from ...errors import MeshError
from ..rawmesh import RawMesh, to_float64
from ..text import decode, number_table

HEADER, RECORD = 84, 50
_FACET = np.dtype([("normal", "<f4", (3,)), ("corner", "<f4", (3, 3)), ("attribute", "<u2")])
_VERTEX = re.compile(r"^[ \t]*vertex\b(.*)$", re.IGNORECASE | re.MULTILINE)
_SOLID = re.compile(r"^[ \t]*solid\b", re.IGNORECASE | re.MULTILINE)
_WORDS = re.compile(rb"\b(facet|vertex|endsolid)\b", re.IGNORECASE)


def read_stl(data: bytes) -> RawMesh:
    """Read an STL file.

    Args:
        data: the bytes of the file.

    Returns:
        Positions (3 f, 3), faces (f, 3).  Counted are bytes behind the last triangle of a binary
        file, and facets with attribute bytes, which some programs take for colours; and solids that are joined.

    Raises:
        MeshError: neither of both, cut off, without triangles, or with numbers that are none; it names the line.
    """
    count = int.from_bytes(data[80:HEADER], "little")
    whole = HEADER + RECORD * count
    if len(data) >= HEADER and len(data) == whole:
        return _binary(data, count)
    if data[:HEADER].lstrip(b"\xef\xbb\xbf \t\r\n")[:5].lower() == b"solid" and _WORDS.search(data):
        return _ascii(data)
    if len(data) > whole >= HEADER and count:
        return _binary(data, count)
    if data.lstrip()[:5].lower() == b"solid":
        raise MeshError("the STL file holds no facet, expected triangles; check the export")
    raise MeshError(
        f"the STL file has {len(data)} bytes, expected {whole} for the {count} triangles of its header, or a text that "
        "begins with 'solid'; it is cut off or damaged: copy or export it again"
    )


def _binary(data: bytes, count: int) -> RawMesh:
    if count == 0:
        raise MeshError("the STL file holds 0 triangles; check the export")
    facets = np.frombuffer(data, dtype=_FACET, count=count, offset=HEADER)
    changes = {
        "trailing_bytes": len(data) - HEADER - RECORD * count,
        "skipped_facet_values": int(np.count_nonzero(facets["attribute"])),
    }
    return _soup(to_float64(facets["corner"].reshape(-1, 3)), changes)


def _ascii(data: bytes) -> RawMesh:
    """All solids of the file as one mesh: every three vertices are a triangle."""
    text = decode(data).replace("\r\n", "\n").replace("\r", "\n")
    rows, numbers, place, line = [], [], 0, 1
    for found in _VERTEX.finditer(text):
        line += text.count("\n", place, found.start())
        place = found.start()
        rows.append(found.group(1))
        numbers.append(line)
    if not rows:
        raise MeshError("the STL file holds no line that starts with 'vertex', expected triangles; check the export")
    if len(rows) % 3:
        raise MeshError(
            f"the STL file holds {len(rows)} vertices (last: line {numbers[-1]}), expected three a facet; it is cut "
            "off or damaged: export it again"
        )
    positions, _ = number_table(rows, numbers, 3, 3)
    solids = len(_SOLID.findall(text))
    return _soup(positions, {"joined_solids": solids if solids > 1 else 0})


def _soup(positions: np.ndarray, changes: dict[str, int]) -> RawMesh:
    faces = np.arange(len(positions), dtype=np.int64).reshape(-1, 3)
    flat = np.zeros(len(faces), dtype=np.int64)
    return RawMesh(positions=positions, faces=faces, smoothing=flat, changes=changes)
