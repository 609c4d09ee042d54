"""The smallest gap between two charts of a uv layout.

s segments of chart outlines, n points sampled on them.  The closest two points of different colour in a point set are
joined by an edge of its Delaunay triangulation (the circle on them as diameter is empty), so one triangulation of
points sampled on all outlines finds the gap, however many charts there are; the segments there make it exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import Delaunay, KDTree

from .triangles import cross_2d

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MOST_SAMPLES = 400_000
_CELLS = 8
"""Squares to the distance up to which segments are looked for: those of far squares are not compared one by one."""
_BLOCK = 2_000_000
"""Pairs of samples compared at a time."""
_COARSE = 4
"""Spacings from one sample to the next where pairs that may be the closest are looked for."""
_REACHES = (1.0, 3.0, 9.0, 27.0)
"""Such distances up to which they are; beyond, a triangulation is quicker."""


def smallest_chart_gap(segments: NDArray[np.float64], chart: NDArray[np.int64], *, spacing: float) -> float | None:
    """Smallest distance between outlines of different charts; they may touch, but not cross.

    Args:
        segments: (s, 2, 2) float64 uv ends of the outline segments.
        chart: (s,) int64 chart of each.
        spacing: distance of the samples, uv units; the result is at most that too large, and mostly exact.  Grows
            where it would take more than 400,000 samples.

    Returns:
        The gap in uv units; None where there is one chart only, or all outlines lie on one line.
    """
    if not has_gaps(segments, chart):
        return None
    points, owner, coarse = _samples(segments, _COARSE * spacing)
    row, start, _ = _cells(points, chart[owner], coarse / 2.0)
    some = row[start[:-1]]
    reach = _gap_of_points(points[some], chart[owner[some]], coarse)
    if reach is None:
        pairs = facing_segments(segments, chart, spacing=spacing, reach=2.0 * spacing)
    else:
        pairs = near_segments(segments, chart, spacing=coarse, reach=reach)
    return float(segment_distance(segments[pairs[:, 0]], segments[pairs[:, 1]]).min())


def has_gaps(segments: NDArray[np.float64], chart: NDArray[np.int64]) -> bool:
    """False where there is one chart only, or all outlines lie on one line."""
    if len(np.unique(chart)) < 2:  # closed surfaces without a seam have no outline at all
        return False
    extent = np.ptp(segments.reshape(-1, 2), axis=0)
    return bool(extent.min() > 1e-9 * extent.max())


def _gap_of_points(points: NDArray[np.float64], chart: NDArray[np.int64], spacing: float) -> float | None:
    """Smallest distance of points (n, 2) of different charts (n,); None where it is many times their spacing."""
    tree = KDTree(points)
    for steps in _REACHES:
        one, other = tree.query_pairs(steps * spacing, output_type="ndarray").T
        across = chart[one] != chart[other]
        if across.any():
            return float(np.linalg.norm(points[one[across]] - points[other[across]], axis=1).min())
    return None


def facing_segments(
    segments: NDArray[np.float64], chart: NDArray[np.int64], *, spacing: float, reach: float
) -> NDArray[np.int64]:
    """Pairs of segments of different charts that face each other across the gap between their charts.

    Args:
        segments: (s, 2, 2) float64 uv ends of the outline segments.
        chart: (s,) int64 chart of each.
        spacing: distance of the samples, uv units; grows where it would take more than 400,000 samples.
        reach: uv units; pairs are found up to this much beyond the smallest distance.

    Returns:
        (p, 2) int64 segment indices; none where there is one chart only, or all outlines lie on one line.
    """
    if not has_gaps(segments, chart):
        return np.zeros((0, 2), dtype=np.int64)
    points, owner = sample_segments(segments, spacing)
    order = np.lexsort((chart[owner], points[:, 1], points[:, 0]))
    points, owner = points[order], owner[order]
    same = (points[1:] == points[:-1]).all(axis=1)
    touching = np.stack([owner[:-1][same], owner[1:][same]], axis=1)
    touching = touching[chart[touching[:, 0]] != chart[touching[:, 1]]]
    if len(touching):
        return touching
    distinct = np.append(True, ~same)
    points, owner = points[distinct], owner[distinct]
    simplices = Delaunay(points).simplices.astype(np.int64)
    a, b = np.concatenate([simplices[:, [0, 1]], simplices[:, [1, 2]], simplices[:, [2, 0]]]).T
    across = chart[owner[a]] != chart[owner[b]]
    a, b = a[across], b[across]
    distance = np.linalg.norm(points[a] - points[b], axis=1)
    near = distance <= distance.min() + reach
    return np.unique(np.sort(np.stack([owner[a[near]], owner[b[near]]], axis=1), axis=1), axis=0)


def near_segments(
    segments: NDArray[np.float64], chart: NDArray[np.int64], *, spacing: float, reach: float
) -> NDArray[np.int64]:
    """All pairs of segments of different charts that are at most reach apart, and some that are a little more.

    Args:
        segments: (s, 2, 2) float64 uv ends of the outline segments.
        chart: (s,) int64 chart of each.
        spacing: distance of the samples, uv units; the finer, the more of them and the fewer pairs too many.
        reach: uv units.

    Returns:
        (p, 2) int64 segment indices.
    """
    points, owner, _ = _samples(segments, spacing)
    step = np.linalg.norm(points[1:] - points[:-1], axis=1)[owner[1:] == owner[:-1]].max(initial=0.0)
    radius = reach + float(step)
    cell = radius / _CELLS
    row, start, centre = _cells(points, chart[owner], cell)
    size = np.diff(start)
    one, other = KDTree(centre).query_pairs(radius + np.sqrt(2.0) * cell, output_type="ndarray").T
    across = chart[owner[row[start[one]]]] != chart[owner[row[start[other]]]]
    one, other = one[across].astype(np.int64), other[across].astype(np.int64)
    found = [np.zeros((0, 2), dtype=np.int64)]
    for block in np.array_split(np.arange(len(one)), max(int((size[one] * size[other]).sum()) // _BLOCK, 1)):
        count = size[other[block]]
        pair = np.repeat(np.arange(len(block)), size[one[block]] * count)
        index = np.arange(len(pair)) - np.searchsorted(pair, pair)
        first = row[start[one[block]][pair] + index // count[pair]]
        second = row[start[other[block]][pair] + index % count[pair]]
        near = ((points[first] - points[second]) ** 2).sum(axis=1) <= radius**2
        both = np.sort(np.stack([owner[first[near]], owner[second[near]]], axis=1), axis=1)
        found.append(np.unique(both, axis=0))
    return np.unique(np.concatenate(found), axis=0)


def spread(segments: NDArray[np.float64], chart: NDArray[np.int64], *, cell: float) -> NDArray[np.int64]:
    """(r,) rows of the segments (s, 2, 2), one for each chart and each square of so many uv units that it passes."""
    row, start, _ = _cells(segments.mean(axis=1), chart, cell)
    return np.sort(row[start[:-1]])


def _cells(
    points: NDArray[np.float64], chart: NDArray[np.int64], cell: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Points (n, 2) by chart (n,) and square: rows (n,), where each square's begin (c + 1,), its centre (c, 2)."""
    place = np.floor(points / cell).astype(np.int64)
    row = np.lexsort((place[:, 1], place[:, 0], chart))
    key = np.column_stack([chart, place])[row]
    begins = np.flatnonzero(np.append(True, (key[1:] != key[:-1]).any(axis=1)))
    return row, np.append(begins, len(row)), (key[begins, 1:].astype(np.float64) + 0.5) * cell


