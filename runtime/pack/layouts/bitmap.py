"""Charts as bitmaps, dropped one after the other where no cell is taken: into holes and bays too.

k charts · W columns · cells: the unit of length.  A bitmap of W columns is one whole number, W + 1 bits a row, whose
last column is a wall.  Where a chart may lie is found for all places at once: the taken cells, spread to the left by
the length of each run of the chart's cells and moved to that run, leave those places free where no run meets any.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

FINE = 4
"""Samples of an outline along a cell."""
SURE = math.sqrt(0.5) + math.sqrt(0.5) / FINE
"""Cells from a point of the outline to the centre of its cell, and to the sample that stands for it, at most."""


@dataclass(frozen=True, eq=False)
class Mask:
    """Cells (h, w) bool of a chart at one angle, its padding around it; (0, 0) is the lowest row's left end.

    offset: (2,) what leads from the coordinates of the turned outline to those of the mask.
    """

    cells: NDArray[np.bool_]
    offset: NDArray[np.float64]

    @property
    def height(self) -> int:
        """Rows."""
        return self.cells.shape[0]

    @property
    def width(self) -> int:
        """Columns."""
        return self.cells.shape[1]

    @cached_property
    def runs(self) -> list[tuple[int, int, int]]:
        """Row, first column and length of each run of cells in a row."""
        step = np.diff(np.pad(self.cells.astype(np.int8), ((0, 0), (1, 1))), axis=1)
        (row, first), (_, last) = np.nonzero(step == 1), np.nonzero(step == -1)
        return list(zip(row.tolist(), first.tolist(), (last - first).tolist(), strict=True))

    def bits(self, columns: int) -> int:
        """The cells as a bitmap of so many columns."""
        return as_bits(np.pad(self.cells, ((0, 0), (0, columns + 1 - self.width))))

    @property
    def turned(self) -> Mask:
        """The same chart turned by 90°, counter-clockwise."""
        # (x, y) → (−y, x): the mask's upper end comes to lie at its left
        offset = np.array([self.height - self.offset[1], self.offset[0]])
        return Mask(np.ascontiguousarray(self.cells.T[:, ::-1]), offset)


def as_bits(cells: NDArray[np.bool_]) -> int:
    """Cells, row after row, as the bits of a whole number, the first one lowest."""
    return int.from_bytes(np.packbits(cells.reshape(-1), bitorder="little").tobytes(), "little")


def mask_of(outline: NDArray[np.float64], padding: float, *, filled: bool = False) -> Mask:
    """All cells that an outline (s, 2, 2), what it encloses, or a disc of radius padding around them may touch.

    filled: whether holes count as enclosed, which those of a chart that is folded over must.
    """
    room = math.ceil(padding + SURE) + 1
    low = np.floor(outline.min(axis=(0, 1))) - room
    width, height = (np.ceil(np.ptp(outline, axis=(0, 1))) + 2 * room + 2).astype(np.int64).tolist()
    cells = _inside(outline - low, (height, width)) | _near(outline - low, (height, width), padding + SURE)
    if filled:
        from scipy.ndimage import binary_fill_holes

        cells = np.asarray(binary_fill_holes(cells))
    rows, columns = np.flatnonzero(cells.any(axis=1)), np.flatnonzero(cells.any(axis=0))
    trimmed = cells[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    return Mask(trimmed, -low - (columns[0], rows[0]))


def _inside(outline: NDArray[np.float64], shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Cells whose centre the outline winds around."""
    start, end = outline.transpose(1, 0, 2)
    low, high = np.minimum(start[:, 1], end[:, 1]), np.maximum(start[:, 1], end[:, 1])
    first, last = np.ceil(low - 0.5).astype(np.int64), np.ceil(high - 0.5).astype(np.int64)
    count = last - first
    owner = np.repeat(np.arange(len(outline)), count)
    row = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + first[owner]
    share = (row + 0.5 - start[owner, 1]) / (end[owner, 1] - start[owner, 1])
    column = np.ceil(start[owner, 0] + share * (end[owner, 0] - start[owner, 0]) - 0.5).astype(np.int64)
    winding = np.zeros(shape, dtype=np.int64)
    np.add.at(winding, (row, column), np.where(end[owner, 1] > start[owner, 1], 1, -1))
    return np.cumsum(winding, axis=1) != 0


