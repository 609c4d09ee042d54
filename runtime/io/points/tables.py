"""Tables of points: .npy, .npz and text → arrays.

n points.  Text holds a point a line; comma, semicolon, tab or spaces between, an optional first line of names, # starts
a comment.  Files may come from anyone: nothing is unpickled, and sizes are checked before anything is allocated.
"""

from __future__ import annotations

import io
import lzma
import struct
import zipfile
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ..limits import limits
from ..text import is_number, lines_of, number_table

if TYPE_CHECKING:
    from numpy.typing import NDArray

TEXT = (".xyz", ".txt", ".csv")
MAX_BYTES = 8 << 30
COLUMNS = 16
"""Numbers of a line of text that are read."""
DAMAGE = (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError)
DAMAGE += (zlib.error, lzma.LZMAError, struct.error, OverflowError)
"""What zipfile raises where an archive is damaged, encrypted or packed in a way that it does not know."""


def read_table(data: bytes, kind: str, *, columns: int = COLUMNS) -> NDArray[Any] | dict[str, NDArray[Any]]:
    """The arrays of a .npz by name, or the one of any other kind.

    Args:
        data: the file's bytes.
        kind: its extension, in lower case.
        columns: of text: how many numbers of a line are read; what stands behind them may be anything.

    Raises:
        InputError: damaged, too large, or without numbers; text: it names the line.
    """
    if kind == ".npz":
        return read_npz(data)
    return read_npy(data) if kind == ".npy" else read_text(data, columns)


def read_npy(data: bytes) -> NDArray[Any]:
    """The array of a .npy file, read-only, on the bytes given.  numpy itself trusts the size that a header promises."""
    file = io.BytesIO(data)
    try:
        version = np.lib.format.read_magic(file)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, by_columns, kind = read(file)
    except Exception as error:  # the header is Python text: whatever its parser raises, the file is damaged
        raise InputError("no .npy file of plain numbers: its header is damaged; write it with numpy.save") from error
    if kind.hasobject or kind.itemsize == 0:
        raise InputError("the array holds no numbers, expected plain numbers; write it with numpy.save")
    count = int(np.prod(np.array(shape, dtype=object))) if shape else 1
    if min((count, *shape)) < 0 or kind.itemsize * count > len(data) - file.tell():
        raise InputError(
            f"the header promises an array of shape {shape}, the file has {len(data)} bytes; it is cut off or damaged: "
            "copy it again"
        )
    flat = np.frombuffer(data, dtype=kind, count=count, offset=file.tell())
    return flat.reshape(shape, order="F" if by_columns else "C")


def read_npz(data: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of a .npz file by name; of several, only points, normals, colors."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            sizes = {entry.filename.removesuffix(".npy"): entry.file_size for entry in archive.infolist()}
            wanted = [name for name in sizes if len(sizes) == 1 or name in ("points", "normals", "colors")]
            total = sum(sizes[name] for name in wanted)
            limits().demand_unpacked(total, len(data), "the archive")
            if total > MAX_BYTES:
                raise InputError(f"it unpacks to {total} bytes, at most {MAX_BYTES} are read; thin the points out")
            if len(sizes) > 1 and "points" not in sizes:
                raise InputError(
                    f"the file holds {list(sizes)[:20]}, expected an array 'points', or a single one; save it so"
                )
            arrays = {name: read_npy(archive.read(f"{name}.npy")) for name in wanted}
    except InputError:
        raise
    except DAMAGE as error:
        raise InputError("no .npz file of plain numbers: it is damaged; write it with numpy.savez") from error
    if not arrays:
        raise InputError("the file holds no array, expected 'points'; write it with numpy.savez")
    return arrays


def read_text(data: bytes, columns: int) -> NDArray[np.float64]:
    """Lines of three numbers or more → (n, c) float64, c ≤ columns; n is 0 where there is but a line of names."""
    rows, numbers = [], []
    for number, line in enumerate(lines_of(data), start=1):
        body = line.partition("#")[0].strip()
        if body:
            rows.append(body)
            numbers.append(number)
    if not rows or "\ufffd" in rows[0] or "\0" in rows[0]:
        raise InputError("the file holds no text of numbers, expected lines of x y z; check the export")
    delimiter = next((mark for mark in (",", ";", "\t") if mark in rows[0]), None)
    rows = rows if delimiter is None else [_spaced(row, delimiter) for row in rows]
    first = 0 if is_number(rows[0].split()[0]) else 1
    table, width = number_table(rows[first:], numbers[first:], 3, columns)
    uneven = np.flatnonzero(width != width[:1])
    if len(uneven):
        place = int(uneven[0])
        raise InputError(
            f"line {numbers[first + place]} has {width[place]} numbers, expected {width[0]} as in the lines before; "
            "mend or remove that line"
        )
    return table


def _spaced(row: str, delimiter: str) -> str:
    """The fields between spaces; an empty one is NaN, so that none moves to another column."""
    return " ".join(field.strip().replace(" ", "_") or "nan" for field in row.split(delimiter))
