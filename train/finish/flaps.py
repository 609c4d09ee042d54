"""Faces taken off a flattened piece where it lies over itself, and put on to another.

Most pieces that overlap do so by a few faces along a jagged border: a flap.  m faces of a piece.
"""

from __future__ import annotations

from heapq import heapify, heappop, heappush
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.cutgraph import PLAIN, counted_length
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs, overlaps_anywhere
from ...runtime.geometry.topology import edge_table, face_components, split_non_manifold_vertices
from ...runtime.mesh import Surface
from .pieces import measured
from .slits import Flat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.cutgraph import SeamPrices
    from ...runtime.geometry.topology import EdgeTable
    from .config import FlapConfig
    from .pieces import Overlapping, Piece


def flap_faces(uv: NDArray[np.float64], areas: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(m,) bool: faces without which nothing overlaps: one of each pair, that of most pairs, then of least area.

    uv: (m, 3, 2) corners, no face flipped.  areas: (m,).
    """
    over: dict[int, set[int]] = {}
    for one, other in overlapping_pairs(uv).tolist():
        over.setdefault(one, set()).add(other)
        over.setdefault(other, set()).add(one)
    off = np.zeros(len(uv), dtype=bool)
    queue = [(-len(others), float(areas[face]), face) for face, others in over.items()]
    heapify(queue)
    while queue:
        count, _, face = heappop(queue)
        if count != -len(over[face]) or not over[face]:  # an entry from before others of its pairs went
            continue
        off[face] = True
        for other in over.pop(face):
            over[other].discard(face)
            heappush(queue, (-len(over[other]), float(areas[other]), other))
        over[face] = set()
    return off


class Trimmed(NamedTuple):
    """A piece without its flaps.  flaps: faces of each connected one.  rim: length of the cuts that took them off."""

    piece: Piece
    flaps: tuple[NDArray[np.int64], ...]
    rim: float


def trimmed(
    surface: Surface, found: Overlapping, total_area: float, most: float, prices: SeamPrices = PLAIN
) -> Trimmed | None:
    """A flattening less the faces that lie over others; None where they are more than the share ``most`` of its area.

    What loses its hold on the rest with them goes too.
    """
    faces, areas = found.flat.surface.faces, found.flat.surface.face_areas()
    off = flap_faces(found.flat.uv[faces], areas)
    table = edge_table(faces)
    uncut = table.manifold & (off[table.edge_faces[:, 0]] == off[table.edge_faces[:, 1]])
    part = face_components(len(faces), table.edge_faces[uncut])
    kept = np.flatnonzero(part == np.bincount(part, areas).argmax())
    if areas[kept].sum() < (1.0 - most) * areas.sum():
        return None
    off = part != part[kept[0]]
    joined = table.manifold & off[table.edge_faces].all(axis=1)
    flap = face_components(len(faces), table.edge_faces[joined])
    rim = table.manifold & (off[table.edge_faces[:, 0]] != off[table.edge_faces[:, 1]])
    length = counted_length(found.flat.surface.vertices[table.edges[rim]], prices) / float(np.sqrt(total_area))
    piece = measured(surface, found.ids[kept], restricted(found.flat, kept), total_area, found.slits, prices)
    flaps = tuple(found.ids[flap == number] for number in np.unique(flap[off]))
    return Trimmed(piece, flaps, length)


def restricted(flat: Flat, rows: NDArray[np.int64]) -> Flat:
    """A part of a flattening: the faces at ``rows``, where they are."""
    faces, old = split_non_manifold_vertices(flat.surface.faces[rows])
    return Flat(Surface(flat.surface.vertices[old], faces), flat.uv[old], {})


def attached(
    piece: Piece, surface: Surface, table: EdgeTable, flap: NDArray[np.int64], config: FlapConfig
) -> tuple[NDArray[np.int64], Flat] | None:
    """The faces of a piece and a flap, and the flap laid beside the piece, face after face, at their own size.

    At first a flap is joined to all that it touches, its faces between others taking their corners; where that overlaps
    or flips, along one edge alone, up to ``config.edges`` of them, longest first.  Nothing else moves.  None where no
    way is valid.  table: of the surface.
    """
    edges = table.face_edges[flap]
    touching = np.isin(table.edge_faces[edges], piece.ids).any(axis=2)
    ends = surface.vertices[table.edges[edges]]
    length = np.where(touching, np.linalg.norm(ends[..., 1, :] - ends[..., 0, :], axis=-1), 0.0)
    longest = np.argsort(-length, axis=None, kind="stable")[: min(config.edges, int(touching.sum()))].tolist()
    for only in [None, *edges.reshape(-1)[longest].tolist()]:
        layout = _Layout(piece, surface, table, only)
        order = layout.add_all(flap)
        flat = layout.flat()
        if order is not None and is_valid(flat, len(order)) and are_clear(flat.uv, len(piece.flat.uv), config.clear):
            return np.concatenate([piece.ids, np.array(order, dtype=np.int64)]), flat
    return None


def is_valid(flat: Flat, fresh: int) -> bool:
    """True where the last ``fresh`` faces of a flattening are not flipped, and overlap none.

    All faces near them are tested: a flap may lie over the inside of a piece without crossing its border.
    """
    faces = flat.surface.faces
    corners = flat.uv[faces[-fresh:]]
    if flipped_triangles(corners).any():
        return False
    near = np.ones(len(faces), dtype=bool)
    for axis in range(2):  # corner by corner: a reduction over an axis of three takes ten times as long
        a, b, c = (flat.uv[:, axis][faces[:, corner]] for corner in range(3))
        near &= np.maximum(np.maximum(a, b), c) >= corners[:, :, axis].min()
        near &= np.minimum(np.minimum(a, b), c) <= corners[:, :, axis].max()
    return not overlaps_anywhere(flat.uv[faces[near]])


def are_clear(uv: NDArray[np.float64], first: int, clear: float) -> bool:
    """True where no point from row ``first`` on lies upon an earlier one, up to a share ``clear`` of the extent."""
    gap, fresh, before = clear * float(np.ptp(uv, axis=0).max()), uv[first:], uv[:first]
    if len(fresh) == 0:
        return True
    lowest, highest = fresh.min(axis=0) - gap, fresh.max(axis=0) + gap
    near = before[((before >= lowest) & (before <= highest)).all(axis=1)]
    return bool((np.linalg.norm(fresh[:, None] - near[None], axis=2) > gap).all())


class _Layout:
    """Faces of a flap laid beside a piece, one by one: corners of each as rows of points in space and in the plane.

    only: the one edge at which they may touch the piece, or None for all.
    """

    def __init__(self, piece: Piece, surface: Surface, table: EdgeTable, only: int | None) -> None:
        self.piece, self.surface, self.table, self.only = piece, surface, table, only
        self.uv: list[list[float]] = []
        self.faces: list[list[int]] = []
        self.more: list[int] = []
        self.row: dict[int, int] = {}
        """Of each face of the flap that is laid out, and of those of the piece beside it."""

    def add_all(self, flap: NDArray[np.int64]) -> list[int] | None:
        """Lay all faces of a flap out, those with most neighbours first; their order, None where one has none."""
        beside = np.flatnonzero(np.isin(self.piece.ids, self.table.edge_faces[self.table.face_edges[flap]]))
        self.row = dict(zip(self.piece.ids[beside].tolist(), beside.tolist(), strict=True))
        left, order = set(flap.tolist()), []
        while left:
            glued = {face: self.neighbours(face) for face in sorted(left)}
            face = max(glued, key=lambda face: len(glued[face]))
            if not glued[face]:
                return None
            self.add(face, glued[face])
            left.remove(face)
            order.append(face)
        return order

    def corners(self, row: int) -> list[int]:
        """The three points of a face laid out."""
        laid = self.piece.flat.surface.faces
        return laid[row].tolist() if row < len(laid) else self.faces[row - len(laid)]

    def place(self, point: int) -> list[float]:
        """A point in the plane."""
        laid = self.piece.flat.uv
        return laid[point].tolist() if point < len(laid) else self.uv[point - len(laid)]

    def neighbours(self, face: int) -> list[tuple[int, int, int]]:
        """(corner, and the points that this corner and the next one would take) for each edge at a face laid out."""
        found = []
        for corner, edge in enumerate(self.table.face_edges[face].tolist()):
            other = next((other for other in self.table.edge_faces[edge].tolist() if other in self.row), None)
            of_piece = other is not None and self.row[other] < len(self.piece.ids)
            if other is None or (of_piece and self.only not in (None, edge)):
                continue
            a, b = self.surface.faces[face, [corner, (corner + 1) % 3]].tolist()
            ends, mine = self.surface.faces[other].tolist(), self.corners(self.row[other])
            found.append((corner, mine[ends.index(a)], mine[ends.index(b)]))
        return found

    def add(self, face: int, glued: list[tuple[int, int, int]]) -> None:
        """Lay a face out beside those that it is glued to."""
        corners = [-1, -1, -1]
        for corner, first, second in glued:
            corners[corner], corners[(corner + 1) % 3] = first, second
        if -1 in corners:
            free = corners.index(-1)
            corners[free] = len(self.piece.flat.uv) + len(self.uv)
            self.uv.append(self._apex(face, free, corners[(free + 1) % 3], corners[(free + 2) % 3]))
            self.more.append(int(self.surface.faces[face, free]))
        self.row[face] = len(self.piece.ids) + len(self.faces)
        self.faces.append(corners)

    def _apex(self, face: int, free: int, first: int, second: int) -> list[float]:
        """The place of the corner ``free``, left of the way from its next corner to the one after, to scale."""
        apex, a, b = self.surface.vertices[self.surface.faces[face, [free, (free + 1) % 3, (free + 2) % 3]]]
        along = b - a
        length = max(float(along @ along), 1e-300)
        t = float((apex - a) @ along) / length
        height = float(np.linalg.norm(apex - a - t * along)) / np.sqrt(length)
        (ax, ay), (bx, by) = self.place(first), self.place(second)
        dx, dy = bx - ax, by - ay
        return [ax + t * dx - height * dy, ay + t * dy + height * dx]

    def flat(self) -> Flat:
        """The piece with what was laid out."""
        laid = self.piece.flat
        points = np.concatenate([laid.surface.vertices, self.surface.vertices[self.more]])
        faces = np.concatenate([laid.surface.faces, np.array(self.faces, dtype=np.int64).reshape(-1, 3)])
        return Flat(Surface(points, faces), np.concatenate([laid.uv, np.reshape(self.uv, (-1, 2))]), {})
