"""OFF (Geomview), ascii and binary → RawMesh.

n vertices · p polygons.  The first word says what a vertex line holds behind x y z: [ST][C][N][4][n]OFF, in the order
normal, colour, uv; the word may be missing.  # starts a comment.  Numbers are read word by word, so a polygon may go
over several lines; what stands behind its indices in the same line is its colour.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...errors import MeshError
from ...mesh import Polygons
from ..pictures.colors import as_rgba
from ..polygons import triangles_of
from ..rawmesh import RawMesh, split_at_corners, to_float64
from ..text import is_number, lines_of, shown

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

_MAGIC = re.compile(r"(ST)?(C)?(N)?(4)?(n)?OFF", re.ASCII)
BINARY = re.compile(rb"\s*(ST)?(C)?(N)?OFF[ \t]+BINARY[ \t]*\r?\n")


LARGEST_NUMBER = 2**40
"""Beyond, no vertex has such a number."""


@dataclass(frozen=True, eq=False)
class _Words:
    """The file without comments: text of each word, and its line."""

    text: list[str]
    line: list[int]

    def numbers(self, start: int, stop: int) -> NDArray[np.float64]:
        """Words as float64.  Raises: MeshError where they end before, or where one is no number."""
        words = self.text[start:stop]
        if len(words) < stop - start:
            raise MeshError(
                f"the OFF file ends at line {self.line[-1] if self.line else 1}, "
                f"{stop - start - len(words)} numbers before what its counts promise; export it again"
            )
        try:
            return np.array(list(map(float, words)))
        except ValueError as error:
            place = start + next(index for index, word in enumerate(words) if not is_number(word))
            raise MeshError(
                f"line {self.line[place]} of the OFF file has {shown(self.text[place])}, expected a number; "
                "mend that line or export it again"
            ) from error


def read_off(data: bytes) -> RawMesh:
    """Read an OFF file.

    Args:
        data: the bytes of the file.

    Raises:
        MeshError: damaged, shorter than its counts, of four or n dimensions, without polygons; it names the line.
    """
    if BINARY.match(data):
        return _binary(data)
    words = _words(data)
    place, extra = _magic(words)
    counts = words.numbers(place, place + 2)
    vertex_count, polygon_count = (int(count) if 0 <= count < 2**40 else -1 for count in counts)
    if vertex_count < 0 or polygon_count < 0 or (counts != np.rint(counts)).any():
        raise MeshError(
            f"line {words.line[place]} of the OFF file has the counts "
            f"{shown(' '.join(words.text[place : place + 2]))}, expected numbers of vertices and faces; export it again"
        )
    own = words.line[place : place + 3]
    place += 3 if len(own) == 3 and (own[1] == own[2] or own[0] != own[1]) else 2  # the edges are often left out
    width = _vertex_width(words, place, vertex_count, extra)
    table = words.numbers(place, place + vertex_count * width).reshape(vertex_count, width)
    corners, size, colors = _polygons(words, place + vertex_count * width, polygon_count)
    return _mesh(table, extra, corners, size, colors)


def _words(data: bytes) -> _Words:
    text: list[str] = []
    numbers: list[int] = []
    for number, line in enumerate(lines_of(data), start=1):
        found = line.partition("#")[0].split()
        if not text and found and found[0][-1].isdecimal():
            found = [word for word in re.split(r"(?<=OFF)(?=\d)", found[0]) if word] + found[1:]  # "OFF8 12 0"
        text += found
        numbers += [number] * len(found)
    return _Words(text, numbers)


def _magic(words: _Words) -> tuple[int, str]:
    """Where the counts start, and what vertices have beside x y z: letters of N (normal), C (colour), T (uv)."""
    found = _MAGIC.fullmatch(words.text[0]) if words.text else None
    if found is None:
        if not words.text or not is_number(words.text[0]):
            raise MeshError(
                f"the file begins with {shown(words.text[0] if words.text else '')}, expected OFF; check the export"
            )
        return 0, ""
    if found.group(4) or found.group(5):
        raise MeshError(f"the file is {words.text[0]}, expected three dimensions (OFF, COFF, NOFF, …); convert it")
    return 1, ("N" if found.group(3) else "") + ("C" if found.group(2) else "") + ("T" if found.group(1) else "")


def _vertex_width(words: _Words, place: int, count: int, extra: str) -> int:
    """Numbers of a vertex: what its keyword says; colours may have three or four, so there a line tells."""
    least = 3 + 3 * ("N" in extra) + 2 * ("T" in extra)
    line = words.line[place : place + least + 8]
    own = line.count(line[0]) if line else 0
    if "C" in extra:
        return own if own in (least + 3, least + 4) else least + 4
    # Many programs write colours without saying so: lines that are all alike longer.
    if own in (least + 3, least + 4) and count and not extra:
        lines = words.line[place : place + count * own]
        if (
            len(lines) == count * own
            and all(lines[k * own] == lines[(k + 1) * own - 1] for k in range(count))
            and all(lines[k * own] != lines[k * own - 1] for k in range(1, count))
        ):
            return own
    return least


def _polygons(
    words: _Words, place: int, count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], dict[int, Sequence[str]]]:
    """(c,) int64 corners, (p,) int64 sizes, and the words behind the indices of polygons that have some."""
    table = _uniform_polygons(words, place, count)
    if table is not None:
        return table.ravel(), np.full(count, table.shape[1]), {}
    corners: list[int] = []
    size: list[int] = []
    colors: dict[int, Sequence[str]] = {}
    for index in range(count):
        own = _polygon(words, place, index)
        corners += own
        size.append(len(own))
        last = words.line[place + len(own)]
        place += 1 + len(own)
        start = place
        while place < len(words.text) and words.line[place] == last:
            place += 1
        if place > start:
            colors[index] = words.text[start:place]
    return np.array(corners, dtype=np.int64), np.array(size, dtype=np.int64), colors


def _uniform_polygons(words: _Words, place: int, count: int) -> NDArray[np.int64] | None:
    """(p, s) corners of polygons that all have s of them, and no colours; None where they are not like that."""
    text, end = words.text, len(words.text)
    if not count or place >= end or not text[place].isdecimal():
        return None
    width = int(text[place]) + 1
    if count * width != end - place or set(text[place::width]) != {text[place]}:
        return None
    table = words.numbers(place, end).reshape(count, width)[:, 1:]
    whole = (table == np.rint(table)) & (np.abs(table) < LARGEST_NUMBER)
    return table.astype(np.int64) if whole.all() else None


def _polygon(words: _Words, place: int, index: int) -> list[int]:
    """The corners of the polygon at a word, which is their number.  Raises: MeshError where they are not there."""
    text, line = words.text, words.line
    try:
        number = int(text[place])
        own = list(map(int, text[place + 1 : place + 1 + number]))
    except (IndexError, ValueError) as error:
        at = f"line {line[place]}" if place < len(text) else f"its end, line {line[-1] if line else 1},"
        raise MeshError(
            f"face {index} of the OFF file is not readable at {at} expected a count and as many whole numbers; "
            "it is cut off or damaged: export it again"
        ) from error
    if any(abs(corner) >= LARGEST_NUMBER for corner in own):
        found = str(max(own, key=abs))[:20]
        raise MeshError(
            f"face {index} of the OFF file (line {line[place]}) refers to vertex {found}, expected one that exists; "
            "it is damaged: export it again"
        )
    if number < 0 or len(own) < number:
        raise MeshError(
            f"face {index} of the OFF file (line {line[place]}) has {number} corners, {len(own)} follow; it is cut "
            "off or damaged: export it again"
        )
    return own


def _mesh(
    table: NDArray[np.float64],
    extra: str,
    corners: NDArray[np.int64],
    size: NDArray[np.int64],
    face_colors: dict[int, Sequence[str]],
) -> RawMesh:
    positions = table[:, :3]
    found = triangles_of(positions, corners, size, "OFF")
    normals = 3 * ("N" in extra)
    color_end = table.shape[1] - 2 * ("T" in extra)
    part = RawMesh(
        positions=positions,
        faces=found.faces,
        normals=table[:, 3:6] if normals else None,
        colors=_rgba(table[:, 3 + normals : color_end]),
        uv=table[:, -2:] if "T" in extra else None,
        changes={"faces_under_three_corners": found.left_out},
        polygons=Polygons(found.corner, size),
    )
    colors = _face_rgba(face_colors, len(size)) if part.colors is None else None
    if colors is None:
        return part
    return split_at_corners(part, colors=np.repeat(colors[found.polygon][:, None], 3, axis=1))


def _rgba(colors: NDArray[np.float64]) -> NDArray[np.uint8] | None:
    """(n, 4) uint8 of (n, 3 or 4) numbers, from 0 to 255 if any is above 1, else from 0 to 1."""
    if colors.shape[1] not in (3, 4):
        return None
    return as_rgba(colors / 255.0 if np.nan_to_num(colors).max(initial=0.0) > 1.0 else colors)


def _face_rgba(words: dict[int, Sequence[str]], count: int) -> NDArray[np.uint8] | None:
    """(p, 4) uint8, white where a polygon has none; None where no polygon has three or four numbers.

    A single number would be a place in a colour table of Geomview's.
    """
    known = {index: own for index, own in words.items() if len(own) in (3, 4) and all(map(is_number, own))}
    if not known:
        return None
    whole = any("." not in word and float(word) > 1.0 for own in known.values() for word in own)
    colors = np.ones((count, 4))
    for index, own in known.items():
        colors[index, : len(own)] = [float(word) / (255.0 if whole else 1.0) for word in own]
    return as_rgba(colors)


def _binary(data: bytes) -> RawMesh:
    """Big-endian with colours of faces as Geomview writes it, or little-endian without, as some programs do.

    The size of the file decides.
    """
    found = BINARY.match(data)
    assert found is not None
    extra = "".join(letter for letter, group in (("N", 3), ("C", 2), ("T", 1)) if found.group(group))
    width = 3 + 3 * ("N" in extra) + 4 * ("C" in extra) + 2 * ("T" in extra)
    for order in (">", "<"):
        for colored in (True, False):
            read = _binary_as(data[found.end() :], order, width, colored=colored)
            if read is not None:
                return _mesh(read[0], extra, read[1], read[2], {})
    raise MeshError(
        "the binary OFF file is not as long as its counts say, big- or little-endian; it is cut off or damaged: "
        "export it again"
    )


def _binary_as(
    data: bytes, order: str, width: int, *, colored: bool
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]] | None:
    """Vertices, corners and sizes, or None where the bytes don't end with the last polygon."""
    whole = np.frombuffer(data, dtype=f"{order}i4", count=len(data) // 4).astype(np.int64)
    if len(whole) < 3 or len(data) % 4 or min(whole[:2]) < 0 or 3 + whole[0] * width + whole[1] > len(whole):
        return None
    place = 3 + int(whole[0]) * width
    table = np.frombuffer(data, dtype=f"{order}f4", count=place - 3, offset=12).reshape(-1, width)
    corners, size = [], []
    for _ in range(int(whole[1])):
        if place >= len(whole) or not 0 <= whole[place] <= len(whole) - place - 1 - colored:
            return None
        number = int(whole[place])
        corners.append(whole[place + 1 : place + 1 + number])
        size.append(number)
        place += 1 + number
        if colored:
            place += 1 + max(int(whole[place]), 0)
    if place != len(whole):
        return None
    return to_float64(table), np.concatenate([np.zeros(0, dtype=np.int64), *corners]), np.array(size, dtype=np.int64)
