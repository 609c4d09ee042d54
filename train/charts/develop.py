"""Unfolding without stretch: flat regions are hinged together along shared edges while nothing overlaps.

A *development* is a set of faces with the uv of each corner, isometric to the surface.  Two developments join along an
edge they share: one is turned and moved until the edge coincides; every further shared edge that then coincides too is
joined with it.  So a box becomes a cross, the side of a cylinder a rectangle, that of a cone a sector.
f faces · uv in the units of the surface.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from heapq import heapify, heappop, heappush
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull

from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.rows import grouped
from ...runtime.geometry.triangles import signed_areas
from ...runtime.kernel.choice import kernel
from .planar import laid_flat

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from ...runtime.geometry.topology import EdgeTable
    from ...runtime.mesh import Surface
    from ..config import PlanarConfig


@dataclass(frozen=True, eq=False)
class Development:
    """Faces laid flat.  ids (m,) int64, ascending; uv (m, 3, 2); perimeter: of its border, joined edges left out."""

    ids: NDArray[np.int64]
    uv: NDArray[np.float64]
    perimeter: float

    @cached_property
    def box(self) -> NDArray[np.float64]:
        """(2,) sides of its least rectangle, the longer first."""
        return np.sort(least_rectangle(self.uv))[::-1]

    @cached_property
    def fill(self) -> float:
        """Share of that rectangle that it covers."""
        return float(np.abs(signed_areas(self.uv)).sum() / max(float(self.box.prod()), 1e-300))

    @property
    def aspect(self) -> float:
        """Long side over short side of that rectangle."""
        return float(self.box[0] / max(float(self.box[1]), 1e-300))


class Hinge(NamedTuple):
    """How a second development joins a first: turn (2, 2), shift (2,) of its uv; the edges (h,) that then coincide."""

    turn: NDArray[np.float64]
    shift: NDArray[np.float64]
    edges: NDArray[np.int64]
    length: float


class Unfolding:
    """Developments of one surface on their way to be joined, and which of its edges are joined already.

    side: of the page that they share with other surfaces, √(area of all) in this one's units.
    """

    def __init__(
        self, surface: Surface, table: EdgeTable, region: NDArray[np.int64], config: PlanarConfig, side: float = 0.0
    ) -> None:
        self.surface, self.table, self.config = surface, table, config
        ends = surface.vertices[table.edges]
        self.length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        self.side = max(side, float(np.sqrt(surface.face_areas().sum())))
        self.tolerance = config.meeting * float(np.ptp(surface.vertices, axis=0).max())
        self.owner = region.copy()
        uv = laid_flat(surface, region)
        self.members = {
            number: Development(ids, uv[ids], self._border(ids)) for number, ids in enumerate(grouped(region))
        }
        self._next = len(self.members)

    def _border(self, ids: NDArray[np.int64]) -> float:
        """The length of the border of one flat region."""
        edges, count = np.unique(self.table.face_edges[ids], return_counts=True)
        return float(self.length[edges[count == 1]].sum())

    def shared_edges(self) -> dict[tuple[int, int], NDArray[np.int64]]:
        """Manifold edges between two developments, by the pair of them, lower first."""
        candidates = np.flatnonzero(self.table.manifold)
        pair = np.sort(self.owner[self.table.edge_faces[candidates]], axis=1)
        apart = pair[:, 0] != pair[:, 1]
        candidates, pair = candidates[apart], pair[apart]
        order = np.lexsort((candidates, pair[:, 1], pair[:, 0]))
        candidates, pair = candidates[order], pair[order]
        first = np.ones(len(pair), dtype=bool)
        first[1:] = (pair[1:] != pair[:-1]).any(axis=1)
        groups = np.split(candidates, np.flatnonzero(first)[1:]) if len(pair) else []
        return {(a, b): edges for (a, b), edges in zip(pair[first].tolist(), groups, strict=True)}

    def corner_uv(self, member: int, edges: NDArray[np.int64]) -> NDArray[np.float64]:
        """(h, 2, 2) uv of the ends (lower vertex first) of edges on the border of a development."""
        faces = self.table.edge_faces[edges]
        face = np.where(self.owner[faces[:, 0]] == member, faces[:, 0], faces[:, 1])
        row = np.searchsorted(self.members[member].ids, face)
        vertex, uv = self.surface.faces[face], self.members[member].uv[row]
        at = np.arange(len(edges))
        return np.stack(
            [uv[at, (vertex == self.table.edges[edges, end, None]).argmax(axis=1)] for end in (0, 1)], axis=1
        )

    def hinges(self, first: int, second: int, edges: NDArray[np.int64]) -> Iterator[Hinge]:
        """The ways the second development can join the first along shared edges, each way once."""
        fixed, moving = self.corner_uv(first, edges), self.corner_uv(second, edges)
        left = np.ones(len(edges), dtype=bool)
        longest = max(float(self.length[edges].max()), 1e-300)
        for at in np.argsort(-np.round(self.length[edges] / longest, self.config.digits), kind="stable").tolist():
            if not left[at]:
                continue
            turn, shift = rigid_motion(moving[at], fixed[at])
            gap = np.linalg.norm(moving @ turn.T + shift - fixed, axis=2).max(axis=1)
            meeting = gap <= self.tolerance
            left &= ~meeting
            left[at] = False
            joined = edges[meeting]
            yield Hinge(turn, shift, joined, float(self.length[joined].sum()))

    def shorter_border(self, first: int, second: int) -> float:
        """The perimeter of the one that has less of it."""
        return max(min(self.members[first].perimeter, self.members[second].perimeter), 1e-300)

    def best_hinge(self, first: int, second: int, edges: NDArray[np.int64]) -> tuple[float, Hinge]:
        """The way that joins the greatest share of the shorter border: (share, hinge)."""
        shorter = self.shorter_border(first, second)
        hinge = max(
            self.hinges(first, second, edges), key=lambda hinge: round(hinge.length / shorter, self.config.digits)
        )
        return hinge.length / shorter, hinge

    def rolls_on(self, first: int, second: int, hinge: Hinge) -> bool:
        """Whether two strips meet end to end, as those of a coin's rim or of a gear's teeth do."""
        return hinge.length >= self.config.whole_end * max(self.members[each].box[1] for each in (first, second))

    def joined(self, first: int, second: int, hinge: Hinge) -> Development | None:
        """Both as one development; None where it would overlap itself or sprawl."""
        a, b = self.members[first], self.members[second]
        uv = self._welded(a, b, hinge)
        ids, both = np.concatenate([a.ids, b.ids]), np.concatenate([a.uv, uv])
        order = np.argsort(ids)
        whole = Development(ids[order], both[order], a.perimeter + b.perimeter - 2.0 * hinge.length)
        if flipped_triangles(uv).any() or not self._is_compact(a, b, whole, hinge) or self._overlap(a.uv, uv):
            return None
        return whole

    def _is_compact(self, a: Development, b: Development, whole: Development, hinge: Hinge) -> bool:
        """Whether the two joined pack well: no sprawl, no long strip unless joined along long sides."""
        longest = max(self.config.aspect, a.aspect, b.aspect) * (1.0 + 1e-9)
        along = hinge.length >= self.config.long_side * min(a.perimeter, b.perimeter)
        short = float(whole.box[0]) <= self.config.span * self.side
        least = min(self.config.fill, a.fill * 0.999, b.fill * 0.999)  # slender triangles fill half of theirs
        return whole.fill >= least and (along or short or whole.aspect <= longest)

    def _welded(self, a: Development, b: Development, hinge: Hinge) -> NDArray[np.float64]:
        """The moved uv of b with the ends of joined edges exactly where the first development has them."""
        ids, moved = b.ids, b.uv @ hinge.turn.T + hinge.shift
        uv = moved.copy()
        for edge in hinge.edges.tolist():
            face = self.table.edge_faces[edge]
            row = np.searchsorted(a.ids, face)
            inside = (row < len(a.ids)) & (a.ids[np.minimum(row, len(a.ids) - 1)] == face)
            kept, other = face[inside][0], face[~inside][0]
            for vertex in self.table.edges[edge].tolist():
                place = a.uv[np.searchsorted(a.ids, kept), np.flatnonzero(self.surface.faces[kept] == vertex)[0]]
                corner = np.flatnonzero(self.surface.faces[other] == vertex)[0]
                before = moved[np.searchsorted(ids, other), corner]
                same = (self.surface.faces[ids] == vertex) & (np.abs(moved - before).max(axis=2) <= self.tolerance)
                uv[same] = place
        return uv

    def _overlap(self, fixed: NDArray[np.float64], moved: NDArray[np.float64]) -> bool:
        """True where a moved triangle overlaps a fixed one; only those within the other's bounding box can."""
        low = np.maximum(fixed.min(axis=(0, 1)), moved.min(axis=(0, 1)))
        high = np.minimum(fixed.max(axis=(0, 1)), moved.max(axis=(0, 1)))
        near = [uv[((uv.max(axis=1) > low) & (uv.min(axis=1) < high)).all(axis=1)] for uv in (fixed, moved)]
        return len(overlapping_pairs(np.concatenate(near))) > 0 if all(len(part) for part in near) else False

    def replace(self, first: int, second: int, whole: Development) -> int:
        """Two developments become one, under a new number."""
        del self.members[first], self.members[second]
        self.members[self._next] = whole
        self.owner[whole.ids] = self._next
        self._next += 1
        return self._next - 1


