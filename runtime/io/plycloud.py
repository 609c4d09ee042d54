"""PLY points: header, ascii and binary, without trimesh.

n points.  Properties x y z, nx ny nz and red green blue [alpha] are taken, whatever their order and type; others are
skipped.  A file may come from anyone: what the header promises is checked against the file's size before anything is
allocated.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

MAX_HEADER = 1 << 16
_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
_TYPES |= {"int32": "i4", "uint32": "u4", "float32": "f4", "float64": "f8"}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}


@dataclass(frozen=True)
class PlyElement:
    """One element of a PLY file: name, count, and its properties' (name, numpy type); type "" is a list."""

    name: str
    count: int
    properties: tuple[tuple[str, str], ...]


@dataclass(frozen=True)
class PlyHeader:
    """What a PLY file says it holds.  order: "" ascii, "<" or ">".  start: bytes before the data."""

    order: str
    elements: tuple[PlyElement, ...]
    start: int

    @property
    def faces(self) -> int:
        """Number of faces and triangle strips."""
        return sum(element.count for element in self.elements if element.name in ("face", "tristrips"))


def ply_header(data: bytes) -> PlyHeader:
    """The header of a PLY file from its first MAX_HEADER bytes or more.

    Raises: InputError where it is none.
    """
    head, mark, _ = data[:MAX_HEADER].partition(b"end_header")
    if not mark or not data.startswith(b"ply"):
        raise InputError("no PLY header, expected 'ply' … 'end_header'; export it again")
    end = data.find(b"\n", len(head))
    end = data.find(b"\r", len(head)) if end < 0 else end
    try:
        lines = [line.split() for line in head.decode("ascii", errors="replace").splitlines()]
        order = next(_ORDERS[line[1]] for line in lines if line and line[0] == "format")
        return PlyHeader(order, tuple(_elements(lines)), (len(head) + len(mark) if end < 0 else end) + 1)
    except (StopIteration, IndexError, KeyError, ValueError) as error:
        raise InputError(f"the PLY header is damaged ({type(error).__name__}: {error}); export it again") from error


def _elements(lines: Sequence[Sequence[str]]) -> list[PlyElement]:
    found: list[PlyElement] = []
    for line in lines:
        if line and line[0] == "element":
            if not line[2].isdigit():
                raise ValueError(f"count {line[2]!r}")
            found.append(PlyElement(line[1], int(line[2]), ()))
        elif line and line[0] == "property":
            kind = "" if line[1] == "list" else _TYPES[line[1]]
            found[-1] = PlyElement(found[-1].name, found[-1].count, (*found[-1].properties, (line[-1], kind)))
    return found


def read_ply_points(data: bytes) -> dict[str, NDArray[Any]]:
    """Positions, normals and colours of the vertices of a PLY file.

    Args:
        data: the file's bytes.

    Returns:
        "points" (n, 3) float64, and where the file has them "normals" (n, 3) float64 and "colors" (n, 3 or 4) uint8.

    Raises:
        InputError: damaged, shorter than its header says, or without x y z.
    """
    header = ply_header(data)
    names = [element.name for element in header.elements]
    if "vertex" not in names:
        raise InputError(f"the PLY file holds {names}, expected an element vertex; check the export")
    vertex = header.elements[names.index("vertex")]
    before = header.elements[: names.index("vertex")]
    columns = [name for name, _ in vertex.properties]
    if len(set(columns)) < len(columns) or any(
        not kind for element in (*before, vertex) for _, kind in element.properties
    ):
        raise InputError("the PLY file has lists or repeated properties before or in its vertices; export it plainly")
    groups = {"points": ("x", "y", "z"), "normals": ("nx", "ny", "nz"), "colors": ("red", "green", "blue", "alpha")}
    found = {group: [name for name in members if name in columns] for group, members in groups.items()}
    if len(found["points"]) < 3:
        raise InputError(f"the PLY vertices have {columns}, expected x y z; check the export")
    rows = _binary_rows(data, header, before, vertex) if header.order else _ascii_rows(data, header, before, vertex)
    result = {
        group: np.stack([rows[name] for name in members], axis=1)
        for group, members in found.items()
        if len(members) >= 3
    }
    return {name: values if name == "colors" else values.astype(np.float64) for name, values in result.items()}


def _binary_rows(data: bytes, header: PlyHeader, before: Sequence[PlyElement], vertex: PlyElement) -> NDArray[np.void]:
    """(n,) structured rows of the vertices."""
    record = np.dtype([(name, header.order + kind) for name, kind in vertex.properties])
    skipped = sum(element.count * sum(np.dtype(kind).itemsize for _, kind in element.properties) for element in before)
    start = header.start + skipped
    needed = start + vertex.count * record.itemsize
    if needed > len(data):
        raise InputError(
            f"the PLY file has {len(data)} bytes, its header promises {needed} or more; it is cut off: copy it again"
        )
    return np.frombuffer(data, dtype=record, count=vertex.count, offset=start)


def _ascii_rows(data: bytes, header: PlyHeader, before: Sequence[PlyElement], vertex: PlyElement) -> NDArray[np.void]:
    """(n,) structured rows of the vertices, each on a line of its own."""
    skipped = sum(element.count for element in before)
    needed = header.start + 2 * len(vertex.properties) * vertex.count
    if needed > len(data) + 1:
        raise InputError(
            f"the PLY file has {len(data)} bytes, its header promises {vertex.count} vertices; copy it again"
        )
    lines = [line for line in data[header.start :].decode("ascii", errors="replace").splitlines() if line.strip()]
    own = lines[skipped : skipped + vertex.count]
    if len(own) < vertex.count:
        raise InputError(
            f"the PLY file has {len(own)} lines of vertices, its header promises {vertex.count}; copy it again"
        )
    record = np.dtype([(name, kind) for name, kind in vertex.properties])
    try:
        return np.loadtxt(own, dtype=record, ndmin=1) if own else np.zeros(0, dtype=record)
    except (ValueError, OverflowError) as error:
        raise InputError(f"the PLY vertices are not readable ({error}); export it again") from error
