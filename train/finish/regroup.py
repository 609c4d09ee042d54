"""Split and merge: chart borders moved to where they pay, under the limit on the number of charts.

Objective: Σ area · excess + price · (seams + slits), areas and lengths as shares of the surface.  A merge saves the
border between two charts; a split costs one and frees what could not be flattened: a limb at its neck.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components, dijkstra

from ..workers import parallel_map
from .fallback import unwrapped_by_xatlas
from .flatten import jacobians, symmetric_dirichlet
from .labels import DualGraph, border_lengths
from .pieces import Piece, make_piece, relieved

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from .relief import Slit


class Weighed(NamedTuple):
    """A merge that was tried: the piece, or None, and the goal it was given."""

    piece: Piece | None
    goal: float


class Regrouping:
    """The search's state: pieces of a surface, and the merges already weighed."""

    def __init__(self, surface: Surface, graph: DualGraph, config: FinishConfig) -> None:
        self.surface, self.graph, self.config = surface, graph, config
        self.areas = surface.face_areas()
        self.area = float(self.areas.sum())
        self.unit = float(np.sqrt(self.area))
        self.centroids = surface.triangles.mean(axis=1)
        self.stubborn: set[int] = set()
        self.pieces: dict[int, Piece] = {}
        self.merges: dict[tuple[int, int], Weighed] = {}
        self._next = 0

    def add(self, piece: Piece) -> int:
        """Take a piece in; its key."""
        self.pieces[self._next] = piece
        self._next += 1
        return self._next - 1

    def add_valid(self, ids: NDArray[np.int64], slits: tuple[Slit, ...] = (), halvings: int = 0) -> None:
        """Faces as one valid piece, with the slits given, or halved until they are valid; at last by xatlas."""
        piece = self.weigh(ids, slits) or (self.weigh(ids) if slits else None)
        if piece is not None:
            self.add(piece)
        elif halvings == self.config.halvings or len(ids) == 1:
            for part in unwrapped_by_xatlas(self.surface, ids, self.area):
                self.add(part)
        else:
            for half in halves(ids, self.graph, self.centroids, self.farthest(ids)):
                self.add_valid(half, halvings=halvings + 1)

    def weigh(self, ids: NDArray[np.int64], slits: tuple[Slit, ...] = (), goal: float = np.inf) -> Piece | None:
        """A flattening of the faces, with no slits but those given; None also where it would cost more than goal."""
        return make_piece(self.surface, ids, self.area, self.config, slits, goal)

    def relieve_all(self, above: float, *, contacts: bool = False) -> None:
        """Slits where they pay, in all pieces of more excess energy than ``above``."""
        keys = [key for key, piece in self.pieces.items() if piece.energy > above]
        found = parallel_map(lambda key: self.relieve(self.pieces[key], contacts=contacts), keys)
        self.pieces.update(zip(keys, found, strict=True))

    def relieve(self, piece: Piece, *, contacts: bool = False) -> Piece:
        """Slit where it pays.  ``contacts``: hold slits apart that would overlap (slow), else leave such slits out."""
        relief = self.config.relief
        if not contacts:
            relief = replace(relief, contact=replace(relief.contact, rounds=0))
        return relieved(piece, self.area, relief)

    def objective(self) -> float:
        """Σ costs + price · borders."""
        price = self.config.relief.price
        return sum(piece.cost(price) for piece in self.pieces.values()) + price * sum(self.borders().values())

    def farthest(self, ids: NDArray[np.int64]) -> int:
        """The face of ids farthest from their mean."""
        points = self.centroids[ids]
        return int(ids[np.linalg.norm(points - points.mean(axis=0), axis=1).argmax()])

    def label(self) -> NDArray[np.int64]:
        """(f,) key of each face's piece."""
        label = np.full(len(self.surface.faces), -1, dtype=np.int64)
        for key, piece in self.pieces.items():
            label[piece.ids] = key
        return label

    def borders(self) -> dict[tuple[int, int], float]:
        """Length (in √A) of the border between each two adjacent pieces, lower key first."""
        keys = sorted(self.pieces)
        index = np.zeros(self._next, dtype=np.int64)
        index[keys] = np.arange(len(keys))
        matrix = border_lengths(index[self.label()], len(keys), self.graph) / self.unit
        adjacent = np.argwhere(np.triu(matrix) > 0.0).tolist()
        return {(keys[i], keys[j]): float(matrix[i, j]) for i, j in adjacent}

    def best_merge(self, excluded: set[int], least: float) -> tuple[float, tuple[int, int], Piece] | None:
        """The adjacent pair whose merge lowers the objective most, by more than ``least`` (negative: raises it less).

        Returns (gain, pair, merged piece), or None.
        """
        price = self.config.relief.price
        borders = self.borders()
        around = {key: sum(length for pair, length in borders.items() if key in pair) for key in self.pieces}
        apart = {
            pair: sum(self.pieces[key].cost(price) for key in pair) + price * length
            for pair, length in borders.items()
            if not excluded & set(pair) and length >= self.config.shared * min(around[key] for key in pair)
        }
        self.weigh_merges({pair: cost - least for pair, cost in apart.items()})
        best = None
        for pair, cost in apart.items():
            merged = self.merges[pair].piece
            if merged is not None and (best is None or cost - merged.cost(price) > best[0]):
                best = cost - merged.cost(price), pair, merged
        return best if best is not None and best[0] > least else None

    def weigh_merges(self, goals: dict[tuple[int, int], float]) -> None:
        """Fill ``merges`` for the pairs, each with the goal under which it is of interest; each pair once."""
        known = self.merges
        new = [p for p in goals if p not in known or (known[p].piece is None and goals[p] > known[p].goal)]
        known.update(zip(new, parallel_map(lambda pair: self.merged(pair, goals[pair]), new), strict=True))

    def merged(self, pair: tuple[int, int], goal: float) -> Weighed:
        """The pair as one piece; no piece where it can't be flattened for less than goal."""
        ids = np.concatenate([self.pieces[key].ids for key in pair])
        smaller = min(self.areas[self.pieces[key].ids].sum() for key in pair) / self.area
        if smaller < self.config.bump:  # a bump on a big piece flattens only once it is slit, and such slits are cheap
            goal = np.inf
        piece = self.weigh(ids, goal=goal)
        if piece is not None and smaller < self.config.bump:
            piece = self.relieve(piece)
        return Weighed(piece, goal)

    def apply_merge(self, pair: tuple[int, int], piece: Piece) -> None:
        """Replace two pieces by one."""
        for key in pair:
            del self.pieces[key]
        self.add(piece if piece.relief else self.relieve(piece))

    def best_split(self, key: int) -> tuple[float, list[Piece]] | None:
        """The best way found to halve a piece: (gain, parts)."""
        piece, price = self.pieces[key], self.config.relief.price
        load = symmetric_dirichlet(jacobians(piece.flat.surface, piece.flat.uv)) * piece.flat.surface.face_areas()
        ways = [
            parts_ids
            for seed in dict.fromkeys((int(piece.ids[load.argmax()]), self.farthest(piece.ids)))
            for parts_ids in necks(piece.ids, self.graph, self.centroids, self.areas, seed, self.config.necks)
        ]
        plain = iter(parallel_map(self.weigh, [ids for parts_ids in ways for ids in parts_ids]))
        flat = [(parts_ids, [next(plain) for _ in parts_ids]) for parts_ids in ways]
        valid = [(ids, [part for part in parts if part is not None]) for ids, parts in flat if None not in parts]
        relieved_parts = iter(parallel_map(self.relieve, [part for _, parts in valid for part in parts]))
        best = None
        for parts_ids, parts in valid:
            whole = [next(relieved_parts) for _ in parts]
            cut = neck_length(parts_ids[0], parts_ids[1:], self.graph, len(self.surface.faces)) / self.unit
            gain = piece.cost(price) - sum(part.cost(price) for part in whole) - price * cut
            if best is None or gain > best[0]:
                best = gain, whole
        return best

    def search(self, most: int) -> None:
        """Merge down to ``most`` pieces, then split and merge while that pays."""
        while len(self.pieces) > most:
            found = self.best_merge(set(), -0.02) or self.best_merge(set(), -np.inf)
            if found is None:
                break
            self.apply_merge(found[1], found[2])
        for _ in range(self.config.rounds):
            if len(self.stubborn) >= self.config.stubborn:
                break
            worst = max(
                (key for key in self.pieces if key not in self.stubborn),
                key=lambda key: self.pieces[key].cost(self.config.relief.price),
                default=None,
            )
            if worst is None or not self.improve(worst, most):
                break

    def improve(self, key: int, most: int) -> bool:
        """Split one piece, and merge two others where the limit asks for it; False when nothing is left to gain."""
        if self.pieces[key].cost(self.config.relief.price) < self.config.relief.price * self.config.relief.shortest:
            return False
        split = self.best_split(key)
        if split is not None and split[0] > 0.0:
            room = len(self.pieces) + len(split[1]) - 1 <= most
            merge = None if room else self.best_merge({key}, -split[0])
            if room or merge is not None:
                del self.pieces[key]
                for part in split[1]:
                    self.add(part)
                if merge is not None:
                    self.apply_merge(merge[1], merge[2])
                return True
        self.stubborn.add(key)
        return True


