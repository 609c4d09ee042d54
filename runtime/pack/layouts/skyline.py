"""Where charts go: dropped one after the other onto a skyline, profile on profile.

k charts · W columns · cells: the unit of length, the width of a column.  The skyline is the height (W,) up to which
each column is taken.  A chart is known by its *profile*: per column its lowest and highest point, with the padding
around it.  It falls at each place until the two meet, and stays where its top and the room it buries beneath are least
(the "tetris" packing of Lévy, Petitjean, Ray, Maillot 2002, with heights that are not rounded to cells).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ...kernel.choice import kernel

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Profile:
    """A chart at one angle, padded: lowest and highest points (w,) of its columns, the lowest of all at 0.

    offset: (2,) what leads from the coordinates of the turned outline to those of the profile, cells.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    offset: NDArray[np.float64]

    @cached_property
    def top(self) -> float:
        """The highest point."""
        return float(self.high.max())

    @cached_property
    def room(self) -> float:
        """What lies beneath, in cells."""
        return float(self.low.sum())

    def looks_like(self, other: Profile) -> bool:
        """Whether the two are the same but for where they are, to a millionth of a cell."""
        if len(self.low) != len(other.low):
            return False
        return bool(np.abs(self.low - other.low).max() < 1e-6 and np.abs(self.high - other.high).max() < 1e-6)

    @property
    def turned(self) -> Profile:
        """The same chart upside down (turned by 180°)."""
        low, high = self.top - self.high[::-1], self.top - self.low[::-1]
        return Profile(low, high, np.array([len(self.low), self.top]) - self.offset)


@dataclass(frozen=True, eq=False)
class Drop:
    """Where charts lie: angle number (k,), origin of the profile (k, 2) in cells, and the skyline (W,) they reach."""

    angle: NDArray[np.int64]
    origin: NDArray[np.float64]
    skyline: NDArray[np.float64]

    @cached_property
    def width(self) -> float:
        """Columns up to the last one that is taken."""
        return float(np.flatnonzero(self.skyline)[-1] + 1)

    @cached_property
    def height(self) -> float:
        """The highest point, in cells."""
        return float(self.skyline.max())

    def side(self, extent: NDArray[np.float64]) -> float:
        """The longer side of the page of that form that holds all, in cells.  extent: (2,) of it, sides of the page."""
        return max(self.width / extent[0], self.height / extent[1])


def profile(outline: NDArray[np.float64], padding: float) -> Profile:
    """The profile of an outline (s, 2, 2), any order of segments, with that much padding; all in cells."""
    origin = outline.min(axis=(0, 1)) - [padding, 0.0]
    start, end = (outline - origin).transpose(1, 0, 2)
    column, height = _crossings(*np.where((start[:, :1] <= end[:, :1])[None], (start, end), (end, start)))
    width = max(math.ceil(float((outline - origin)[..., 0].max()) + padding), 1)
    column = np.minimum(column, width - 1)
    low, high = np.full(width, np.inf), np.full(width, -np.inf)
    np.minimum.at(low, column, height)
    np.maximum.at(high, column, height)
    low, high = _padded(low, padding), -_padded(-high, padding)
    base = float(low.min())
    return Profile(low - base, high - base, np.array([0.0, -base]) - origin)


def _crossings(left: NDArray[np.float64], right: NDArray[np.float64]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Column (n,) and height (n,) of the ends of segments, and of their points between columns, which count in both."""
    first, last = np.ceil(left[:, 0]).astype(np.int64), np.floor(right[:, 0]).astype(np.int64)
    count = np.maximum(last - first + 1, 0)
    owner = np.repeat(np.arange(len(left)), count)
    line = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + first[owner]
    run = right[owner, 0] - left[owner, 0]
    share = np.where(run > 0.0, (line - left[owner, 0]) / np.where(run > 0.0, run, 1.0), 0.0)
    height = left[owner, 1] + share * (right[owner, 1] - left[owner, 1])
    column = np.concatenate([np.floor(left[:, 0]), np.floor(right[:, 0]), line, np.maximum(line - 1, 0)])
    return column.astype(np.int64), np.concatenate([left[:, 1], right[:, 1], height, height])


def _padded(low: NDArray[np.float64], padding: float) -> NDArray[np.float64]:
    """Lowest points (w,) of the columns with a disc of radius padding around each; never too high."""
    result = low - padding
    for step in range(1, min(math.ceil(padding) + 1, len(low))):
        reach = math.sqrt(max(padding**2 - (step - 1) ** 2, 0.0))  # columns step apart can hold points step − 1 apart
        result[step:] = np.minimum(result[step:], low[:-step] - reach)
        result[:-step] = np.minimum(result[:-step], low[step:] - reach)
    return result


def drop(
    charts: list[list[Profile]], order: NDArray[np.int64], columns: int, *, tightness: float, most: float = math.inf
) -> Drop | None:
    """Charts dropped in that order, each at the angle and place where it is best.

    Args:
        charts: k charts, each at one angle or more.
        order: (k,) int64.
        columns: W.
        tightness: what a column buried to a height of one counts, against a top that is higher by one.
        most: height at which to give up.

    Returns:
        Where they lie, or None where one is wider than the columns or the height exceeds ``most``.
    """
    if compiled := kernel():
        return _drop_compiled(compiled.drop, charts, order, columns, tightness=tightness, most=most)
    skyline = np.zeros(columns)
    angle, origin = np.zeros(len(charts), dtype=np.int64), np.zeros((len(charts), 2))
    for chart in order.tolist():
        below = np.append(0.0, np.cumsum(skyline))
        best: tuple[float, int, int, float] | None = None
        for number, shape in enumerate(charts[chart]):
            width = len(shape.low)
            if width > columns:
                continue
            windows: NDArray[np.float64] = np.ndarray((columns - width + 1, width), np.float64, skyline, 0, (8, 8))
            rest = np.maximum.reduce(windows - shape.low, axis=1)
            buried = width * rest - (below[width:] - below[:-width])
            cost = rest + (tightness / columns) * buried + (shape.top + tightness / columns * shape.room)
            place = int(cost.argmin())
            if best is None or cost[place] < best[0]:
                best = (float(cost[place]), number, place, float(rest[place]))
        if best is None:
            return None
        _, angle[chart], place, height = best
        shape = charts[chart][angle[chart]]
        origin[chart] = place, height
        skyline[place : place + len(shape.low)] = height + shape.high
        if height + shape.top > most:
            return None
    return Drop(angle, origin, skyline)


def _drop_compiled(
    compiled: Callable[..., tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]] | None],
    charts: list[list[Profile]],
    order: NDArray[np.int64],
    columns: int,
    *,
    tightness: float,
    most: float,
) -> Drop | None:
    """The same by the kernel."""
    shapes = [shape for chart in charts for shape in chart]
    found = compiled(
        np.concatenate([shape.low for shape in shapes]),
        np.concatenate([shape.high for shape in shapes]),
        np.array([len(shape.low) for shape in shapes]),
        np.array([shape.top for shape in shapes]),
        np.array([shape.room for shape in shapes]),
        np.append(0, np.cumsum([len(chart) for chart in charts])),
        order,
        columns,
        tightness / columns,
        most,
    )
    return None if found is None else Drop(*found)
