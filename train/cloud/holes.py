"""Small holes of a triangulated cloud, closed without new points.

h holes of one length · m edges of each.  A loop runs as its faces' half-edges do, so the hole lies to its right; the
triangles that close it run the other way.  Of all triangulations of a loop the best is found by dynamic programming
(Klincsek 1980), for all loops of one length at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.topology import boundary_loops
from ...runtime.geometry.triangles import triangle_normals
from .stars import circumradius

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import CloudConfig


def hole_triangles(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    spacing: NDArray[np.float64],
    faces: NDArray[np.int64],
    config: CloudConfig,
    among: NDArray[np.bool_] | None = None,
) -> NDArray[np.int64]:
    """Triangles (t, 3) int64 that close the small boundary loops of faces (f, 3) int64; whole holes or nothing of them.

    Args:
        points: (d, 3) float64.
        normals: (d, 3) float64 unit, oriented as the faces are.
        spacing: (d,) float64 local spacing.
        faces: (f, 3) int64.
        config: the numbers of holes.
        among: (d,) bool, the vertices that a loop has to consist of; None: of any.
    """
    whole = [loop for loop in boundary_loops(faces) if len(loop) <= config.touching_holes * config.hole_edges]
    whole = whole if among is None else [loop for loop in whole if among[loop].all()]
    loops = [simple[::-1] for loop in whole for simple in simple_loops(loop) if 3 <= len(simple) <= config.hole_edges]
    there, taken = np.sort(_edge_keys(faces, len(points))), set[int]()
    closed: list[NDArray[np.int64]] = [np.zeros((0, 3), dtype=np.int64)]
    for length in sorted({len(loop) for loop in loops}):
        batch = np.stack([loop for loop in loops if len(loop) == length])
        batch = batch[_narrow(points[batch], spacing[batch], config.hole_width)]
        for triangles in _best(points, normals, batch, config):
            inner = _edge_keys(triangles, len(points))
            values, counts = np.unique(inner, return_counts=True)
            diagonals = values[counts == 2]
            place = np.minimum(np.searchsorted(there, diagonals), len(there) - 1)
            if (there[place] != diagonals).all() and taken.isdisjoint(diagonals.tolist()):
                taken |= set(diagonals.tolist())
                closed.append(triangles)
    return np.concatenate(closed)


def simple_loops(loop: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """A closed loop (n,) taken apart where it comes back to a vertex: holes that touch there."""
    if len(set(loop.tolist())) == len(loop):
        return [loop]
    done: list[NDArray[np.int64]] = []
    path: list[int] = []
    for vertex in loop.tolist():
        if vertex in path:
            start = path.index(vertex)
            done.append(np.array(path[start:], dtype=np.int64))
            del path[start:]
        path.append(vertex)
    return [*done, np.array(path, dtype=np.int64)]


def _edge_keys(faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    return np.minimum(start, end) * count + np.maximum(start, end)


def _narrow(loops: NDArray[np.float64], spacing: NDArray[np.float64], width: float) -> NDArray[np.bool_]:
    """(h,) bool: no two points of the loop (h, m, 3) are further apart than width spacings."""
    extent = np.linalg.norm(loops[:, :, None] - loops[:, None], axis=3).max(axis=(1, 2))
    return extent <= width * spacing.mean(axis=1)


def _best(
    points: NDArray[np.float64], normals: NDArray[np.float64], loops: NDArray[np.int64], config: CloudConfig
) -> list[NDArray[np.int64]]:
    """The triangulations (m − 2, 3) of those loops (h, m) that have one whose triangles all face outwards."""
    count, m = loops.shape
    cost = np.full((count, m, m), np.inf)
    middle = np.zeros((count, m, m), dtype=np.int64)
    cost[:, np.arange(m - 1), np.arange(1, m)] = 0.0
    for gap in range(2, m):
        for first in range(m - gap):
            last = first + gap
            between = np.arange(first + 1, last)
            corners = np.stack(
                np.broadcast_arrays(loops[:, first, None], loops[:, between], loops[:, last, None]), axis=2
            )
            trial = cost[:, first, between] + cost[:, between, last] + _price(points, normals, corners, config)
            middle[:, first, last] = between[trial.argmin(axis=1)]
            cost[:, first, last] = trial.min(axis=1)
    done = np.isfinite(cost[:, 0, -1])
    return [_unfolded(loop, at) for loop, at in zip(loops[done], middle[done], strict=True)]


def _price(
    points: NDArray[np.float64], normals: NDArray[np.float64], corners: NDArray[np.int64], config: CloudConfig
) -> NDArray[np.float64]:
    """(h, b) costs of triangles (h, b, 3): circumradius, more where they turn from the normals of their corners.

    Infinite where they turn too far.
    """
    triangles = points[corners]
    unit = triangle_normals(triangles)
    mean = np.einsum("hbc,hbic->hb", unit, normals[corners]) / 3.0
    radius = circumradius(triangles.reshape(-1, 3, 3)).reshape(corners.shape[:2])
    return np.where(mean > config.hole_facing, radius * (config.hole_turn - mean), np.inf)


def _unfolded(loop: NDArray[np.int64], middle: NDArray[np.int64]) -> NDArray[np.int64]:
    """The triangles (m − 2, 3) of one loop (m,) by its table of apexes (m, m)."""
    triangles, open_spans = [], [(0, len(loop) - 1)]
    while open_spans:
        first, last = open_spans.pop()
        if last - first > 1:
            apex = int(middle[first, last])
            triangles.append((loop[first], loop[apex], loop[last]))
            open_spans += [(first, apex), (apex, last)]
    return np.array(triangles, dtype=np.int64)
