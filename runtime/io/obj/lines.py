"""The lines of an OBJ file by kind: at once where it is plain, else one by one.   c corners of all faces.

Lines count from 1.  A backslash at the end joins the next line.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...errors import MeshError
from ..text import lines_of, number_table, shown
from .plain import plain_lines

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

KINDS = ("v", "vt", "vn", "f", "usemtl", "mtllib", "l", "p", "s")
TABLES = KINDS[:4]
"""Kinds of which a file has as many lines as vertices and faces."""


@dataclass(frozen=True, eq=False)
class Lines:
    """The file by kind of line.

    text: after the keyword; of a plain file not that of v, vt, vn and f.  number: line number of each.
    tables: of a plain file the numbers (n, c) of v, vt and vn.  faces: its corners (c, 3), as the file counts and 0
    where absent, and how many each face has (p,).
    """

    text: dict[str, list[str]]
    number: dict[str, NDArray[np.int64]]
    tables: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    faces: tuple[NDArray[np.int64], NDArray[np.int64]] | None = None

    def count(self, kind: str) -> int:
        """How many lines of a kind there are."""
        return len(self.number[kind])

    def numbers(self, kind: str, least: int, most: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """As ``text.number_table``."""
        if kind not in self.tables:
            return number_table(self.text[kind], self.number[kind], least, most)
        table = self.tables[kind][:, :most]
        columns = max(table.shape[1], least)
        return table.reshape(len(table), columns), np.full(len(table), columns, dtype=np.int64)


def split(data: bytes) -> Lines:
    """The lines by kind.  Raises: MeshError where there is no face."""
    plain = plain_lines(data)
    found, number = sorted_lines(enumerate(lines_of(data), start=1) if plain is None else plain.others)
    lines = Lines(found, number)
    if plain is not None and not any(found[kind] for kind in TABLES):
        number |= dict(zip(TABLES, plain.number, strict=True))
        lines = Lines(found, number, dict(zip(TABLES, plain.tables, strict=False)), (plain.corners, plain.size))
    elif plain is not None:  # a keyword behind spaces
        lines = Lines(*sorted_lines(enumerate(lines_of(data), start=1)))
    if not data.strip():
        raise MeshError("the file is empty, expected a mesh; export it again")
    if not lines.count("f"):
        raise MeshError(
            "the file holds points and no faces, expected faces; give points as .ply, .xyz or .npy"
            if lines.count("v")
            else "no vertex and no face in this OBJ file (lines that start with 'v' and 'f'), expected a mesh; "
            f"it begins with {shown(decode_head(data))}: check the export"
        )
    return lines


def sorted_lines(lines: Iterable[tuple[int, str]]) -> tuple[dict[str, list[str]], dict[str, NDArray[np.int64]]]:
    """Text and number of lines, by kind."""
    found: dict[str, list[str]] = {kind: [] for kind in KINDS}
    number: dict[str, list[int]] = {kind: [] for kind in KINDS}
    waiting = ""
    for index, line in lines:
        if line.endswith("\\"):
            waiting += line[:-1] + " "
            continue
        kind, _, rest = (waiting + line).replace("\t", " ").lstrip().partition(" ")
        waiting = ""
        if kind in found:
            found[kind].append(rest.strip() if kind in ("usemtl", "mtllib") else rest.partition("#")[0])
            number[kind].append(index)
    return found, {kind: np.array(value, dtype=np.int64) for kind, value in number.items()}


def decode_head(data: bytes) -> str:
    """The first line that is not empty."""
    return next((line for line in lines_of(data[:1000]) if line.strip()), "")
