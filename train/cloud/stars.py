"""Delaunay stars: around each point of a cloud the triangles of the planar Delaunay triangulation of its neighbours.

d points · k neighbours · t triangles.  Neighbours are rolled into the tangent plane, keeping direction and distance
(Gopi, Krishnan and Silva 2000).  There the inversion q ↦ q / |q|² takes the star of the origin to the convex hull of
the images and the origin: the Voronoi cell's polar dual.  Triangles that all three corners see are the surface, but
for a few places where four points lie nearly on a circle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.normals import tangent_frames
from ...runtime.geometry.triangles import triangle_cross
from ...runtime.kernel.choice import kernel
from ...runtime.process.cores import core_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import CloudConfig

_BLOCK = 16384
_TURN = 1e-9
_PACKED = 2_000_000
"""Points of which any three fit one number of 63 bits."""


@dataclass(frozen=True, eq=False)
class Candidates:
    """Triangles that stars propose, each once.

    corners: (t, 3) int64 points, facing as the normals do.  votes: (t,) int64, 1 to 3 corners that see it.
    radius: (t,) float64 circumradius over the largest spacing of its corners.
    """

    corners: NDArray[np.int64]
    votes: NDArray[np.int64]
    radius: NDArray[np.float64]


def star_candidates(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    index: NDArray[np.int64],
    spacing: NDArray[np.float64],
    config: CloudConfig,
) -> Candidates:
    """The triangles of all stars that are small enough and face as their corners do.

    Args:
        points: (d, 3) float64.
        normals: (d, 3) float64 unit, oriented.
        index: (d, k) int64 neighbours, nearest first.
        spacing: (d,) float64 local spacing.
        config: numbers.
    """
    corners, votes = _counted(stars(points, normals, index, config), len(points))
    cross = triangle_cross(points[corners])
    area = np.linalg.norm(cross, axis=1)
    unit = cross / np.maximum(area, np.finfo(np.float64).tiny)[:, None]
    facing = np.einsum("tc,tic->ti", unit, normals[corners])
    backward = facing.sum(axis=1) < 0.0
    corners[backward] = corners[backward][:, [0, 2, 1]]
    facing = np.where(backward[:, None], -facing, facing)
    radius = circumradius(points[corners]) / spacing[corners].max(axis=1)
    good = (area > 0.0) & (facing.min(axis=1) >= config.facing) & (radius <= config.circumradius)
    return Candidates(corners[good], votes[good], radius[good])


def stars(
    points: NDArray[np.float64], normals: NDArray[np.float64], index: NDArray[np.int64], config: CloudConfig
) -> NDArray[np.int64]:
    """(s, 3) the triangles of each point's star among its neighbours (d, k), the point itself first."""
    if compiled := kernel():
        rules = config.star_points, config.opposite, config.steep
        return compiled.stars(points, index, *tangent_frames(normals), normals, *rules, core_count())
    parts = [np.zeros((0, 3), dtype=np.int64)]
    for start in range(0, len(points), _BLOCK):
        rows = np.arange(start, min(start + _BLOCK, len(points)))
        flat = rolled_neighbours(points, normals, rows, index[rows], config)
        centre, first, second = star_pairs(flat, config.star_points)
        parts.append(np.stack([rows[centre], index[rows[centre], first], index[rows[centre], second]], axis=1))
    return np.concatenate(parts)


