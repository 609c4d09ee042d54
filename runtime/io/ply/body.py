"""Body of a PLY file → tables: ascii and binary, lists of any lengths.

A file may come from anyone: what the header promises is checked against the file's size before anything is allocated.
Ascii numbers are read word by word, so a row may go over several lines.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import MeshError
from ..text import shown

if TYPE_CHECKING:
    from collections.abc import Callable, Container

    from numpy.typing import NDArray

    from .header import PlyElement, PlyHeader, PlyProperty

CUT_OFF = "it is cut off or damaged: copy or export it again"


@dataclass(frozen=True, eq=False)
class Lists:
    """A column of lists.  values: all members, row after row.  size: (n,) int64, how many of them each row has."""

    values: NDArray[Any]
    size: NDArray[np.int64]

    def table(self, columns: int) -> NDArray[Any] | None:
        """(n, columns) where every row has so many members, else None."""
        return self.values.reshape(-1, columns) if (self.size == columns).all() else None


Table = dict[str, "NDArray[Any] | Lists"]


def read_body(data: bytes, header: PlyHeader, wanted: Container[str]) -> dict[str, Table]:
    """The columns of the elements that are wanted, by element and property.

    Numbers keep the type of the file; real ones of an ascii file are float64.
    What lies behind the last of them is not looked at.  Raises: MeshError, damaged or shorter than the header says.
    """
    last = max((index for index, element in enumerate(header.elements) if element.name in wanted), default=-1)
    source = _Binary(data, header) if header.order else _Ascii(data, header)
    found: dict[str, Table] = {}
    for element in header.elements[: last + 1]:
        least = sum(1 if header.order == "" else np.dtype(c.count or c.kind).itemsize for c in element.properties)
        if element.count * least > source.left():
            raise MeshError(
                f"the PLY file ends in or before its {element.count} rows of {element.name!r} that its header "
                f"promises; {CUT_OFF}"
            )
        lists = any(column.count for column in element.properties)
        table = (source.uneven_rows if lists else source.even_rows)(element)
        if element.name in wanted:
            found[element.name] = table
    return found


def _uneven(
    element: PlyElement, take: Callable[[str, int], NDArray[Any]], guess: Callable[[list[int]], Table | None]
) -> Table:
    """Rows with lists: all at once if their lengths are those of the first row, else row by row.

    take(kind, count) gives the next numbers.  guess(lengths) gives the whole table if every row has lists of these
    lengths, and None if not.
    """
    rows: list[list[NDArray[Any]]] = []
    for index in range(element.count):
        row = []
        for column in element.properties:
            length = int(take(column.count, 1)[0]) if column.count else 1
            if length < 0:
                raise MeshError(
                    f"row {index} of PLY element {element.name!r} has a list of {length} members; {CUT_OFF}"
                )
            row.append(take(column.kind, length))
        rows.append(row)
        if index == 0:
            table = guess([len(values) for values in row])
            if table is not None:
                return table
    return {
        column.name: _joined([row[place] for row in rows], column) for place, column in enumerate(element.properties)
    }


def _joined(parts: list[NDArray[Any]], column: PlyProperty) -> NDArray[Any] | Lists:
    values = np.concatenate(parts) if parts else np.zeros(0, dtype=column.kind)
    return Lists(values, np.array([len(part) for part in parts], dtype=np.int64)) if column.count else values


class _Binary:
    """Numbers one after the other in bytes."""

    def __init__(self, data: bytes, header: PlyHeader) -> None:
        self.data, self.order, self.place = data, header.order, header.start

    def left(self) -> int:
        """Bytes left."""
        return len(self.data) - self.place

    def take(self, kind: str, count: int) -> NDArray[Any]:
        """The next numbers."""
        dtype = np.dtype(self.order + kind)
        if count * dtype.itemsize > self.left():
            raise MeshError(f"the PLY file ends inside a list of {count} members; {CUT_OFF}")
        values = np.frombuffer(self.data, dtype=dtype, count=count, offset=self.place)
        self.place += count * dtype.itemsize
        return values

    def even_rows(self, element: PlyElement) -> Table:
        """A table without lists."""
        record = np.dtype([(column.name, self.order + column.kind) for column in element.properties])
        if element.count == 0 or record.itemsize == 0:
            return {column.name: np.zeros(0, dtype=column.kind) for column in element.properties}
        rows = np.frombuffer(self.data, dtype=record, count=element.count, offset=self.place)
        self.place += rows.nbytes
        return {column.name: rows[column.name] for column in element.properties}

    def uneven_rows(self, element: PlyElement) -> Table:
        """A table with lists."""
        start = self.place

        def guess(lengths: list[int]) -> Table | None:
            fields: list[Any] = []
            for place, (column, length) in enumerate(zip(element.properties, lengths, strict=True)):
                if column.count:
                    fields.append((f"length{place}", self.order + column.count))
                fields.append((f"column{place}", self.order + column.kind, (length,)))
            record = np.dtype(fields)
            if record.itemsize * element.count > len(self.data) - start:
                return None
            rows = np.frombuffer(self.data, dtype=record, count=element.count, offset=start)
            table: Table = {}
            for place, (column, length) in enumerate(zip(element.properties, lengths, strict=True)):
                if column.count and (rows[f"length{place}"] != length).any():
                    return None
                values = rows[f"column{place}"].reshape(-1)
                size = np.full(element.count, length, dtype=np.int64)
                table[column.name] = Lists(values, size) if column.count else values
            self.place = start + rows.nbytes
            return table

        return _uneven(element, self.take, guess)


class _Ascii:
    """Numbers one after the other in words."""

    def __init__(self, data: bytes, header: PlyHeader) -> None:
        self.words, self.place = data[header.start :].split(), 0

    def left(self) -> int:
        """Words left."""
        return len(self.words) - self.place

    def take(self, kind: str, count: int) -> NDArray[Any]:
        """The next numbers."""
        if count > self.left():
            raise MeshError(f"the PLY file ends inside a list of {count} members; {CUT_OFF}")
        self.place += count
        return _numbers(self.words[self.place - count : self.place], kind)

    def even_rows(self, element: PlyElement) -> Table:
        """A table without lists."""
        width = len(element.properties)
        words = self.words[self.place : self.place + element.count * width]
        self.place += len(words)
        return {
            column.name: _numbers(words[place::width], column.kind) for place, column in enumerate(element.properties)
        }

    def uneven_rows(self, element: PlyElement) -> Table:
        """A table with lists."""
        start = self.place

        def guess(lengths: list[int]) -> Table | None:
            width = sum(length + bool(c.count) for c, length in zip(element.properties, lengths, strict=True))
            words = self.words[start : start + element.count * width]
            if len(words) < element.count * width:
                return None
            place, table = 0, Table()
            for column, length in zip(element.properties, lengths, strict=True):
                if column.count:
                    if set(words[place::width]) != {words[place]}:
                        return None
                    place += 1
                columns = [_numbers(words[place + index :: width], column.kind) for index in range(length)]
                values = np.stack(columns, axis=1).reshape(-1) if columns else np.zeros(0, dtype=column.kind)
                size = np.full(element.count, length, dtype=np.int64)
                table[column.name] = Lists(values, size) if column.count else values
                place += length
            self.place = start + len(words)
            return table

        return _uneven(element, self.take, guess)


def _numbers(words: list[bytes], kind: str) -> NDArray[Any]:
    """Words → numbers, float64 for any real kind; whole numbers may be written as '3.0'.

    Raises: MeshError naming the word.
    """
    real = kind[0] == "f"
    try:
        return np.array(list(map(float if real else int, words)), dtype="f8" if real else kind)
    except (ValueError, OverflowError):
        pass
    found = []
    for word in words:
        try:
            value = float(word)
            found.append(value if real else int(value))
            np.array(found[-1], dtype=kind)
        except (ValueError, OverflowError) as error:
            raise MeshError(
                f"the PLY file holds the word {shown(word.decode('latin-1'))}, expected a number of its type ({kind}); "
                "mend it or export it again"
            ) from error
    return np.array(found, dtype="f8" if real else kind)