def unfold(
    surface: Surface, table: EdgeTable, region: NDArray[np.int64], config: PlanarConfig, side: float = 0.0
) -> list[Development]:
    """Flat regions (f,) joined into developments, the pair that shares most of its border first.

    Two join where the shared edges are at least ``config.shared`` of the shorter border, or are the ends of two strips.
    side: of the page, where other surfaces lie on it too.
    """
    if (compiled := kernel()) and (found := unfold_compiled(compiled.unfold, surface, table, region, config, side)):
        return found
    state = Unfolding(surface, table, region, config, side)
    around: dict[int, dict[int, NDArray[np.int64]]] = {number: {} for number in state.members}
    for (a, b), edges in state.shared_edges().items():
        around[a][b] = around[b][a] = edges
    queue = [entry for a, beside in around.items() for b in beside if a < b and (entry := hoped(state, a, b, around))]
    heapify(queue)
    ways = dict[tuple[int, int], Hinge]()
    while queue:
        _, first, second, is_exact = heappop(queue)
        if first not in state.members or second not in state.members:
            continue
        if not is_exact:
            share, ways[first, second] = state.best_hinge(first, second, around[first][second])
            if share >= config.shared or state.rolls_on(first, second, ways[first, second]):
                heappush(queue, (-round(share, config.digits), first, second, True))
            continue
        joined = state.joined(first, second, ways.pop((first, second)))
        if joined is None:
            continue
        number = state.replace(first, second, joined)
        around[number] = combined(around, first, second, number)
        for other in around[number]:
            if entry := hoped(state, other, number, around):
                heappush(queue, entry)
    return sorted(state.members.values(), key=lambda found: int(found.ids[0]))