def halves(
    ids: NDArray[np.int64], graph: DualGraph, centroids: NDArray[np.float64], seed: int
) -> list[NDArray[np.int64]]:
    """The faces cut in two at half their distance from a seed face, as connected parts."""
    distance = dual_distance(ids, graph, centroids, seed)
    near = distance < np.median(distance)  # the seed alone at least, and never the farthest
    return connected_parts(ids, near, graph)


def necks(
    ids: NDArray[np.int64],
    graph: DualGraph,
    centroids: NDArray[np.float64],
    areas: NDArray[np.float64],
    seed: int,
    tries: int,
) -> list[list[NDArray[np.int64]]]:
    """The shortest borders between the faces near a seed and the rest: isolines of distance, by length / √smaller area.

    Where an isoline leaves more than two parts, one of the largest is taken off and the others stay together.
    Returns up to ``tries`` splittings into two connected parts.
    """
    distance = dual_distance(ids, graph, centroids, seed)
    levels = np.quantile(distance, np.linspace(0.08, 0.92, 22))
    i, j, length = inner_pairs(ids, graph, len(centroids))
    crossing = np.stack([np.where((distance[i] <= t) != (distance[j] <= t), length, 0.0).sum() for t in levels])
    share = np.stack([areas[ids][distance <= t].sum() for t in levels]) / areas[ids].sum()
    quality = crossing / np.sqrt(np.maximum(np.minimum(share, 1.0 - share), 1e-9))
    minima = [n for n in range(len(levels)) if quality[n] <= quality[max(n - 2, 0) : n + 3].min()]
    found = []
    for n in sorted(minima, key=lambda n: quality[n])[:tries]:
        parts = sorted(connected_parts(ids, distance <= levels[n], graph), key=lambda part: -areas[part].sum())
        for apart in parts[: min(len(parts) - 1, 2)]:
            rest = np.setdiff1d(ids, apart)
            if len(connected_parts(rest, np.zeros(len(rest), dtype=bool), graph)) == 1:
                found.append([apart, rest])
    return found[:tries]


