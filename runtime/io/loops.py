"""The polygons of a file over the vertices of an atlas: what formats that hold polygons write.

c corners of all polygons of the file, one polygon after the other · p polygons · f triangles · m loops.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..geometry.triangles import cross_2d, signed_areas
from .polygons import fans

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Asset, Atlas, Polygons

LEAST = 1e-9
"""Share of a polygon that counts as an area: corners on a line have less, by what float32 holds of them."""


@dataclass(frozen=True, eq=False)
class Loops:
    """Polygons as they are written, in the order of the file.

    size: (m,) int64 corners of each.  vertex: atlas vertex of each corner of all.  corner: the corner of the file that
    each is.  polygon: (m,) the file's polygon that each is of.  cut: how many of the file's polygons are written as
    triangles: those that a seam cuts, and those that no fan covers, whichever corner it starts from.  Many readers
    know fans only.
    """

    size: NDArray[np.int64]
    vertex: NDArray[np.int64]
    corner: NDArray[np.int64]
    polygon: NDArray[np.int64]
    cut: int

    @property
    def triangles(self) -> NDArray[np.int64]:
        """(t, 3) int64 atlas vertices: each loop as a fan from its first corner."""
        return self.vertex[fans(self.size)[0]]


def loops_of(atlas: Atlas, asset: Asset) -> Loops:
    """The polygons that the asset's triangles are of; its triangles where its file knows nothing else."""
    count = len(atlas.faces)
    if asset.polygons is None or len(asset.polygons.corner) != count:
        every = np.arange(3 * count)
        return Loops(np.full(count, 3), atlas.faces.reshape(-1), every, np.arange(count), 0)
    return _loops(atlas, asset.polygons)


def first_faces(asset: Asset, loops: Loops) -> NDArray[np.int64]:
    """(m,) the first of the triangles that each loop is of."""
    if asset.polygons is None:
        return loops.polygon
    polygon = asset.polygons.of_faces
    first = np.zeros(len(asset.polygons.size), np.int64)
    first[polygon[::-1]] = np.arange(len(polygon))[::-1]
    return first[loops.polygon]


def _loops(atlas: Atlas, polygons: Polygons) -> Loops:
    """Loops of the faces of an atlas, whose corners are those of polygons."""
    faces, uv = atlas.faces, atlas.uv
    corner, own = polygons.corner, np.full(int(polygons.size.sum()), -1, dtype=np.int64)
    own[corner] = faces
    polygon = polygons.of_faces
    turned = _turned(corner)
    broken = (uv[own[corner]] != uv[faces]).any(axis=(1, 2))
    first = np.zeros(len(polygons.size), dtype=np.int64)
    first[polygon[::-1]] = np.arange(len(faces))[::-1]
    broken |= turned != turned[first[polygon]]
    cut = np.zeros(len(polygons.size), dtype=np.bool_)
    cut[polygon[broken]] = True
    loops = _uncut(faces, own, polygons, turned, cut)
    starts = _fan_starts(atlas, loops)
    if not starts:
        return loops
    cut[[loops.polygon[loop] for loop, start in starts.items() if start < 0]] = True
    turns = {int(loops.polygon[loop]): start for loop, start in starts.items() if start > 0}
    return _turned_to(_uncut(faces, own, polygons, turned, cut), turns)


