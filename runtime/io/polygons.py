"""Polygons of a file → triangles: fans where that is right, ear clipping where a fan would turn inside out.

p polygons · c corners of all of them, one polygon after the other · f triangles.  A polygon's plane is that of its
Newell normal, half the sum of the cross products of its edges (Sutherland, Sproull, Schumacker 1974); seen against it
the polygon runs counter-clockwise.  Ear clipping as in Meisters 1975: a corner is an ear when it turns left and no
other corner lies in its triangle; cutting it off changes only whether its two neighbours are ears (Eberly 1998).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import MeshError
from .limits import limits, raised

if TYPE_CHECKING:
    from numpy.typing import NDArray

FLAT = 1e-12
"""Twice the area of a triangle of a polygon of extent 1 below which its corners count as in one line."""


class Triangles(NamedTuple):
    """The polygons of a file as triangles.

    faces: (f, 3) int64 vertices.  corner: (f, 3) int64 places in the list of all corners.  polygon: (f,) int64 number
    of each one's polygon in the file.  left_out: how many polygons have under three corners.
    """

    faces: NDArray[np.int64]
    corner: NDArray[np.int64]
    polygon: NDArray[np.int64]
    left_out: int


def triangles_of(
    points: NDArray[np.float64], corners: NDArray[np.int64], size: NDArray[np.int64], kind: str
) -> Triangles:
    """Triangles of the polygons that have three corners or more.

    Args:
        points: (n, 3) float64.
        corners: (c,) int64, meant to be vertices.
        size: (p,) int64 corners of each polygon, in their order.
        kind: name of the format, for messages.

    Raises:
        MeshError: a corner is no vertex, or no polygon has three corners.
    """
    outside = (corners < 0) | (corners >= len(points))
    if outside.any():
        face = int(np.searchsorted(np.cumsum(size), np.argmax(outside), side="right"))
        raise MeshError(
            f"face {face} refers to vertex {corners[np.argmax(outside)]}, expected 0 to {len(points) - 1}; "
            "the mesh is damaged: export it again"
        )
    whole = size >= 3
    if not whole.any():
        raise MeshError(f"all {len(size)} faces of the {kind} file have under three corners; check the export")
    inside = np.flatnonzero(np.repeat(whole, size))
    triangles, polygon = triangulate(points, corners[inside], size[whole])
    corner = inside[triangles]
    return Triangles(corners[corner], corner, np.flatnonzero(whole)[polygon], int(np.count_nonzero(~whole)))


def triangulate(
    points: NDArray[np.float64], corners: NDArray[np.int64], size: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Triangles of polygons, in their order; a polygon of s corners gives s − 2.

    Convex polygons become fans from their first corner.  Others are cut along diagonals inside of them; one that
    crosses itself is cut as well as can be.

    Args:
        points: (n, 3) float64.
        corners: (c,) int64 into points.
        size: (p,) int64 corners of each polygon, each ≥ 3.

    Returns:
        (f, 3) int64 numbers of corners, in [0, c), and (f,) int64 the polygon of each triangle.
    """
    triangles, polygon = fans(size)
    start, most = np.cumsum(size) - size, limits().corners
    for index in np.flatnonzero(_turned_fans(points, corners, size, triangles, polygon)):
        first, count = int(start[index]), int(size[index])
        if count > most:
            raise MeshError(
                f"polygon {index} has {count} corners and is not convex, at most {most} are cut into triangles; "
                f"triangulate it in your program, or {raised('corners')}"
            )
        own = corners[first : first + count]
        triangles[polygon == index] = first + clip_ears(in_its_plane(points[own]))
    return triangles, polygon


