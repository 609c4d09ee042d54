"""The exact overlap test: which triangles of a uv layout have interiors that intersect.

uv triangles (f, 3, 2) float64, any units; p pairs.  "Exact" means: the answer for the float64 coordinates as given,
with no tolerance.  Signs of determinants are taken in float64 where an error bound proves them (Shewchuk, Adaptive
Precision Floating-Point Arithmetic, 1997, section 4.2) and again in integers of any size where it doesn't.

Two triangles with interior, oriented counter-clockwise, have disjoint interiors exactly when the line of one of their
six edges has the whole other triangle on its right or on it (separating axes of convex polygons in the plane).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..kernel.choice import kernel
from .triangles import cross_2d, signed_areas

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

_HALF_ULP = 2.0**-53
_ERROR_BOUND = (3.0 + 16.0 * _HALF_ULP) * _HALF_ULP
_UNDERFLOW = 1e-280
_CHUNK = 1 << 18


def orientation_sign(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.int8]:
    """Exact sign of the signed area of the triangles a b c; each (n, 2) float64, finite.

    Returns:
        (n,) int8: 1 counter-clockwise, −1 clockwise, 0 collinear.
    """
    compiled = kernel()
    found = compiled.orientation_sign(a, b, c) if compiled else None
    if found is not None:
        return found
    value, bound = _determinant(a, b, c)
    sign = np.sign(value).astype(np.int8)
    unsure = np.flatnonzero(~((np.abs(value) > bound) | (bound == 0.0)))
    sign[unsure] = _integer_sign(a[unsure], b[unsure], c[unsure])
    return sign


def flipped_triangles(uv: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(f,) bool: the triangle of uv (f, 3, 2) float64 is clockwise or has no area.  Exact."""
    return orientation_sign(uv[:, 0], uv[:, 1], uv[:, 2]) <= 0


def overlapping_pairs(uv: NDArray[np.float64]) -> NDArray[np.int64]:
    """Pairs of triangles whose interiors intersect.  Exact; touching in a point or along an edge is no overlap.

    Args:
        uv: (f, 3, 2) float64, finite.  Clockwise triangles count like others; those without area have no interior.

    Returns:
        (p, 2) int64, lower index first, sorted.
    """
    compiled = kernel()
    found = compiled.overlapping_pairs(uv) if compiled else None
    if found is not None:
        return found
    sign = orientation_sign(uv[:, 0], uv[:, 1], uv[:, 2])
    solid = np.flatnonzero(sign)
    triangles = np.where((sign < 0)[:, None, None], uv[:, ::-1], uv)[solid]
    found = [pairs[_interiors_meet(triangles, pairs)] for pairs in _candidate_pairs(triangles)]
    pairs = np.concatenate(found) if found else np.zeros((0, 2), dtype=np.int64)
    pairs = np.sort(solid[pairs], axis=1)
    return pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))]


def overlaps_anywhere(uv: NDArray[np.float64]) -> bool:
    """True where the interiors of two triangles (f, 3, 2) intersect: ``overlapping_pairs`` up to the first."""
    compiled = kernel()
    found = compiled.overlaps_anywhere(uv) if compiled else None
    if found is not None:
        return found
    sign = orientation_sign(uv[:, 0], uv[:, 1], uv[:, 2])
    solid = np.flatnonzero(sign)
    triangles = np.where((sign < 0)[:, None, None], uv[:, ::-1], uv)[solid]
    return any(bool(_interiors_meet(triangles, pairs).any()) for pairs in _candidate_pairs(triangles))