def _counted(seen: NDArray[np.int64], count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Distinct rows of (s, 3) in [0, count), their order and winding apart, and how often each occurs."""
    ordered = np.sort(seen, axis=1)
    if count <= _PACKED:  # numbers sort several times as fast as rows
        key = np.sort((ordered[:, 0] * count + ordered[:, 1]) * count + ordered[:, 2])
        ordered = np.stack([key // count // count, key // count % count, key % count], axis=1)
    else:
        ordered = ordered[np.lexsort(ordered.T[::-1])]
    fresh = np.flatnonzero(np.append(True, (np.diff(ordered, axis=0) != 0).any(axis=1))[: len(ordered)])
    return ordered[fresh], np.diff(np.append(fresh, len(ordered)))


def circumradius(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(t,) circumradius of triangles (t, 3, 3): product of the edges over four areas; infinite without area."""
    edges = np.roll(triangles, -1, axis=1) - triangles
    doubled = np.linalg.norm(np.cross(edges[:, 0], edges[:, 1]), axis=1)
    product = np.linalg.norm(edges, axis=2).prod(axis=1)
    return np.where(doubled > 0.0, product / np.where(doubled > 0.0, 2.0 * doubled, 1.0), np.inf)


def rolled_neighbours(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    rows: NDArray[np.int64],
    index: NDArray[np.int64],
    config: CloudConfig,
) -> NDArray[np.float64]:
    """Neighbours in the tangent planes of some points, distance and direction kept; NaN for those that don't belong.

    Args:
        points: (d, 3) float64.
        normals: (d, 3) float64 unit.
        rows: (b,) int64 the points whose planes they are.
        index: (b, k) int64 their neighbours.
        config: numbers.

    Returns:
        (b, k, 2) float64.
    """
    normal = normals[rows]
    across, along = tangent_frames(normal)
    way = points[index] - points[rows, None]
    flat = np.stack([np.einsum("bkc,bc->bk", way, axis) for axis in (across, along)], axis=2)
    distance, width = np.linalg.norm(way, axis=2), np.linalg.norm(flat, axis=2)
    same_side = np.einsum("bkc,bc->bk", normals[index], normal) > config.opposite
    belongs = same_side & (width > config.steep * distance) & (distance > 0.0)
    stretch = np.where(belongs, distance / np.where(belongs, width, 1.0), np.nan)
    return flat * stretch[:, :, None]


def star_pairs(flat: NDArray[np.float64], most: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Triangles of the origin's Delaunay star among neighbours in the plane.

    Args:
        flat: (b, k, 2) float64, nearest first; NaN for none.
        most: corners of the hull that are visited.

    Returns:
        (s,) int64 row, and (s,) int64 the two neighbours of each triangle, anticlockwise.
    """
    count, k, _ = flat.shape
    image = np.zeros((count, k + 1, 2))  # the last one is the origin: where the hull passes it, the star is open
    image[:, :k] = flat / np.einsum("bkc,bkc->bk", flat, flat)[:, :, None]
    image[:, :k] /= np.nanmax(np.abs(image[:, :k]), axis=(1, 2), initial=0.0, keepdims=True) + np.finfo(float).tiny
    live = np.flatnonzero(np.isfinite(image[:, :k, 0]).sum(axis=1) >= 2)
    image = image[live]
    length = np.einsum("bkc,bkc->bk", image, image)
    start = np.nanargmax(length, axis=1)
    at, rows = start, np.arange(len(live))
    heading = np.stack([-image[rows, at, 1], image[rows, at, 0]], axis=1)
    found: list[tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]] = []
    for _ in range(most):
        following, heading = _next_on_hull(image[rows], at, heading)
        found.append((live[rows], at, following))
        going = following != start
        rows, at, start, heading = rows[going], following[going], start[going], heading[going]
        if len(rows) == 0:
            break
    centre, first, second = (np.concatenate(column) for column in zip(*found, strict=True))
    inside = (first < k) & (second < k)
    return centre[inside], first[inside], second[inside]


def _next_on_hull(
    image: NDArray[np.float64], at: NDArray[np.int64], heading: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Gift wrapping (Jarvis 1973): the hull vertex (b,) after ``at`` anticlockwise, and the way (b, 2) to it."""
    rows = np.arange(len(image))
    way = image - image[rows, at][:, None]
    cosine = np.einsum("bkc,bc->bk", way, heading)
    sine = heading[:, None, 0] * way[:, :, 1] - heading[:, None, 1] * way[:, :, 0]
    turn = np.arctan2(sine, cosine)
    turn = np.where(turn < -_TURN, turn + 2.0 * np.pi, turn)
    turn[rows, at] = np.inf
    turn[np.isnan(turn)] = np.inf
    following = turn.argmin(axis=1)
    return following, way[rows, following]