def fans(size: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Polygons as fans from their first corner: (f, 3) int64 corner numbers and (f,) int64 polygon of each triangle."""
    count = size - 2
    polygon = np.repeat(np.arange(len(size)), count)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(count) - count, count)
    start = (np.cumsum(size) - size)[polygon]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygon


def strip_triangles(indices: NDArray[np.int64]) -> NDArray[np.int64]:
    """(f, 3) int64 of one triangle strip (f + 2,), every second one turned, so that all wind alike."""
    i = np.arange(max(len(indices) - 2, 0))
    return indices[np.stack([i, i + 1 + i % 2, i + 2 - i % 2], axis=1)]


def _turned_fans(
    points: NDArray[np.float64],
    corners: NDArray[np.int64],
    size: NDArray[np.int64],
    triangles: NDArray[np.int64],
    polygon: NDArray[np.int64],
) -> NDArray[np.bool_]:
    """(p,) bool: polygons whose fan has a triangle that looks the other way, or has no area."""
    bad = np.zeros(len(size), dtype=np.bool_)
    chosen = np.flatnonzero(size[polygon] > 3)
    if len(chosen) == 0:
        return bad
    with np.errstate(invalid="ignore", over="ignore"):  # corners that are not finite are refused when they are used
        corner = points[corners[triangles[chosen]]]
        cross = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
        normal = np.zeros((len(size), 3))
        np.add.at(normal, polygon[chosen], cross)
        along = np.einsum("ij,ij->i", cross, normal[polygon[chosen]])
        whole = np.einsum("ij,ij->i", normal, normal)[polygon[chosen]]
        bad[polygon[chosen[np.isfinite(whole) & np.isfinite(along) & (along <= FLAT * whole)]]] = True
    return bad


def in_its_plane(loop: NDArray[np.float64]) -> NDArray[np.float64]:
    """(s, 2) float64: the polygon (s, 3) in coordinates of its plane, extent 1, counter-clockwise."""
    centred = loop - loop.mean(axis=0)
    centred = centred / max(float(np.abs(centred).max()), np.finfo(np.float64).tiny)
    normal = np.cross(centred, np.roll(centred, -1, axis=0)).sum(axis=0)
    across = np.zeros(3)
    across[int(np.argmin(np.abs(normal)))] = 1.0
    first = np.cross(across, normal)
    first = first / max(float(np.linalg.norm(first)), np.finfo(np.float64).tiny)
    second = np.cross(normal, first)
    second = second / max(float(np.linalg.norm(second)), np.finfo(np.float64).tiny)
    return centred @ np.stack([first, second], axis=1)


def clip_ears(loop: NDArray[np.float64]) -> NDArray[np.int64]:
    """(s − 2, 3) int64 triangles of a counter-clockwise polygon (s, 2) of extent 1: the best-shaped ear first.

    Where a polygon that crosses itself has no ear, the corner that turns left the most goes first.
    """
    before, after = np.roll(np.arange(len(loop)), 1), np.roll(np.arange(len(loop)), -1)
    turn = _turn(loop[before], loop, loop[after])
    shape = np.array([_ear_shape(loop, turn, before, after, index) for index in range(len(loop))])
    triangles = []
    for _ in range(len(loop) - 2):
        ear = int(np.argmax(shape))
        if not np.isfinite(shape[ear]):
            ear = int(np.nanargmax(turn))
        left, right = int(before[ear]), int(after[ear])
        triangles.append((left, ear, right))
        after[left], before[right] = right, left
        shape[ear], turn[ear] = -np.inf, np.nan
        for corner in (left, right):
            turn[corner] = _turn(loop[before[corner]], loop[corner], loop[after[corner]])
        for corner in (left, right):
            shape[corner] = _ear_shape(loop, turn, before, after, corner)
    return np.array(triangles, dtype=np.int64)


def _ear_shape(
    loop: NDArray[np.float64],
    turn: NDArray[np.float64],
    before: NDArray[np.int64],
    after: NDArray[np.int64],
    corner: int,
) -> float:
    """Twice the area over the longest edge squared of an ear; −∞ where the corner is none (turn is NaN when cut)."""
    if not turn[corner] > FLAT:
        return -np.inf
    a, b, c = loop[before[corner]], loop[corner], loop[after[corner]]
    others = loop[turn <= FLAT]  # only corners that don't turn left can be the first inside
    inside = (_turn(a, b, others) >= -FLAT) & (_turn(b, c, others) >= -FLAT) & (_turn(c, a, others) >= -FLAT)
    for own in (a, b, c):
        inside &= (others != own).any(axis=1)
    longest = max(float(((b - a) ** 2).sum()), float(((c - b) ** 2).sum()), float(((a - c) ** 2).sum()))
    return -np.inf if inside.any() else float(turn[corner]) / longest


def _turn(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.float64]:
    """Twice the signed areas of triangles (…, 2): positive where a, b, c turn left."""
    one, two = b - a, c - a
    return one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]