def segment_distance(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) distances of segments first and second, both (n, 2, 2); 0 where they cross."""
    one, two = closest_points(first, second)
    crosses = (_sides(first, second) < 0.0) & (_sides(second, first) < 0.0)
    return np.where(crosses, 0.0, np.linalg.norm(one - two, axis=1))


def closest_points(
    first: NDArray[np.float64], second: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Closest points (n, 2) on segments first and (n, 2) on second, both (n, 2, 2), that don't cross."""
    ends = [(first[:, 0], second), (first[:, 1], second), (second[:, 0], first), (second[:, 1], first)]
    feet = np.stack([_foot(point, segment) for point, segment in ends], axis=1)
    points = np.stack([point for point, _ in ends], axis=1)
    best = np.linalg.norm(points - feet, axis=2).argmin(axis=1)
    row = np.arange(len(best))
    point, foot = points[row, best], feet[row, best]
    own = (best < 2)[:, None]
    return np.where(own, point, foot), np.where(own, foot, point)


def _sides(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) negative where the ends of second lie on different sides of the line of first."""
    along, offset = first[:, None, 1] - first[:, None, 0], second - first[:, None, 0]
    return np.prod(cross_2d(along, offset), axis=1)


def _foot(point: NDArray[np.float64], segment: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 2) closest points on segments (n, 2, 2) to points (n, 2)."""
    along, offset = segment[:, 1] - segment[:, 0], point - segment[:, 0]
    length = np.maximum((along**2).sum(axis=1), np.finfo(np.float64).tiny)
    share = np.clip((along * offset).sum(axis=1) / length, 0.0, 1.0)
    return segment[:, 0] + share[:, None] * along


def sample_segments(segments: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (n, 2) on the segments (s, 2, 2), ends included, at most spacing apart, and the segment (n,) of each."""
    points, owner, _ = _samples(segments, spacing)
    return points, owner


def _samples(segments: NDArray[np.float64], spacing: float) -> tuple[NDArray[np.float64], NDArray[np.int64], float]:
    """The same, and the spacing in force: wider where it would take too many."""
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    spacing = max(spacing, float(length.sum()) / _MOST_SAMPLES)
    steps = np.maximum(np.ceil(length / spacing).astype(np.int64), 1)
    owner = np.repeat(np.arange(len(segments)), steps + 1)
    index = np.arange(len(owner)) - np.repeat(np.cumsum(steps + 1) - (steps + 1), steps + 1)
    share = (index / steps[owner])[:, None]
    return segments[owner, 0] * (1.0 - share) + segments[owner, 1] * share, owner, spacing
