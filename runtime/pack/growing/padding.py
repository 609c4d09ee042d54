"""Padding, enforced: charts shrink or grow together until every two of them are exactly far enough apart.

k charts · s outline segments · p pairs of segments.  All charts keep one common scale; distances are those of the
outlines themselves.  Whatever places charts, this comes last.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import FinishError
from ...geometry.gaps import near_segments, segment_distance, spread

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import GrowthConfig


@dataclass(frozen=True, eq=False)
class Crowd:
    """Charts in place: local segments (s, 2, 2) about their centre (k, 2), scaled by one factor; half boxes (k, 2).

    Segments of a chart follow each other.  extent: (2,) of the page, and all lengths, in sides of it.
    """

    local: NDArray[np.float64]
    chart: NDArray[np.int64]
    half: NDArray[np.float64]
    centre: NDArray[np.float64]
    factor: float
    extent: NDArray[np.float64]

    def segments(self) -> NDArray[np.float64]:
        """(s, 2, 2) where the segments lie."""
        return self.centre[self.chart][:, None] + self.factor * self.local

    def turned(self, angle: NDArray[np.float64]) -> Crowd:
        """Charts turned by angles (k,) about their centres, which are those of their boxes again."""
        cosine, sine = np.cos(angle)[self.chart, None], np.sin(angle)[self.chart, None]
        x, y = self.local[..., 0], self.local[..., 1]
        local = np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1)
        first = np.searchsorted(self.chart, np.arange(len(self.centre)))
        low = np.minimum.reduceat(local.min(axis=1), first)
        high = np.maximum.reduceat(local.max(axis=1), first)
        middle = (low + high) / 2.0
        return replace(
            self,
            local=local - middle[self.chart][:, None],
            half=(high - low) / 2.0,
            centre=self.centre + self.factor * middle,
        )


def padded(crowd: Crowd, border: float, apart: float, config: GrowthConfig) -> Crowd:
    """The crowd with the largest factor that keeps all distances exactly, charts where they are.

    border: from each side of the page, apart: between two charts.

    Raises:
        FinishError: no factor keeps them, or the repairs that the config allows did not suffice.
    """
    room = np.minimum(crowd.centre, crowd.extent - crowd.centre) - border
    walls = float((room / np.maximum(crowd.half, 1e-300)).min())
    spacing = max(config.sample / 2.0, apart / 2.0)
    segments = crowd.segments()
    some = spread(segments, crowd.chart, cell=spacing / 4.0)  # the repairs find what these leave out
    pairs = some[near_segments(segments[some], crowd.chart[some], spacing=spacing, reach=apart + spacing)]
    for _ in range(config.repairs):
        crowd = replace(crowd, factor=largest_factor(crowd, pairs, apart, walls))
        if crowd.factor == 0.0:
            raise FinishError(f"centres of charts lie closer than {apart:.3g} of the atlas side; please report")
        closest = near_segments(crowd.segments(), crowd.chart, spacing=spacing, reach=apart)
        if are_apart(crowd, closest, apart):
            return crowd
        pairs = np.concatenate([pairs, closest])
    raise FinishError(
        f"charts stay closer than {apart:.3g} of the atlas side after {config.repairs} repairs; please report"
    )


def largest_factor(crowd: Crowd, pairs: NDArray[np.int64], apart: float, walls: float) -> float:
    """Largest factor up to walls, and 1.25 times the crowd's own, at which pairs (p, 2) of segments stay apart.

    The interval is halved.  A distance changes no faster with the factor than local points of the two segments differ,
    so that pairs which stay apart within all of what is left are not measured again.
    """
    low, high = 0.0, min(walls, 1.25 * crowd.factor)
    if are_apart(replace(crowd, factor=high), pairs, apart):
        return high
    one, two = (crowd.local[rows] for rows in pairs.T)
    speed = np.linalg.norm(one[:, :, None] - two[:, None], axis=3).max(axis=(1, 2))
    for _ in range(40):
        middle = (low + high) / 2.0
        distance = distances(replace(crowd, factor=middle), pairs)
        low, high = (low, middle) if (distance < apart).any() else (middle, high)
        open_ = distance - (high - low) * speed < (1.0 + 1e-9) * apart
        pairs, speed = pairs[open_], speed[open_]
    return low


def are_apart(crowd: Crowd, pairs: NDArray[np.int64], apart: float) -> bool:
    """True where all pairs (p, 2) of segments keep their distance."""
    return not bool((distances(crowd, pairs) < apart).any())


def distances(crowd: Crowd, pairs: NDArray[np.int64]) -> NDArray[np.float64]:
    """(p,) between the segments of pairs (p, 2)."""
    one, two = (crowd.centre[crowd.chart[rows]][:, None] + crowd.factor * crowd.local[rows] for rows in pairs.T)
    return segment_distance(one, two)