def _near(outline: NDArray[np.float64], shape: tuple[int, int], reach: float) -> NDArray[np.bool_]:
    """Cells whose centre lies within reach of a sample of the outline."""
    start, end = outline.transpose(1, 0, 2)
    count = np.maximum(np.ceil(FINE * np.linalg.norm(end - start, axis=1)).astype(np.int64), 1)
    owner = np.repeat(np.arange(len(outline)), count)
    share = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + 0.5) / count[owner]
    points = start[owner] + share[:, None] * (end - start)[owner]
    fine = np.unique(np.floor(FINE * points).astype(np.int64), axis=0)
    cell, part = fine // FINE, fine % FINE
    span = np.arange(-math.ceil(reach), math.ceil(reach) + 1)
    steps = np.stack(np.meshgrid(span, span), axis=-1).reshape(-1, 2)
    found = np.zeros(shape, dtype=bool)
    for one in range(FINE * FINE):  # samples at the same place in their cells have the same cells near
        place = np.array(divmod(one, FINE))
        own = cell[(part == place).all(axis=1)]
        near = steps[np.linalg.norm(steps + 0.5 - (place + 0.5) / FINE, axis=1) <= reach]
        column, row = (own[:, None] + near).reshape(-1, 2).T
        found[row, column] = True
    return found


@dataclass(frozen=True, eq=False)
class Nest:
    """Where charts lie: number of the mask (k,), place of it (k, 2), columns and rows that are taken."""

    mask: NDArray[np.int64]
    place: NDArray[np.int64]
    width: int
    height: int

    def side(self, extent: NDArray[np.float64]) -> float:
        """The longer side of the page of that form that holds all, in cells.  extent: (2,) of it, sides of the page."""
        return max(self.width / extent[0], self.height / extent[1])


def nest(charts: list[list[Mask]], order: NDArray[np.int64], columns: int, *, most: float = math.inf) -> Nest | None:
    """Charts in that order, each where its top comes to lie lowest, at any of its masks.

    most: height at which to give up.  None: then, or where a chart is wider than the columns.
    """
    stride, taken = columns + 1, 0
    extents = [max(max(mask.height, mask.width) for mask in masks) for masks in charts]
    # a chart whose top is above ``most`` ends the search: no more rows than the tallest needs there
    rows = int(min(sum(extents), most + max(extents) + 1))
    wall = np.zeros((rows + 1, stride), dtype=bool)
    wall[:, columns] = True
    taken = as_bits(wall)
    chosen, place, size = np.zeros(len(charts), np.int64), np.zeros((len(charts), 2), np.int64), [0, 0]
    for chart in order.tolist():
        fitting = [(number, mask) for number, mask in enumerate(charts[chart]) if mask.width <= columns]
        # on top of all others there is room: nothing above what would lie there matters
        below = (1 << (size[1] + extents[chart] + 1) * stride) - 1
        spread = _spreads(taken & below, max((mask.width for _, mask in fitting), default=1))
        best: tuple[int, int, int, int] | None = None
        for number, mask in fitting:
            rows = size[1] + 1 if best is None else best[0] - mask.height + 1
            place_of = _lowest(spread, mask, stride, rows) if rows > 0 else None
            if place_of is not None:
                found = (place_of[0] + mask.height, *place_of, number)
                best = found if best is None else min(best, found)
        if best is None or best[0] > most:
            return None
        top, row, column, number = best
        mask = charts[chart][number]
        taken |= mask.bits(columns) << (row * stride + column)
        chosen[chart], place[chart] = number, (column, row)
        size = [max(size[0], column + mask.width), max(size[1], top)]
    return Nest(chosen, place, size[0], size[1])


def _spreads(taken: int, widest: int) -> list[int]:
    """Bitmaps in which a bit is set where any of the next 1, 2, 4, … cells is taken."""
    found = [taken]
    while 2 ** len(found) <= widest:
        found.append(found[-1] | (found[-1] >> 2 ** (len(found) - 1)))
    return found


def _lowest(spread: list[int], mask: Mask, stride: int, rows: int) -> tuple[int, int] | None:
    """Row and column of the lowest place, the leftmost of them, where no cell of the mask is taken.

    rows: how many may be its first; None where it has no place there.  Nothing above what it covers is looked at.
    """
    window = (1 << (rows + mask.height) * stride) - 1
    spread, blocked = [each & window for each in spread], 0
    for row, first, length in mask.runs:
        power, start = length.bit_length() - 1, row * stride + first
        blocked |= spread[power] >> start
        if length != 1 << power:
            blocked |= spread[power] >> (start + length - (1 << power))
    free = ~blocked & ((1 << rows * stride) - 1)
    return divmod((free & -free).bit_length() - 1, stride) if free else None
