"""A layout of bitmaps on smaller and smaller pages: charts that overlap there are moved until none does.

k charts · cells: the unit of length.  Overlap of two charts is how deep they lie in each other: the least number of
steps along the axes that parts them.  One table a pair of charts, at the turns they have, holds it for every shift of
one against the other, so that a chart is moved to the best of all places on the page at once.  Pairs that still
overlap weigh more from round to round, which leads out of places where nothing can be bettered (guided local search:
Egeblad, Nielsen, Odgaard 2007; Umetani et al. 2009).  Where that fails, two charts of the last layout change places.

The kernel does the same, to the bit (`runtime/kernel/nest.hpp`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...kernel.choice import kernel
from .bitmap import Mask, Nest

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ..config import SeparationConfig

_WORD = 2**64 - 1


@dataclass(eq=False)
class Chance:
    """SplitMix64 (Steele, Lea, Flood 2014): the same numbers on every machine."""

    state: int

    def below(self, bound: int) -> int:
        """A whole number from 0 on, below that bound."""
        self.state = (self.state + 0x9E3779B97F4A7C15) & _WORD
        mixed = ((self.state ^ (self.state >> 30)) * 0xBF58476D1CE4E5B9) & _WORD
        mixed = ((mixed ^ (mixed >> 27)) * 0x94D049BB133111EB) & _WORD
        return ((mixed ^ (mixed >> 31)) >> 33) % bound


def depths(one: NDArray[np.bool_], other: NDArray[np.bool_]) -> NDArray[np.int64]:
    """How deep cells (h, w) lie in others (n, m), up to 255, for each shift: (h + n − 1, w + m − 1).

    Entry (y, x): where the first ones' corner lies x − (w − 1), y − (h − 1) from the others'.
    """
    from scipy.signal import fftconvolve

    common = fftconvolve(other.astype(np.float64), one[::-1, ::-1].astype(np.float64))
    depth = np.where(np.pad(common > 0.5, 1), 255, 0)
    for axis in (0, 1):
        step = np.arange(depth.shape[axis]).reshape((-1, 1) if axis == 0 else (1, -1))
        ahead = np.minimum.accumulate(depth - step, axis=axis) + step
        back = np.flip(np.minimum.accumulate(np.flip(depth + step, axis), axis=axis), axis) - step
        depth = np.minimum(ahead, back)
    return depth[1:-1, 1:-1]


def shrunk(
    charts: list[list[Mask]],
    quarters: int,
    extent: NDArray[np.float64],
    start: Nest,
    config: SeparationConfig,
    seed: int,
) -> list[Nest]:
    """Layouts on smaller and smaller pages of that form, the best one first; none where the first could not shrink.

    Args:
        charts: of two charts or more all masks: those of a slant behind each other, so many quarters of it.
        quarters: quarter turns of each slant.
        extent: (2,) width and height of the page, the longer one 1.
        start: where they lie.
        config: numbers.
        seed: of the choices by chance.
    """
    given = np.column_stack([start.mask, start.place]).astype(np.int64)
    if compiled := kernel():
        cells = [[mask.cells for mask in masks] for masks in charts]
        found = compiled.shrunk(cells, quarters, tuple(extent.tolist()), given, config.numbers, seed)
        layouts = found.reshape(-1, len(charts), 3)
    else:
        layouts = np.array(_Search(charts, quarters, extent, config, Chance(seed)).shrunk(given)).reshape(
            -1, len(charts), 3
        )
    return [_nest(charts, layout) for layout in layouts[::-1]]


def _nest(charts: list[list[Mask]], lying: NDArray[np.int64]) -> Nest:
    size = np.array([charts[chart][turn].cells.shape[::-1] for chart, turn in enumerate(lying[:, 0].tolist())])
    width, height = (lying[:, 1:] + size).max(axis=0).tolist()
    return Nest(lying[:, 0], lying[:, 1:], width, height)


@dataclass(eq=False)
class _Search:
    """The search; layouts are (k, 3) turn, column and row of each chart."""

    charts: list[list[Mask]]
    quarters: int
    extent: NDArray[np.float64]
    config: SeparationConfig
    chance: Chance
    left: float = 0.0
    page: tuple[int, int] = (0, 0)
    known: dict[tuple[int, int, int, int], NDArray[np.int64]] = field(default_factory=dict)
    held: int = 0
    weight: NDArray[np.float32] = field(default_factory=lambda: np.zeros((0, 0), np.float32))
    depth: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 0), np.int64))

    def shrunk(self, now: NDArray[np.int64]) -> list[NDArray[np.int64]]:
        """The last layouts found on smaller pages, the best one last."""
        found: list[NDArray[np.int64]] = []
        good, step, self.left = now.copy(), self.config.step, self.config.work
        now = now.copy()
        while self.left > 0:
            self.left -= 1e4
            side = math.ceil(_nest(self.charts, good).side(self.extent)) - step
            self.page = int(side * self.extent[0]), int(side * self.extent[1])
            if self._pushed_in(now) and self._separated(now):
                good = now.copy()
                found = [*found, good][-self.config.kept :]
            else:
                step, now = 1, self._swapped(good)
        return found

    def _size(self, now: NDArray[np.int64], chart: int) -> tuple[int, int]:
        mask = self.charts[chart][now[chart, 0]]
        return mask.width, mask.height

    def _pushed_in(self, now: NDArray[np.int64]) -> bool:
        """Moves charts into the page; False where one is larger than it."""
        room = np.array([np.subtract(self.page, self._size(now, chart)) for chart in range(len(now))])
        now[:, 1:] = np.maximum(np.minimum(now[:, 1:], room), 0)
        return bool((room >= 0).all())

    def _swapped(self, good: NDArray[np.int64]) -> NDArray[np.int64]:
        """Two charts change places, at turns by chance."""
        now, k = good.copy(), len(good)
        one = self.chance.below(k)
        other = (one + 1 + self.chance.below(k - 1)) % k
        for mine, to in ((one, other), (other, one)):
            now[mine, 0] = self.chance.below(len(self.charts[mine]))
            middle = 2 * good[to, 1:] + self._size(good, to)
            now[mine, 1:] = np.maximum(middle - self._size(now, mine), 0) // 2
        return now

    def _depths(self, one: int, turn: int, other: int, against: int) -> NDArray[np.int64]:
        key = one, turn, other, against
        if key in self.known:
            return self.known[key]
        if one > other:
            made = self._depths(other, against, one, turn)[::-1, ::-1]
        elif quarter := turn % self.quarters:
            back = against - against % self.quarters + (against - quarter) % self.quarters
            made = np.rot90(self._depths(one, turn - quarter, other, back)[::-1], quarter)[::-1]
        else:
            made = depths(self.charts[one][turn].cells, self.charts[other][against].cells)
            self.left -= 4.0 * made.size
        self.left -= made.size
        self.held += made.size
        self.known[key] = made
        return made

    def _measured(self, now: NDArray[np.int64], chart: int) -> None:
        width, height = self._size(now, chart)
        for other in range(len(now)):
            if other == chart:
                continue
            table = self._depths(chart, int(now[chart, 0]), other, int(now[other, 0]))
            x, y = (now[chart, 1:] - now[other, 1:] + (width - 1, height - 1)).tolist()
            within = 0 <= y < table.shape[0] and 0 <= x < table.shape[1]
            self.depth[chart, other] = self.depth[other, chart] = int(table[y, x]) if within else 0

    def _best_place(self, now: NDArray[np.int64], chart: int, turn: int) -> tuple[float, int, int, int] | None:
        """What a chart costs at that turn where it costs least, by chance one of several places; column and row."""
        own = self.charts[chart][turn]
        columns, rows = self.page[0] - own.width + 1, self.page[1] - own.height + 1
        if columns <= 0 or rows <= 0:
            return None
        cost = np.zeros((rows, columns), np.float32)
        self.left -= 2.0 * cost.size
        for other in range(len(now)):
            if other == chart:
                continue
            table = self._depths(chart, turn, other, int(now[other, 0]))
            left, low = (now[other, 1:] - (own.width - 1, own.height - 1)).tolist()
            first, end = max(left, 0), max(min(left + table.shape[1], columns), max(left, 0))
            begin, stop = max(low, 0), max(min(low + table.shape[0], rows), max(low, 0))
            part = table[begin - low : stop - low, first - left : end - left]
            cost[begin:stop, first:end] += self.weight[chart, other] * part.astype(np.float32)
            self.left -= part.size
        least = cost.min()
        equal = np.flatnonzero(cost == least)
        row, column = divmod(int(equal[self.chance.below(len(equal))]), columns)
        return float(least), turn, column, row

    def _turns_tried(self, chart: int, turn: int) -> Sequence[int]:
        """The turn a chart has, its neighbours, and some by chance; all where there are few."""
        every = len(self.charts[chart])
        slants = every // self.quarters
        if every <= self.config.turns + 3:
            return range(every)
        rank = turn % self.quarters * slants + turn // self.quarters
        near = [(rank + step) % every for step in (0, 1, every - 1)]
        tried = [each % slants * self.quarters + each // slants for each in near]
        return tried + [self.chance.below(every) for _ in range(self.config.turns)]

    def _moved(self, now: NDArray[np.int64], chart: int) -> None:
        """Moves a chart to the best place that any turn tried has for it."""
        found = [self._best_place(now, chart, turn) for turn in self._turns_tried(chart, int(now[chart, 0]))]
        fitting = [one for one in found if one is not None]
        if fitting:
            now[chart] = min(fitting, key=lambda one: one[0])[1:]
            self._measured(now, chart)

    def _separated(self, now: NDArray[np.int64]) -> bool:
        """Moves charts until none overlaps another; False where that did not come about."""
        k, config = len(now), self.config
        self.weight, self.depth = np.ones((k, k), np.float32), np.zeros((k, k), np.int64)
        for chart in range(k):
            self._measured(now, chart)
        least, stale = math.inf, 0
        while stale <= config.patience and self.left > 0:
            if self.held > config.memory:
                self.known, self.held = {}, 0
            order = list(range(k))
            for last in range(k - 1, 0, -1):
                other = self.chance.below(last + 1)
                order[last], order[other] = order[other], order[last]
            for chart in order:
                if self.depth[chart].any():
                    self._moved(now, chart)
            total = int(self.depth.sum())
            if total == 0:
                return True
            least, stale = (total, 0) if total < least else (least, stale + 1)
            share = self.depth.astype(np.float32) / np.float32(self.depth.max())
            heavier = np.float32(config.heavier) + np.float32(config.steeper) * share
            factor = np.where(self.depth > 0, heavier, np.float32(config.lighter))
            self.weight = np.maximum(self.weight * factor, np.float32(1.0))
        return False
