"""Polygons that seams run through, made whole: a triangle goes to the other side of the seam, along with its uv.

Charts are made of triangles, so a seam may follow the diagonal by which a quad became two.  Here one of the two is laid
against the other, where there is room: where its third corner is next to faces that lie there already it takes their
uv, else it is unfolded without stretch.   f faces.   A polygon for which there is no room stays cut.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ..runtime.geometry.topology import edge_table
from .charts.recut import renumbered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Charts, Polygons, Surface

THIN = 0.2
"""Least area of a triangle that takes its neighbours' uv, of the one it has on the surface …"""
LARGE = 5.0
"""… and the most."""
ROUNDS = 3
"""How often what could not be moved is tried again, when others have been."""


def whole_polygons(surface: Surface, charts: Charts, polygons: Polygons) -> Charts:
    """The charts with as many polygons whole as there is room for; the very charts where none is cut.

    surface: f faces, those of the polygons.
    """
    if polygons.large == 0:
        return charts
    work = _Work(surface, charts.face_chart.copy(), charts.corner_uv.copy(), _neighbours(surface.faces))
    inner = _inner_edges(surface.faces, polygons.of_faces)
    if not len(cut := _cut(work, inner)):
        return charts
    for _ in range(ROUNDS):
        moved = [_moved(work, face, other) or _moved(work, other, face) for face, other in cut.tolist()]
        cut = _cut(work, inner)
        if not any(moved) or not len(cut):
            break
    found = replace(charts, face_chart=work.chart, corner_uv=work.uv)
    number = renumbered(surface, found, work.uv, np.zeros(len(work.chart), dtype=bool))
    first = np.unique(number, return_index=True)[1]
    method = tuple(charts.method[work.chart[face]] for face in first.tolist())
    return replace(found, face_chart=number, face_patch=number, patch_chart=np.arange(len(method)), method=method)


@dataclass(frozen=True, eq=False)
class _Work:
    """Charts while they change: chart (f,), uv (f, 3, 2).

    beside: (f, 3) int64, the face across the edge from each corner to the next; −1 where there is none.
    """

    surface: Surface
    chart: NDArray[np.int64]
    uv: NDArray[np.float64]
    beside: NDArray[np.int64]

    def uv_at(self, face: int, vertex: int) -> NDArray[np.float64]:
        """(2,) uv of a vertex in one of its faces."""
        return self.uv[face, int(np.argmax(self.surface.faces[face] == vertex))]


def _neighbours(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(f, 3) int64: the face across the edge of corner i and the next, −1 at borders and where several meet."""
    table = edge_table(faces)
    half = table.edge_halfedges[table.manifold]
    beside = np.full(faces.size, -1, dtype=np.int64)
    beside[half[:, 0]], beside[half[:, 1]] = half[:, 1] // 3, half[:, 0] // 3
    return beside.reshape(-1, 3)


def _inner_edges(faces: NDArray[np.int64], polygon: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m, 2) int64 half-edges 3 face + corner of each diagonal, which run against each other."""
    table = edge_table(faces)
    half = table.edge_halfedges[table.manifold]
    return half[polygon[half[:, 0] // 3] == polygon[half[:, 1] // 3]]


def _cut(work: _Work, inner: NDArray[np.int64]) -> NDArray[np.int64]:
    """(c, 2) int64 the faces on both sides of those diagonals (m, 2) that are seams."""
    face, corner = inner // 3, inner % 3
    start, end = work.uv[face, corner], work.uv[face, (corner + 1) % 3]
    joined = work.chart[face[:, 0]] == work.chart[face[:, 1]]
    joined &= (start[:, 0] == end[:, 1]).all(axis=1) & (end[:, 0] == start[:, 1]).all(axis=1)
    return face[~joined]


def _moved(work: _Work, face: int, other: int) -> bool:
    """Lay a face against another across the edge they share, where there is room; whether it was done."""
    corners = work.surface.faces[face]
    apex = int(np.flatnonzero(~np.isin(corners, work.surface.faces[other]))[0])
    shared = [int(corners[(apex + step) % 3]) for step in (1, 2)]
    start, end = (work.uv_at(other, vertex) for vertex in shared)
    laid = np.zeros((3, 2))
    laid[(apex + 1) % 3], laid[(apex + 2) % 3] = start, end
    for place in (*_known(work, face, other, apex), _unfolded(work, face, apex, start, end)):
        laid[apex] = place
        if _fits(work, face, other, laid):
            work.uv[face], work.chart[face] = laid, work.chart[other]
            return True
    return False


def _known(work: _Work, face: int, other: int, apex: int) -> list[NDArray[np.float64]]:
    """Where faces beyond the two other edges, joined to the other face's side, have the third corner already."""
    corners, found = work.surface.faces[face], []
    for edge, vertex in ((apex, corners[(apex + 1) % 3]), ((apex + 2) % 3, corners[(apex + 2) % 3])):
        beyond = int(work.beside[face, edge])
        if beyond >= 0 and work.chart[beyond] == work.chart[other]:
            same = (work.uv_at(beyond, int(vertex)) == work.uv_at(other, int(vertex))).all()
            found += [work.uv_at(beyond, int(corners[apex]))] if same else []
    return found


def _unfolded(
    work: _Work, face: int, apex: int, start: NDArray[np.float64], end: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(2,) the third corner without stretch, left of the edge from start to end, which is as long as its uv say."""
    top, first, second = work.surface.vertices[work.surface.faces[face, [apex, (apex + 1) % 3, (apex + 2) % 3]]]
    along, side = second - first, top - first
    square = max(float(along @ along), np.finfo(np.float64).tiny)
    share = float(side @ along) / square
    height = float(np.linalg.norm(np.cross(along, side))) / square
    flat = end - start
    return start + share * flat + height * np.array([-flat[1], flat[0]])


def _fits(work: _Work, face: int, other: int, laid: NDArray[np.float64]) -> bool:
    """Whether a triangle (3, 2) stands upright, is not squeezed, and overlaps no other face of the chart."""
    one, two = laid[1] - laid[0], laid[2] - laid[0]
    area = float(one[0] * two[1] - one[1] * two[0]) / 2.0
    real = _area(work.surface.vertices[work.surface.faces[face]])
    if flipped_triangles(laid[None])[0] or not THIN * real <= area <= LARGE * real:
        return False
    near = np.flatnonzero(work.chart == work.chart[other])
    near = near[near != face]
    low, high = work.uv[near].min(axis=1), work.uv[near].max(axis=1)
    near = near[((low <= laid.max(axis=0)) & (high >= laid.min(axis=0))).all(axis=1)]
    pairs = overlapping_pairs(np.concatenate([laid[None], work.uv[near]]))
    return not (pairs == 0).any()


def _area(triangle: NDArray[np.float64]) -> float:
    return float(np.linalg.norm(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]))) / 2.0
