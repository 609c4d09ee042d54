"""An OBJ file beside the mesh that is read of it: its lines as they are, and which of them are the polygons.

A statement is a line, those joined by a backslash at the end being one.  v, vt, vn: positions, uv, normals.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...brief import Brief
from ..text import lines_of
from .plain import is_odd

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

NAMING = ("o", "g", "s")
CURVED = ("curv", "curv2", "surf")
"""Keywords of what is given by formulas."""
PICTURES = {"base-color": "map_Kd", "emissive": "map_Ke", "normal": "norm"}
"""Map → keyword of its line in a material library."""
TEXTURES = ("map_", "bump", "norm", "disp", "decal", "refl")
"""Beginnings of the lines of a material library that name pictures."""


@dataclass(frozen=True, eq=False, repr=False)
class ObjText(Brief):
    """The text.

    data: the bytes of the file.  line: (p,) int64, the number of the (last) line of each polygon, from 1.  corners:
    (c, 3) int64, v, vt and vn of each corner of all polygons, from 0, −1 where absent.  size: (p,) int64, corners of
    each polygon.  materials: the text of its libraries, "" without any.
    """

    data: bytes
    line: NDArray[np.int64]
    corners: NDArray[np.int64]
    size: NDArray[np.int64]
    materials: str = ""

    @cached_property
    def statements(self) -> dict[int, str]:
        """All statements by the number of their last line, in their order."""
        found, waiting = dict[int, str](), ""
        for number, line in enumerate(lines_of(self.data), start=1):
            waiting += line
            if line.endswith("\\"):
                waiting = waiting[:-1] + " "
            else:
                found[number], waiting = waiting, ""
        return found

    @cached_property
    def beyond(self) -> Counter[str]:
        """How many statements there are of each keyword; of a plain file without those of v and f."""
        others = besides_tables(self.data)
        return Counter(keyword(line) for line in (self.statements.values() if others is None else others))

    @cached_property
    def objects(self) -> tuple[NDArray[np.int64], list[str]]:
        """(p,) number of the object of each polygon, or of the group where there are no objects, and their names.

        The first name is "", for what stands before any.
        """
        kind = next((name for name in NAMING[:2] if self.beyond[name]), "")
        if not kind:
            return np.zeros(len(self.line), np.int64), [""]
        named = {number: line for number, line in self.statements.items() if keyword(line) == kind}
        names = ["", *(" ".join(line.split()[1:]) for line in named.values())]
        place = {name: number for number, name in enumerate(dict.fromkeys(names))}
        at = np.searchsorted(np.array(list(named)), self.line)
        return np.array([place[name] for name in names], dtype=np.int64)[at], list(place)

    def beyond_meshes(self, *, objects: bool = True) -> dict[str, int]:
        """What other formats have no word for: named objects and groups, smoothing groups, lines and points.

        objects: whether names of objects are among it, or of groups where there are no objects.
        """
        kept = "" if objects else next((name for name in NAMING[:2] if self.beyond[name]), "")
        counts = {
            "skipped_names": sum(self.beyond[kind] for kind in NAMING if kind != kept),
            "skipped_lines": self.beyond["l"],
            "skipped_points": self.beyond["p"],
            "skipped_curves": sum(self.beyond[kind] for kind in CURVED),
        }
        return {name: count for name, count in counts.items() if count}

    def pictures(self, maps: Sequence[str]) -> int:
        """How many pictures its materials name that none of the maps baked takes the place of."""
        baked = {PICTURES[name].lower() for name in maps if name in PICTURES}
        return sum(is_picture(line) and keyword(line) not in baked for line in self.materials.split("\n"))


def besides_tables(data: bytes) -> list[str] | None:
    """The lines that begin with neither v nor f; None where lines may be joined, or end otherwise than most do."""
    if is_odd(data):
        return None
    letters = np.frombuffer(data + b"\n", dtype=np.uint8)
    end = np.flatnonzero(letters == ord("\n"))
    start = np.concatenate([[0], end[:-1] + 1])
    others = np.flatnonzero(~np.isin(letters[start], list(b"vVfF\n")))
    return [data[first:last].decode() for first, last in zip(start[others].tolist(), end[others].tolist(), strict=True)]


def keyword(line: str) -> str:
    """The first word, in small letters."""
    words = line.split(maxsplit=1)
    return words[0].lower() if words else ""


def is_picture(line: str) -> bool:
    """Whether a line of a material library names a picture."""
    return keyword(line).startswith(TEXTURES)
