"""The lines of an OBJ file without oddities, taken apart by array operations: a million faces in about a second.

b bytes · l lines · w words.  Plain is a file whose v, vt, vn and f stand at the start of their lines, before a space
and numbers alone; all lines of v have as many numbers, and so of vt and vn; all corners have the same form.  Whatever
is mixed, commented or damaged is left to `lines`, which goes line by line and names what is wrong.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

KEYWORDS = (b"v ", b"vt ", b"vn ", b"f ")
LEAST = (2, 1, 3, 3)
"""Numbers, or corners, that a line has at least."""
ODD = (b"\\", b"\t", b"\x00", b"\xef\xbb\xbf")
"""What no plain file holds: joined lines, tabs, UTF-16, a byte order mark."""
ALLOWED = (b"0123456789+-.eE \r\n", b"0123456789-/ \r\n")
"""Bytes of lines of numbers, and of lines of corners."""
COLUMNS = {0: (0,), 1: (0, 1), 2: (0, 1, 2)}
"""Slashes of a corner → which of v, vt, vn its numbers are."""


class Plain(NamedTuple):
    """What a plain file holds.

    tables: of v, vt and vn, (l, c) float64 each.  corners: (c, 3) int64 of all faces, as the file counts, 0 where
    absent.  size: (p,) int64 corners of each face.  number: line numbers from 1 of v, vt, vn and f, int64 each.
    others: number and text of every other line.
    """

    tables: tuple[NDArray[np.float64], ...]
    corners: NDArray[np.int64]
    size: NDArray[np.int64]
    number: tuple[NDArray[np.int64], ...]
    others: list[tuple[int, str]]


class Block(NamedTuple):
    """The lines of one kind without their keywords: text, (l,) words of each line, (w,) slashes of each word."""

    text: bytes
    words: NDArray[np.int64]
    slashes: NDArray[np.int64]


def plain_lines(data: bytes) -> Plain | None:
    """The file, None where it is not plain."""
    if is_odd(data):
        return None
    letters = np.frombuffer(data if data.endswith(b"\n") else data + b"\n", dtype=np.uint8)
    end = np.flatnonzero(letters == ord("\n")) + 1
    start = np.concatenate([[0], end[:-1]])
    kind = kinds(letters, start)
    blocks = [block(letters, start, end, kind == code, code) for code in range(len(KEYWORDS))]
    if any(found is None for found in blocks):
        return None
    *numbers, faces = (found for found in blocks if found is not None)
    tables, corners = [number_table(found) for found in numbers], corner_table(faces)
    if corners is None or any(table is None for table in tables):
        return None
    others = [
        (line + 1, data[start[line] : end[line]].decode().strip("\r\n")) for line in np.flatnonzero(kind < 0).tolist()
    ]
    number = tuple(np.flatnonzero(kind == code) + 1 for code in range(len(KEYWORDS)))
    return Plain(tuple(table for table in tables if table is not None), corners, faces.words, number, others)


def is_odd(data: bytes) -> bool:
    """Whether lines may be joined, indented by tabs, of other letters than ASCII, or end otherwise than most do."""
    return any(odd in data for odd in ODD) or data.count(b"\r") != data.count(b"\r\n") or not data.isascii()


def kinds(letters: NDArray[np.uint8], start: NDArray[np.int64]) -> NDArray[np.int64]:
    """(l,) which of the keywords each line begins with, −1 for none; letters (b,), start (l,) of each line."""
    kind = np.full(len(start), -1, dtype=np.int64)
    padded = np.concatenate([letters, np.zeros(4, dtype=np.uint8)])
    for code, keyword in enumerate(KEYWORDS):
        same = np.ones(len(start), dtype=bool)
        for place, letter in enumerate(keyword):
            same &= padded[start + place] == letter
        kind[same] = code
    return kind


def block(
    letters: NDArray[np.uint8], start: NDArray[np.int64], end: NDArray[np.int64], chosen: NDArray[np.bool_], code: int
) -> Block | None:
    """The chosen (l,) lines of letters (b,); None where they hold other bytes or fewer words than their kind may."""
    rows = np.flatnonzero(chosen)
    text = letters[np.repeat(chosen, end - start)].copy()
    length = (end - start)[rows]
    first = np.cumsum(length) - length
    for place in range(len(KEYWORDS[code]) - 1):
        text[first + place] = ord(" ")
    allowed = np.zeros(256, dtype=bool)
    allowed[list(ALLOWED[code == len(KEYWORDS) - 1])] = True
    if not allowed[text].all():
        return None
    blank = text <= ord(" ")
    begins = np.flatnonzero(~blank & np.concatenate([[True], blank[:-1]]))
    line = np.searchsorted(first, begins, "right") - 1
    words = np.bincount(line, minlength=len(rows))
    if words.min(initial=LEAST[code]) < LEAST[code]:
        return None
    slashes = np.add.reduceat((text == ord("/")).astype(np.int64), begins) if len(begins) else begins
    return Block(text.tobytes(), words, slashes)


def number_table(found: Block) -> NDArray[np.float64] | None:
    """(l, c) float64 of lines with c numbers each; None where they differ, or a word is no number."""
    columns = int(found.words.max(initial=0))
    if found.words.min(initial=columns) < columns:
        return None
    try:
        return np.array(list(map(float, found.text.split())), dtype=np.float64).reshape(len(found.words), columns)
    except ValueError:
        return None


def corner_table(found: Block) -> NDArray[np.int64] | None:
    """(w, 3) int64 of corners, all of one form: 7, 7/8, 7//9 or 7/8/9; None where they differ."""
    slashes = int(found.slashes.max(initial=0))
    if slashes not in COLUMNS or found.slashes.min(initial=slashes) < slashes:
        return None
    doubled = found.text.count(b"//")
    columns = COLUMNS[slashes] if doubled == 0 else (0, 2)
    if doubled and (slashes != 2 or doubled != len(found.slashes)):
        return None
    table = np.zeros((len(found.slashes), 3), dtype=np.int64)
    try:
        numbers = list(map(int, found.text.replace(b"/", b" ").split()))
        table[:, columns] = np.array(numbers, dtype=np.int64).reshape(len(table), len(columns))
    except (ValueError, OverflowError):
        return None
    return table
