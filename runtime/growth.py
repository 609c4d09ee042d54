"""Placed charts grow where they lie, until two outlines are as close as their padding allows.

k charts · s outline segments · p pairs of segments that face each other.  Placement on a coarse grid leaves slack
between charts; this takes it back, exactly: distances are those of the outlines themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .gaps import facing_segments, segment_distance

if TYPE_CHECKING:
    from numpy.typing import NDArray

_GROWTH_ROUNDS = 6
_LEAST_FACTOR = 0.9


def apply_placement(
    placement: NDArray[np.float64], face_chart: NDArray[np.int64], corner_uv: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Chart coordinates (f, 3, 2) → atlas uv (f, 3, 2) by placement (k, 2, 3); equal in, equal out, bit by bit."""
    matrix = placement[face_chart][:, None]
    x, y = corner_uv[..., 0], corner_uv[..., 1]
    return np.stack([matrix[..., i, 0] * x + matrix[..., i, 1] * y + matrix[..., i, 2] for i in (0, 1)], axis=-1)


def grown(
    placement: NDArray[np.float64], outlines: list[NDArray[np.float64]], size: int, padding: int
) -> NDArray[np.float64]:
    """The placement (k, 2, 3) with all charts as large as the padding allows where they lie.

    Each chart is scaled about the centre of its box by one common factor, and the whole to fill the square.  Distances
    keep a few float32 steps more than the padding, so that rounding doesn't undercut it.

    Args:
        placement: (k, 2, 3) float64, chart coordinates → atlas uv, with the padding kept.
        outlines: per chart its outline segments (s, 2, 2) float64 in chart coordinates.
        size: texels per side.
        padding: texels.
    """
    chart = np.repeat(np.arange(len(outlines)), [len(outline) for outline in outlines])
    segments = apply_placement(placement, chart, np.concatenate(outlines))
    parts = np.split(segments, np.cumsum([len(outline) for outline in outlines])[:-1])
    box = np.array([(part.min(axis=(0, 1)), part.max(axis=(0, 1))) for part in parts])
    spread = _Spread(box.mean(axis=1), box[:, 1] - box.mean(axis=1), padding / size + 2.0**-23)
    apart, spacing, factor = 2.0 * padding / size + 2.0**-22, 2.0 / size, 1.0
    pairs = facing_segments(segments, chart, spacing=spacing, reach=8.0 * spacing)
    for _ in range(_GROWTH_ROUNDS):
        if len(pairs) == 0:
            break
        factor = _largest_factor(spread, segments[pairs], chart[pairs], apart)
        moved = spread.apply(segments, chart, factor)
        closest = facing_segments(moved, chart, spacing=spacing, reach=2.0 * spacing)
        if segment_distance(moved[closest[:, 0]], moved[closest[:, 1]]).min() >= apart:
            break
        pairs, factor = np.concatenate([pairs, closest]), _LEAST_FACTOR
    matrix = spread.matrix(factor)
    linear, shift = placement[:, :, :2] * matrix[:, :, :1], placement[:, :, 2] * matrix[:, :, 0] + matrix[:, :, 1]
    return np.concatenate([linear, shift[:, :, None]], axis=2)


@dataclass(frozen=True, eq=False)
class _Spread:
    """Charts scaled about the centres (k, 2) of their boxes of half size (k, 2), the whole fitted to the square."""

    centre: NDArray[np.float64]
    half: NDArray[np.float64]
    border: float

    def matrix(self, factor: float) -> NDArray[np.float64]:
        """(k, 2, 2) float64: per chart and axis, scale and shift."""
        low, high = (self.centre - factor * self.half).min(axis=0), (self.centre + factor * self.half).max(axis=0)
        fit = (1.0 - 2.0 * self.border) / float((high - low).max())
        scale = np.full_like(self.centre, fit * factor)
        return np.stack([scale, self.border + fit * (self.centre * (1.0 - factor) - low)], axis=2)

    def apply(self, points: NDArray[np.float64], chart: NDArray[np.int64], factor: float) -> NDArray[np.float64]:
        """Points (…, 2, 2) of segments of charts (…) moved."""
        matrix = self.matrix(factor)[chart][..., None, :, :]
        return points * matrix[..., 0] + matrix[..., 1]


def _largest_factor(spread: _Spread, pairs: NDArray[np.float64], chart: NDArray[np.int64], apart: float) -> float:
    """Largest factor up to which pairs (p, 2, 2, 2) of segments of charts (p, 2) stay apart; at least _LEAST_FACTOR."""

    def free(factor: float) -> bool:
        moved = spread.apply(pairs, chart, factor)
        return bool(segment_distance(moved[:, 0], moved[:, 1]).min() >= apart)

    low, high = _LEAST_FACTOR, 1.5
    for tried in np.linspace(low, high, 61)[1:].tolist():
        if not free(tried):
            high = tried
            break
        low = tried
    for _ in range(20):
        middle = (low + high) / 2.0
        low, high = (middle, high) if free(middle) else (low, middle)
    return low
