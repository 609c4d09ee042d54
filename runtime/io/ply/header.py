"""Header of a PLY file (Turk 1994): what it says it holds.

An element is a table: so many rows, each with the same properties, a number or a list of numbers each.  A file may come
from anyone: nothing is allocated by what a header promises.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ...errors import MeshError
from ..text import decode, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

MAX_HEADER = 1 << 16
FACES = ("face", "tristrips")
_TYPES = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"}
_TYPES |= {"float": "f4", "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2"}
_TYPES |= {"int32": "i4", "uint32": "u4", "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8"}
_ORDERS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_FIRST = re.compile(rb"(?i:ply)[ \t]*(\r\n|\r|\n)")


@dataclass(frozen=True)
class PlyProperty:
    """One column.  kind: numpy type, without byte order, of its numbers.  count: type of a list's length, else ""."""

    name: str
    kind: str
    count: str = ""


@dataclass(frozen=True)
class PlyElement:
    """One table: name, number of rows, columns."""

    name: str
    count: int
    properties: tuple[PlyProperty, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(entry.name for entry in self.properties)


@dataclass(frozen=True)
class PlyHeader:
    """What a PLY file says it holds.

    order: "" ascii, "<" or ">".  start: bytes before the data.  textures: picture files named in comments
    ("comment TextureFile NAME", as MeshLab writes them).
    """

    order: str
    elements: tuple[PlyElement, ...]
    start: int
    textures: tuple[str, ...] = ()

    def count(self, *names: str) -> int:
        """Rows of the elements of these names."""
        return sum(element.count for element in self.elements if element.name in names)


def ply_header(data: bytes) -> PlyHeader:
    """The header of a PLY file from its first MAX_HEADER bytes or more; its text may be of any encoding.

    Raises: MeshError where it is none; it names the line.
    """
    first = _FIRST.match(data)
    ends = b"|" if first is None else re.escape(first.group(1))  # a binary number may begin with the byte of a line end
    end = re.compile(rb"[\r\n]end_header[ \t]*(?:" + ends + rb"|$)").search(data[:MAX_HEADER])
    if first is None or end is None:
        raise MeshError("no PLY header, expected 'ply' … 'end_header'; export it again")
    text = decode(data[: end.start()]).replace("\r\n", "\n").replace("\r", "\n")
    lines = [line.split() for line in text.split("\n")]
    order, elements = _parse(lines)
    textures = [" ".join(line[2:]) for line in lines if line[:2] == ["comment", "TextureFile"]]
    return PlyHeader(order, tuple(elements), end.end(), tuple(textures))


def _parse(lines: Sequence[Sequence[str]]) -> tuple[str, list[PlyElement]]:
    order: str | None = None
    elements: list[PlyElement] = []
    for number, line in enumerate(lines, start=1):
        try:
            if line and line[0] == "format":
                order = _ORDERS[line[1]]
            elif line and line[0] == "element":
                if not (line[2].isascii() and line[2].isdigit()):
                    raise ValueError
                elements.append(PlyElement(line[1], int(line[2]), ()))
            elif line and line[0] == "property":
                last = elements[-1]
                elements[-1] = PlyElement(last.name, last.count, (*last.properties, _property(line)))
        except (IndexError, KeyError, ValueError) as error:
            raise MeshError(
                f"line {number} of the PLY header is {shown(' '.join(line))}, expected a format, element or property "
                "of PLY 1.0; export it again"
            ) from error
    if order is None:
        raise MeshError("the PLY header names no format, expected ascii or binary_little_endian; export it again")
    for element in elements:
        if len(set(element.names)) < len(element.names):
            raise MeshError(f"PLY element {element.name!r} has two properties of one name; export it again")
    return order, elements


def _property(line: Sequence[str]) -> PlyProperty:
    if line[1] != "list":
        return PlyProperty(line[2], _TYPES[line[1]])
    if _TYPES[line[2]][0] == "f":
        raise ValueError
    return PlyProperty(line[4], _TYPES[line[3]], _TYPES[line[2]])