def overlap_area(uv: NDArray[np.float64], pairs: NDArray[np.int64]) -> float:
    """Summed areas of the intersections of pairs (p, 2) of triangles of uv (f, 3, 2), in uv units squared."""
    sign = orientation_sign(uv[:, 0], uv[:, 1], uv[:, 2])
    triangles = np.where((sign < 0)[:, None, None], uv[:, ::-1], uv)
    blocks = [pairs[at : at + _CHUNK // 8] for at in range(0, len(pairs), _CHUNK // 8)]
    return float(sum(_intersection_areas(triangles[block[:, 0]], triangles[block[:, 1]]).sum() for block in blocks))


def overlap_fraction(uv: NDArray[np.float64]) -> float:
    """Overlap area over total triangle area of uv (f, 3, 2), in [0, ∞): exactly 0 where no interiors intersect.

    A region under m triangles counts once for each pair of them, so it can exceed 1.
    """
    pairs = overlapping_pairs(uv)
    return overlap_area(uv, pairs) / float(np.abs(signed_areas(uv)).sum()) if len(pairs) else 0.0


def _determinant(
    a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Twice the signed area of a b c (…, 2) and a bound of its rounding error; bound 0 = exactly zero."""
    ax, ay = a[..., 0] - c[..., 0], a[..., 1] - c[..., 1]
    bx, by = b[..., 0] - c[..., 0], b[..., 1] - c[..., 1]
    left, right = ax * by, ay * bx
    size = np.abs(left) + np.abs(right)
    bound = np.where(size < _UNDERFLOW, np.inf, _ERROR_BOUND * size)
    bound[((ax == 0.0) | (by == 0.0)) & ((ay == 0.0) | (bx == 0.0))] = 0.0
    return left - right, bound


def _integer_sign(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.int8]:
    """Sign of the signed area of a b c (n, 2) in integers: each row is scaled by a power of two that makes it whole."""
    mantissa, exponent = np.frexp(np.stack([a, b, c], axis=1))
    whole = (mantissa * 2.0**53).astype(np.int64).astype(object)
    shift = np.where(
        mantissa == 0.0, 0, exponent - np.where(mantissa == 0.0, 2000, exponent).min(axis=(1, 2), keepdims=True)
    )
    points = whole << shift.astype(object)
    ax, ay, bx, by = (points[:, i, j] - points[:, 2, j] for i in (0, 1) for j in (0, 1))
    return np.sign(ax * by - ay * bx).astype(np.int8)


def _interiors_meet(triangles: NDArray[np.float64], pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(p,) bool for pairs (p, 2) of counter-clockwise triangles (f, 3, 2): no edge line separates them."""
    meets = np.ones(len(pairs), dtype=bool)
    unsure: list[tuple[NDArray[np.int64], int, int]] = []
    for own, i in ((own, i) for own in (0, 1) for i in range(3)):
        rows = np.flatnonzero(meets)
        a, b, points = _edge_and_points(triangles, pairs[rows], own, i)
        value, bound = _determinant(a, b, points)
        certain = (value < -bound) | (bound == 0.0)
        separates = certain.all(axis=1)
        meets[rows[separates]] = False
        maybe = ~separates & ~(value > bound).any(axis=1)
        unsure.append((rows[maybe], own, i))
    for rows, own, i in unsure:
        left = rows[meets[rows]]
        a, b, points = _edge_and_points(triangles, pairs[left], own, i)
        a, b = np.broadcast_to(a, points.shape).reshape(-1, 2), np.broadcast_to(b, points.shape).reshape(-1, 2)
        outside = orientation_sign(a, b, points.reshape(-1, 2)).reshape(-1, 3) <= 0
        meets[left[outside.all(axis=1)]] = False
    return meets


def _edge_and_points(
    triangles: NDArray[np.float64], pairs: NDArray[np.int64], own: int, i: int
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Ends (p, 1, 2) of edge i of the pair's triangle `own`, and the corners (p, 3, 2) of the other one."""
    mine = pairs[:, own]
    return triangles[mine, None, i], triangles[mine, None, (i + 1) % 3], triangles[pairs[:, 1 - own]]


def _candidate_pairs(triangles: NDArray[np.float64]) -> Iterator[NDArray[np.int64]]:
    """Blocks (p, 2) of the pairs of triangles (f, 3, 2) whose bounding boxes overlap, each pair once.

    A hierarchy of grids: a triangle lives on the level whose cells are just larger than its box, so it covers at most
    four cells there and on each coarser level; two triangles meet on the level of the larger one.  Across the main
    direction of all edges they must overlap too: the boxes of needles that lie aslant side by side all do.
    """
    if len(triangles) < 2:
        return
    near, far = _across_main_direction(triangles)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    origin = low.min(axis=0)
    coarsest = int(np.frexp((high.max(axis=0) - origin).max())[1])
    level = np.maximum(np.frexp((high - low).max(axis=1))[1].astype(np.int64), coarsest - 24)
    for current in np.unique(level).tolist():
        first, last = (np.floor((side - origin) / 2.0**current).astype(np.int64) for side in (low, high))
        for a, b in _grid_pairs(first, last, np.flatnonzero(level == current), np.flatnonzero(level <= current)):
            keep = (level[a] < current) | (a < b)
            a, b = a[keep], b[keep]
            meet = np.all((low[a] < high[b]) & (low[b] < high[a]), axis=1)
            meet &= (near[a] <= far[b]) & (near[b] <= far[a])
            yield np.stack([a[meet], b[meet]], axis=1)


def _across_main_direction(triangles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """(f,) least and greatest coordinate across the direction of most edge length, no less apart than without rounding.

    Of triangles (f, 3, 2).
    """
    edges = (np.roll(triangles, -1, axis=1) - triangles).reshape(-1, 2)
    edges /= max(float(np.abs(edges).max()), 1e-300)
    across = np.linalg.eigh(edges.T @ edges)[1][:, 0]
    place = triangles @ across
    slack = 8.0 * _HALF_ULP * float(np.abs(triangles).max())
    return place.min(axis=1) - slack, place.max(axis=1) + slack


def _grid_pairs(
    first: NDArray[np.int64], last: NDArray[np.int64], members: NDArray[np.int64], others: NDArray[np.int64]
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Blocks of pairs (one of others, one of members) that share a cell of one grid; each ordered pair once.

    first and last: (f, 2) int64 cells of the boxes' corners.  A pair that shares cells counts in the lowest one.
    """
    key, member = _cell_entries(first, last, members)
    order = np.argsort(key, kind="stable")
    key, member = key[order], member[order]
    other_key, other = _cell_entries(first, last, others)
    begin = np.searchsorted(key, other_key, "left")
    count = np.searchsorted(key, other_key, "right") - begin
    total = np.concatenate([[0], np.cumsum(count)])
    at = 0
    while at < len(count):
        stop = max(at + 1, int(np.searchsorted(total, total[at] + _CHUNK, "right")) - 1)
        row = np.repeat(np.arange(at, stop), count[at:stop])
        column = begin[row] + np.arange(len(row)) - (total[row] - total[at])
        a, b = other[row], member[column]
        lowest = _cell_key(np.maximum(first[a], first[b])) == other_key[row]
        yield a[lowest], b[lowest]
        at = stop


def _cell_key(cell: NDArray[np.int64]) -> NDArray[np.int64]:
    """One number per cell (…, 2)."""
    return cell[..., 1] << 32 | cell[..., 0]


def _cell_entries(
    first: NDArray[np.int64], last: NDArray[np.int64], members: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Keys of the cells that the boxes of members cover, and whose they are; boxes cover at most 2 × 2 cells."""
    low, high = first[members], last[members]
    wide, tall = high[:, 0] > low[:, 0], high[:, 1] > low[:, 1]
    corners = [(low, np.ones_like(wide)), (high, wide & tall)]
    corners += [(np.stack([high[:, 0], low[:, 1]], axis=1), wide), (np.stack([low[:, 0], high[:, 1]], axis=1), tall)]
    keys = np.concatenate([_cell_key(cell[there]) for cell, there in corners])
    return keys, np.concatenate([members[there] for _, there in corners])


def _intersection_areas(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(p,) areas of the intersections of counter-clockwise triangles first and second, both (p, 3, 2).

    Sutherland and Hodgman's clipping in place: slots of clipped corners repeat the corner before, which adds no area.
    """
    origin = first.mean(axis=1, keepdims=True)
    polygon, second = first - origin, second - origin
    for i in range(3):
        polygon = _clip(polygon, second[:, i], second[:, (i + 1) % 3])
    following = np.roll(polygon, -1, axis=1)
    return np.maximum(0.5 * cross_2d(polygon, following).sum(axis=1), 0.0)


def _clip(polygon: NDArray[np.float64], a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """The part (p, 2m, 2) of convex polygons (p, m, 2) to the left of the lines a → b (p, 2); zeros where none is."""
    along = b - a
    height = cross_2d(along[:, None], polygon - a[:, None])
    following, next_height = np.roll(polygon, -1, axis=1), np.roll(height, -1, axis=1)
    crosses = (height > 0.0) != (next_height > 0.0)
    share = np.divide(height, height - next_height, out=np.zeros_like(height), where=crosses)
    crossing = polygon + share[..., None] * (following - polygon)
    slots = np.stack([polygon, crossing], axis=2).reshape(len(polygon), -1, 2)
    valid = np.stack([height > 0.0, crosses], axis=2).reshape(len(polygon), -1)
    latest = np.maximum.accumulate(np.where(valid, np.arange(valid.shape[1]), -1), axis=1)
    latest = np.where(latest < 0, latest[:, -1:], latest)
    filled = np.take_along_axis(slots, np.maximum(latest, 0)[..., None], axis=1)
    return np.where((latest[:, -1] >= 0)[:, None, None], filled, 0.0)