def inner_pairs(
    ids: NDArray[np.int64], graph: DualGraph, count: int
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Dual edges inside a set of faces, as positions in ids, and their lengths."""
    position = np.full(count, -1, dtype=np.int64)
    position[ids] = np.arange(len(ids))
    i, j = position[graph.pairs].T
    inside = (i >= 0) & (j >= 0)
    return i[inside], j[inside], graph.length[inside]


def dual_distance(
    ids: NDArray[np.int64], graph: DualGraph, centroids: NDArray[np.float64], seed: int
) -> NDArray[np.float64]:
    """(m,) distance of each face from the seed face, from centroid to centroid inside the piece."""
    i, j, _ = inner_pairs(ids, graph, len(centroids))
    step = np.linalg.norm(centroids[ids[i]] - centroids[ids[j]], axis=1) + 1e-12
    links = sparse.csr_array((step, (i, j)), shape=(len(ids), len(ids)))
    return dijkstra(links, directed=False, indices=int(np.flatnonzero(ids == seed)[0]))


def connected_parts(ids: NDArray[np.int64], near: NDArray[np.bool_], graph: DualGraph) -> list[NDArray[np.int64]]:
    """The connected parts of ids when the dual edges between near and far are cut."""
    i, j, _ = inner_pairs(ids, graph, int(max(graph.pairs.max(), ids.max())) + 1)
    same = near[i] == near[j]
    links = sparse.coo_array((np.ones(same.sum()), (i[same], j[same])), shape=(len(ids), len(ids)))
    count, part = connected_components(links, directed=False)
    return [ids[part == number] for number in range(count)]


def neck_length(first: NDArray[np.int64], others: list[NDArray[np.int64]], graph: DualGraph, count: int) -> float:
    """Length of the border between one part and the others."""
    side = np.zeros(count, dtype=np.int8)
    side[first] = 1
    for part in others:
        side[part] = 2
    i, j = side[graph.pairs].T
    return float(graph.length[(i != j) & (i > 0) & (j > 0)].sum())