def _uncut(
    faces: NDArray[np.int64],
    own: NDArray[np.int64],
    polygons: Polygons,
    turned: NDArray[np.bool_],
    cut: NDArray[np.bool_],
) -> Loops:
    """Loops of the polygons that are not cut (p,), triangles of the others.  own: (c,) vertices of the corners."""
    corner, polygon = polygons.corner, polygons.of_faces
    of_corner = np.repeat(np.arange(len(polygons.size)), polygons.size)
    kept = np.flatnonzero((own >= 0) & ~cut[of_corner])
    backward = np.zeros(len(polygons.size), dtype=np.bool_)
    backward[polygon] = turned
    order = kept[np.lexsort((np.where(backward[of_corner[kept]], -kept, kept), of_corner[kept]))]
    whole = np.unique(of_corner[order])
    pieces = np.flatnonzero(cut[polygon])
    size = np.concatenate([np.bincount(of_corner[order])[whole], np.full(len(pieces), 3)])
    number = np.concatenate([whole, polygon[pieces]])
    vertex = np.concatenate([own[order], faces[pieces].reshape(-1)])
    places = np.concatenate([order, corner[pieces].reshape(-1)])
    sort = np.argsort(number, kind="stable")
    start = np.cumsum(size) - size
    spread = np.repeat(start[sort], size[sort]) + _counting(size[sort])
    return Loops(size[sort], vertex[spread], places[spread], number[sort], int(cut.sum()))


def _fan_starts(atlas: Atlas, loops: Loops) -> dict[int, int]:
    """Loop → the corner from which its fan lies right in the plane, for loops whose own fan does not.

    Triangles of no area, where corners lie on a line, are as few as can be.  −1 where each fan turns over somewhere, or
    where what has no area in uv has one in space.
    """
    points, positions = atlas.uv[loops.vertex].astype(np.float64), atlas.positions[loops.vertex]
    corner, owner = fans(loops.size)
    area = signed_areas(points[corner])
    first, found = np.cumsum(loops.size) - loops.size, dict[int, int]()
    facing = np.sign(np.bincount(owner, area, minlength=len(loops.size)))  # uv of others may be mirrored
    for loop in np.unique(owner[(area * facing[owner] <= 0.0) & (facing[owner] != 0.0)]).tolist():
        whole, turn = slice(first[loop], first[loop] + loops.size[loop]), float(facing[loop])
        flat = [_without_area(np.roll(points[whole], -start, axis=0), turn) for start in range(loops.size[loop])]
        best = int(np.argmin(flat))
        rings = [np.roll(rows[whole], -best, axis=0) for rows in (points, positions)]
        found[loop] = -1 if flat[best] == np.inf or (flat[best] > 0.0 and _is_lost(*rings)) else best
    return found


def _is_lost(ring: NDArray[np.float64], places: NDArray[np.float64]) -> bool:
    """Whether a triangle of the fan of a ring (n, 2) has no area, and one in space, where its corners are (n, 3)."""
    spokes, rays = ring[1:] - ring[0], places[1:] - places[0]
    area = np.linalg.norm(np.cross(rays[:-1], rays[1:]), axis=1)
    return bool((area[cross_2d(spokes[:-1], spokes[1:]) == 0.0] > LEAST * area.sum()).any())


def _without_area(ring: NDArray[np.float64], facing: float) -> float:
    """How many triangles of the fan of a ring (n, 2) from its first corner have no area; ∞ where one turns over."""
    spokes = ring[1:] - ring[0]
    area = facing * cross_2d(spokes[:-1], spokes[1:])
    return np.inf if (area < 0.0).any() else float(np.count_nonzero(area == 0.0))


def _turned_to(loops: Loops, starts: dict[int, int]) -> Loops:
    """The loops, those of some polygons beginning at another corner."""
    order, first = np.arange(len(loops.vertex)), np.cumsum(loops.size) - loops.size
    for loop in np.flatnonzero(np.isin(loops.polygon, list(starts))).tolist():
        whole = slice(first[loop], first[loop] + loops.size[loop])
        order[whole] = np.roll(order[whole], -starts[int(loops.polygon[loop])])
    return replace(loops, vertex=loops.vertex[order], corner=loops.corner[order])


def _turned(corner: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(f,) bool: triangles whose corners run against those of their polygon."""
    a, b, c = corner.T
    return ((b - a > 0).astype(np.int8) + (c - b > 0) + (a - c > 0)) == 1


def _counting(size: NDArray[np.int64]) -> NDArray[np.int64]:
    """0 … s − 1 for each size s, one after the other."""
    return np.arange(int(size.sum())) - np.repeat(np.cumsum(size) - size, size)