def unfold_compiled(
    compiled: Callable[..., tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]] | None],
    surface: Surface,
    table: EdgeTable,
    region: NDArray[np.int64],
    config: PlanarConfig,
    side: float,
) -> list[Development] | None:
    """The same by the kernel; None where its numbers can't hold the uv."""
    ends = surface.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    span = config.span * max(side, float(np.sqrt(surface.face_areas().sum())))
    tolerance = config.meeting * float(np.ptp(surface.vertices, axis=0).max())
    shares = config.whole_end, config.long_side, config.fill, 10.0**config.digits
    limits = np.array([config.shared, config.aspect, span, *shares, tolerance])
    found = compiled(surface.faces, region, laid_flat(surface, region), length, limits)
    if found is None:
        return None
    label, uv, perimeter = found
    uv = uv.reshape(-1, 3, 2)
    rows = grouped(label)
    return [Development(ids, uv[ids], around) for ids, around in zip(rows, perimeter.tolist(), strict=True)]


def hoped(
    state: Unfolding, first: int, second: int, around: dict[int, dict[int, NDArray[np.int64]]]
) -> tuple[float, int, int, bool] | None:
    """(−share of the shorter border, pair, False) if all edges between the two could be joined; None if too little.

    The share itself is found once that is the greatest hope: most pairs end before, as one of the two joins another.
    """
    edges = around[first][second]
    most = float(state.length[edges].sum()) * (1.0 + 1e-9)
    share = most / state.shorter_border(first, second)
    ends = state.config.whole_end * max(state.members[each].box[1] for each in (first, second))
    enough = share >= state.config.shared or most >= ends
    return (-round(share, state.config.digits), first, second, False) if enough else None


def combined(
    around: dict[int, dict[int, NDArray[np.int64]]], first: int, second: int, number: int
) -> dict[int, NDArray[np.int64]]:
    """The shared edges of two developments that became one, by neighbour; the neighbours are told its number."""
    beside: dict[int, NDArray[np.int64]] = {}
    for old in (first, second):
        for other, edges in around.pop(old).items():
            if other in (first, second):
                continue
            beside[other] = np.sort(np.concatenate([beside[other], edges])) if other in beside else edges
            del around[other][old]
    for other, edges in beside.items():
        around[other][number] = edges
    return beside


def rigid_motion(
    moving: NDArray[np.float64], fixed: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The turn (2, 2) and shift (2,) that bring one segment (2, 2) onto another: midpoint on midpoint."""
    a, b = moving[1] - moving[0], fixed[1] - fixed[0]
    cosine, sine = a @ b, a[0] * b[1] - a[1] * b[0]
    size = max(float(np.hypot(cosine, sine)), 1e-300)
    turn = np.array([[cosine, -sine], [sine, cosine]]) / size
    return turn, fixed.mean(axis=0) - turn @ moving.mean(axis=0)


def least_rectangle(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2,) sides of the rectangle of least area around triangles (m, 3, 2); it lies along a side of their hull."""
    points = uv.reshape(-1, 2)
    hull = points[ConvexHull(points).vertices]
    sides = np.stack([b - a for a, b in pairwise([*hull, hull[0]])])
    angle = np.arctan2(sides[:, 1], sides[:, 0])
    turn = np.stack([np.stack([np.cos(angle), np.sin(angle)], 1), np.stack([-np.sin(angle), np.cos(angle)], 1)], 1)
    boxes = np.ptp(np.einsum("sij,nj->sni", turn, hull), axis=1)
    return boxes[boxes.prod(axis=1).argmin()]
