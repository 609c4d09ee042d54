"""How much of a page charts will cover, foreseen in a few milliseconds: dropped on a skyline, at one size.

Charts keep the size at which they would cover ``fill`` of the page, so that each has its profiles once, whatever lies
beside it; how large a page they need says what they would cover of it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..growing.outlines import rotation, upright_angle
from .skyline import drop, profile

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import ForeseenConfig
    from .skyline import Profile

QUARTERS = (0.0, math.pi / 2.0)
DIAGONALS = (math.pi / 4.0, 3.0 * math.pi / 4.0)


@dataclass(frozen=True, eq=False)
class Silhouette:
    """A chart on a page: its profiles at each quarter turn, and its area, all in cells."""

    turns: tuple[Profile, ...]
    area: float

    @property
    def extent(self) -> float:
        """The longer side."""
        return max(len(self.turns[0].low), self.turns[0].top)

    @property
    def narrowest(self) -> int:
        """Columns that it needs at least."""
        return min(len(turn.low) for turn in self.turns)


def silhouette(
    outline: NDArray[np.float64], area: float, whole: float, config: ForeseenConfig, *, alone: bool = False
) -> Silhouette:
    """A chart of that outline (s, 2, 2) and area; whole: area of all charts of the page.  alone: it has no other."""
    unit = config.columns * math.sqrt(config.fill / whole)
    upright = outline @ rotation(upright_angle(outline, np.ones(2) if alone else None)).T * unit
    slanted = not alone and np.ptp(upright, axis=(0, 1)).max() > math.sqrt(whole) * unit
    turns = [profile(upright @ rotation(turn).T, config.padding * config.columns) for turn in QUARTERS]
    turns += [turn.turned for turn in turns]
    if slanted:
        turns += [profile(upright @ rotation(turn).T, config.padding * config.columns) for turn in DIAGONALS]
    return Silhouette(tuple(turns), area * unit**2)


def foreseen(charts: list[Silhouette], config: ForeseenConfig) -> float:
    """Share of the least square page found that charts cover, above 0, up to 1."""
    shapes = [list(chart.turns) for chart in charts]
    extent = np.array([chart.extent for chart in charts])
    narrowest = max(chart.narrowest for chart in charts)
    rng, best, keys = np.random.default_rng(0), math.inf, extent
    for number in range(config.tries if len(charts) > 1 else 1):
        if number == 0:
            order, width, tightness, most = extent, max(config.columns, narrowest), 1.0, math.inf
        else:
            order = (extent if number % 4 == 1 else keys) * np.exp(config.shuffle * rng.normal(size=len(charts)))
            width = max(math.ceil(best) - 1 - int(rng.integers(0, 3)), narrowest)
            tightness, most = float(np.exp(rng.normal())), best
        found = drop(shapes, np.argsort(-order, kind="stable"), width, tightness=tightness, most=most)
        if found is not None and (side := max(found.width, found.height)) < best:
            best, keys = side, order
    return sum(chart.area for chart in charts) / best**2
