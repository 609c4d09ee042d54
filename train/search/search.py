"""Split and merge: chart borders moved to where they pay, under the limit on the number of charts.

Objective: Σ area · excess + price · (seams + slits), on a part of area 1.  A merge saves the border between two charts;
a split costs one and frees what could not be flattened: a limb at its neck.  Merges are ranked by the energy that
curvature foretells, and only the best are flattened.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ...runtime.geometry.distortion import oriented_energy
from ...runtime.geometry.topology import edge_table
from ..finish.curvature import Curvature, foretold_energies
from ..finish.fallback import unwrapped_by_xatlas
from ..finish.flatten import jacobians
from ..finish.pieces import Overlapping, Piece, polished, slit_further, try_piece
from ..workers import parallel_map
from .cuts import Links, cut_between, halves, necks, overlap_sides
from .labels import DualGraph, border_lengths

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.pieces import Start
    from ..finish.slits import Slit

Pair = tuple[int, int]


class Merge(NamedTuple):
    """A merge that lowers the objective by ``gain`` (negative: raises it)."""

    gain: float
    pair: Pair
    piece: Piece


class Search:
    """The search's state: valid pieces of a part, and the merges already tried."""

    def __init__(self, surface: Surface, graph: DualGraph, config: FinishConfig) -> None:
        self.surface, self.graph, self.config = surface, graph, config
        self.price = config.slit.price
        self.areas = surface.face_areas()
        self.area = float(self.areas.sum())
        self.unit = float(np.sqrt(self.area))
        self.centroids = surface.triangles.mean(axis=1)
        self.curvature = Curvature.of(surface, config.slit.contact.cotangents)
        self.table = edge_table(surface.faces)
        self.pieces: dict[int, Piece] = {}
        self.tried: dict[Pair, Piece | None] = {}
        self.foretold: dict[Pair, float] = {}
        self.chains: dict[Pair, float] = {}
        self.settled: set[int] = set()
        self._next = 0

    def add(self, piece: Piece) -> int:
        """Take a piece in; its key."""
        self.pieces[self._next] = piece
        self._next += 1
        return self._next - 1

    def links(self, ids: NDArray[np.int64]) -> Links:
        """The dual edges among faces."""
        return Links(ids, self.graph, len(self.surface.faces))

    def try_piece(
        self, ids: NDArray[np.int64], slits: tuple[Slit, ...] = (), start: Start | None = None
    ) -> Piece | Overlapping | None:
        """A flattening of the faces, with slits and from a start that were found elsewhere."""
        return try_piece(self.surface, ids, self.area, self.config, slits, start=start)

    def add_valid(self, ids: NDArray[np.int64], slits: tuple[Slit, ...] = (), depth: int = 0) -> None:
        """Faces as one valid piece, or cut until they are valid; at last by xatlas."""
        found = self.try_piece(ids, slits)
        last = depth == self.config.halvings or len(ids) == 1
        if isinstance(found, Piece) and (last or self.is_bearable(found)):
            self.add(found)
        elif isinstance(found, Piece):
            split = self.best_split(found)
            for part in split[1] if split is not None else []:
                self.add(part)
            if split is None:
                self.add(found)
        elif slits:
            self.add_valid(ids, (), depth)
        elif last:
            for part in unwrapped_by_xatlas(self.surface, ids, self.area):
                self.add(part)
        else:
            for part in self.cut(ids, found):
                self.add_valid(part, (), depth + 1)

    def is_bearable(self, piece: Piece) -> bool:
        """True where the mean excess of a piece is one that a search can start from."""
        return piece.energy * self.area <= self.config.bearable * float(self.areas[piece.ids].sum())

    def cut(self, ids: NDArray[np.int64], found: Overlapping | None) -> list[NDArray[np.int64]]:
        """Faces that can't be one piece, cut between what overlaps, or half way."""
        links = self.links(ids)
        pairs = found.pairs() if found is not None else np.zeros((0, 2), dtype=np.int64)
        if found is not None and len(pairs):
            sides = overlap_sides(found.faces, pairs)
            return links.parts(cut_between(links, self.centroids, self.areas, sides, self.config.split.levels))
        return halves(links, self.centroids)

    def label(self) -> NDArray[np.int64]:
        """(f,) key of each face's piece."""
        label = np.full(len(self.surface.faces), -1, dtype=np.int64)
        for key, piece in self.pieces.items():
            label[piece.ids] = key
        return label

    def borders(self) -> dict[Pair, float]:
        """Length (in √A) of the border between each two adjacent pieces, lower key first."""
        keys = sorted(self.pieces)
        index = np.zeros(self._next, dtype=np.int64)
        index[keys] = np.arange(len(keys))
        matrix = border_lengths(index[self.label()], len(keys), self.graph) / self.unit
        adjacent = np.argwhere(np.triu(matrix) > 0.0).tolist()
        return {(keys[i], keys[j]): float(matrix[i, j]) for i, j in adjacent}

    def energy(self) -> float:
        """Σ area · excess, over the area of the part."""
        return sum(piece.energy for piece in self.pieces.values())

    def objective(self) -> float:
        """Σ costs + price · borders."""
        return sum(piece.cost(self.price) for piece in self.pieces.values()) + self.price * sum(self.borders().values())

    def foretell(self, pair: Pair) -> float:
        """Cost of two pieces as one, by curvature: no more slits than both have."""
        if pair not in self.foretold:
            first, second = (self.pieces[key] for key in pair)
            ids = np.concatenate([first.ids, second.ids])
            rim = self.outer_vertices(ids)
            for piece in (first, second):
                slit = piece.rim(self.surface)
                rim[slit[~self.outer_vertices(piece.ids)[slit]]] = True
            energy = foretold_energies(self.surface.faces[ids], self.areas[ids], self.curvature.factor(rim)).sum()
            self.foretold[pair] = float(energy) / self.area * self.config.foretold + self.price * (
                first.slit_length + second.slit_length
            )
        return self.foretold[pair]

    def outer_vertices(self, ids: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(v,) bool: not all faces around the vertex are among ids."""
        inside = np.bincount(self.surface.faces[ids].reshape(-1), minlength=len(self.surface.vertices))
        return inside < self.curvature.fan

    def longest_chain(self, pair: Pair) -> float:
        """Length (in √A) of the longest connected run of edges that two pieces share: what a merge is sure to save.

        Joined along a second run too, they would be a tube or a handle, which has to be cut open again.
        """
        if pair not in self.chains:
            first, second = (self.table.face_edges[self.pieces[key].ids].reshape(-1) for key in pair)
            shared = np.intersect1d(first, second)
            shared = shared[self.table.manifold[shared]]
            ends = self.table.edges[shared]
            used, index = np.unique(ends, return_inverse=True)
            i, j = index.reshape(-1, 2).T
            links = sparse.coo_array((np.ones(len(i)), (i, j)), shape=(len(used), len(used)))
            run = connected_components(links, directed=False)[1][i]
            points = self.surface.vertices[ends]
            length = np.linalg.norm(points[:, 1] - points[:, 0], axis=1)
            self.chains[pair] = float(np.bincount(run, length).max(initial=0.0)) / self.unit
        return self.chains[pair]

    def candidates(self, excluded: set[int]) -> list[tuple[float, Pair, float]]:
        """Merges worth a look: (gain foretold, pair, cost of the two apart), best first."""
        borders = self.borders()
        around = {key: sum(length for pair, length in borders.items() if key in pair) for key in self.pieces}
        found = []
        for pair, length in borders.items():
            small = min(float(self.areas[self.pieces[key].ids].sum()) for key in pair) / self.area
            shares = length >= self.config.shared * min(around[key] for key in pair)
            if excluded & set(pair) or not (shares or small < self.config.small):
                continue
            apart = sum(self.pieces[key].cost(self.price) for key in pair) + self.price * length
            sure = apart - self.price * (length - self.longest_chain(pair))
            found.append((sure - self.foretell(pair), pair, apart))
        return sorted(found, key=lambda entry: (-entry[0], entry[1]))

    def best_merge(self, least: float, excluded: frozenset[int] = frozenset()) -> Merge | None:
        """A merge that gains more than ``least``: the best of those foretold to, a few at a time; None for none."""
        ranked = [entry for entry in self.candidates(set(excluded)) if entry[0] > least - self.config.doubt]
        untried = [n for n, entry in enumerate(ranked) if entry[1] not in self.tried]
        patience = self.config.patience if len(self.tried) < self.config.tries else self.config.looks
        if np.isfinite(least) and len(untried) > patience:
            ranked = ranked[: untried[patience]]
        for at in range(0, len(ranked), self.config.looks):
            block = ranked[at : at + self.config.looks]
            self.try_merges([pair for _, pair, _ in block])
            valid = [
                Merge(apart - piece.cost(self.price), pair, piece)
                for _, pair, apart in block
                if (piece := self.tried[pair])
            ]
            best = max(valid, key=lambda merge: merge.gain, default=None)
            if best is not None and best.gain > least:
                return best
        return None

    def try_merges(self, pairs: list[Pair]) -> None:
        """Flatten pairs of pieces as one; each pair once."""
        new = [pair for pair in pairs if pair not in self.tried]
        self.tried.update(zip(new, parallel_map(self.merged, new), strict=True))

    def merged(self, pair: Pair) -> Piece | None:
        """The pair as one piece, or None."""
        found = self.try_piece(np.concatenate([self.pieces[key].ids for key in pair]))
        return found if isinstance(found, Piece) else None

    def apply_merge(self, merge: Merge) -> int:
        """Replace two pieces by one; its key."""
        for key in merge.pair:
            del self.pieces[key]
        return self.add(merge.piece)

    def best_split(self, piece: Piece) -> tuple[float, list[Piece]] | None:
        """The best way found to cut a piece in two: (gain, parts)."""
        links = self.links(piece.ids)
        load = oriented_energy(jacobians(piece.flat.surface, piece.flat.uv)) * piece.flat.surface.face_areas()
        points = self.centroids[piece.ids]
        far = int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())
        split = self.config.split
        ways = [
            parts
            for seed in dict.fromkeys((int(load.argmax()), far))
            for parts in necks(links, self.centroids, self.areas, seed, split.levels, split.outermost, split.necks)
        ]
        found = iter(parallel_map(self.try_piece, [ids for parts in ways for ids in parts]))
        best = None
        for parts_ids in ways:
            parts = [next(found) for _ in parts_ids]
            valid = [part for part in parts if isinstance(part, Piece)]
            if len(valid) < len(parts):
                continue
            cut = links.cut_length(np.isin(piece.ids, parts_ids[0])) / self.unit
            gain = piece.cost(self.price) - sum(part.cost(self.price) for part in valid) - self.price * cut
            if best is None or gain > best[0]:
                best = gain, valid
        return best

    def run(self, most: int, rounds: int) -> None:
        """Merge while that pays, then down to ``most`` pieces as far as the stretch allows, then split and merge."""
        self.merge(0.0, 0)
        self.merge(-np.inf, most)
        for _ in range(rounds):
            if len(self.settled) >= self.config.vain_splits or not self.improve(most):
                break
        self.split_down()

    def merge(self, least: float, down_to: int) -> None:
        """Merges that gain more than ``least``, while there are more than ``down_to`` pieces."""
        while len(self.pieces) > down_to:
            best = self.best_merge(least)
            if best is None or (best.gain < 0.0 and self.energy() - best.gain > self.config.most_excess):
                return
            self.apply_merge(best)

    def worst(self) -> int | None:
        """The key of the piece of highest cost that is not settled; None where none could gain from a split."""
        keys = [key for key in self.pieces if key not in self.settled]
        least = self.price * self.config.slit.shortest
        worst = max(keys, key=lambda key: self.pieces[key].cost(self.price), default=None)
        return worst if worst is not None and self.pieces[worst].cost(self.price) > least else None

    def improve(self, most: int) -> bool:
        """Split one piece, and merge two others where the limit asks for it; False when nothing is left to gain."""
        worst = self.worst()
        if worst is None:
            return False
        split = self.best_split(self.pieces[worst])
        if split is not None and split[0] > 0.0:
            room = len(self.pieces) + len(split[1]) - 1 <= most
            merge = None if room else self.best_merge(-split[0], frozenset({worst}))
            if room or merge is not None:
                self.apply_split(worst, split[1])
                if merge is not None:
                    self.apply_merge(merge)
                return True
        self.settled.add(worst)
        return True

    def split_down(self) -> None:
        """Split, whatever the limit on charts, until the stretch is within bounds or no split lowers it."""
        while self.energy() > self.config.most_excess and self.split_worst():
            pass

    def split_worst(self) -> bool:
        """Split the piece of most energy, whatever the limit; False where no split lowers it."""
        for key in sorted(self.pieces, key=lambda key: -self.pieces[key].energy)[: self.config.worst_splits]:
            split, most = self.best_split(self.pieces[key]), self.pieces[key].energy * self.config.split.energy_left
            if split is not None and sum(part.energy for part in split[1]) < most:
                self.apply_split(key, split[1])
                return True
        return False

    def apply_split(self, key: int, parts: list[Piece]) -> None:
        """Replace a piece by its parts."""
        del self.pieces[key]
        for part in parts:
            self.add(part)

    def polish(self) -> None:
        """More SLIM for every piece, as long as it stays valid."""
        keys = list(self.pieces)
        found = parallel_map(lambda key: polished(self.pieces[key], self.area, self.config.slit.contact), keys)
        self.pieces.update(zip(keys, found, strict=True))

    def slit_all(self, above: float, *, contacts: bool = False) -> None:
        """Slits where they pay, in all pieces of more excess energy than ``above``."""
        keys = [key for key, piece in self.pieces.items() if piece.energy > above]
        found = parallel_map(
            lambda key: slit_further(self.pieces[key], self.area, self.config.slit, contacts=contacts), keys
        )
        self.pieces.update(zip(keys, found, strict=True))
