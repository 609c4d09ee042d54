"""Bytes of a text format → lines and numbers, and refusals that name the line.

Formats of the nineties say nothing about encodings: UTF-8, UTF-16 and Latin-1 files are read alike, and every kind of
line end.  Lines count from 1, as editors show them.
"""

from __future__ import annotations

import codecs
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

MARKS = ((codecs.BOM_UTF8, "utf-8"), (codecs.BOM_UTF16_LE, "utf-16-le"), (codecs.BOM_UTF16_BE, "utf-16-be"))
HEAD = 256
"""Bytes that decide about UTF-16 without a mark."""


def decode(data: bytes) -> str:
    """The text of a file: by its byte order mark, else UTF-16 where every second byte is 0, UTF-8, or Latin-1.

    Never fails: what is no text in any of them comes out as Latin-1.
    """
    for mark, encoding in MARKS:
        if data.startswith(mark):
            return data[len(mark) :].decode(encoding, errors="replace")
    head = np.frombuffer(data[:HEAD], dtype=np.uint8)
    if len(head) >= 4 and not head[1::2].any() and head[::2].any():
        return data.decode("utf-16-le", errors="replace")
    if len(head) >= 4 and not head[::2].any() and head[1::2].any():
        return data.decode("utf-16-be", errors="replace")
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def lines_of(data: bytes) -> list[str]:
    """Lines without their ends: LF, CR LF or CR, not the rarer ones of `str.splitlines`, which names may hold."""
    return decode(data).replace("\r\n", "\n").replace("\r", "\n").split("\n")


def number_table(
    rows: Sequence[str], numbers: Sequence[int] | NDArray[np.int64], least: int, most: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The numbers of n lines.

    Args:
        rows: text of the lines, numbers between spaces; what follows the first `most` of them is ignored.
        numbers: line number of each.
        least: how many each must have.
        most: how many are read, ≥ least.

    Returns:
        (n, c) float64, c ≤ most the length of the longest line, NaN where a line has fewer; (n,) int64 how many it has.

    Raises:
        InputError: a line has fewer than least, or a word that is no number; it names the line.
    """
    words = [row.split()[:most] for row in rows]
    width = np.array([len(row) for row in words], dtype=np.int64)
    columns = int(width.max(initial=least))
    if width.min(initial=most) < least:
        place = int(np.argmin(width))
        raise InputError(
            f"line {numbers[place]} has {width[place]} numbers ({shown(rows[place])}), expected {least} or more; "
            "mend or remove that line"
        )
    if width.min(initial=columns) < columns:
        words = [row + ["nan"] * (columns - len(row)) for row in words]
    try:
        return np.array([float(word) for row in words for word in row]).reshape(-1, columns), width
    except ValueError as error:
        place = next(index for index, row in enumerate(words) if not all(map(is_number, row)))
        raise InputError(
            f"line {numbers[place]} holds what is no number ({shown(rows[place])}), expected numbers; "
            "mend or remove that line"
        ) from error


def is_number(word: str) -> bool:
    """Whether Python reads the word as a float."""
    try:
        float(word)
    except ValueError:
        return False
    return True


def finite(value: object) -> float:
    """The value as a float.  Raises: ValueError for NaN, infinity, or what is no number."""
    number = float(str(value))
    if not np.isfinite(number):
        raise ValueError(f"{number} is not finite")
    return number


def shown(text: str) -> str:
    """The beginning of a text as a message may quote it: printable, 40 characters at most."""
    short = " ".join(text.split())
    return repr(short if len(short) <= 40 else f"{short[:40]}…")
