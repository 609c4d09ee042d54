"""Split and merge: chart borders moved to where they pay, under the limit on the number of charts.

A merge saves the border between two charts; a split costs one and frees what could not be flattened: a limb at its
neck.  Merges are ranked by the energy that curvature foretells, and only the best are flattened.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.distortion import oriented_energy
from ...runtime.process.deadline import Late, never
from ..finish.contact import Relaxed, converge
from ..finish.flaps import Trimmed, restricted
from ..finish.flatten import jacobians
from ..finish.pieces import Overlapping, Piece, measured, polished, slit_further
from ..workers import parallel_map
from .cuts import necks
from .foretold import Foretold
from .state import Pair, State

if TYPE_CHECKING:
    from typing import Self

    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from .labels import DualGraph


class Merge(NamedTuple):
    """A merge that lowers the objective by ``gain`` (negative: raises it), as far as its flaps find a place."""

    gain: float
    pair: Pair
    merged: Trimmed


class Split(NamedTuple):
    """A cut of a piece in two that lowers the objective by ``gain``, as far as its flaps find a place."""

    gain: float
    parts: list[Trimmed]


class Search(State):
    """The search's moves, and the merges already tried."""

    def __init__(self, surface: Surface, graph: DualGraph, config: FinishConfig) -> None:
        super().__init__(surface, graph, config)
        self.rules = Foretold(surface, self.table, config)
        self.tried: dict[Pair, Trimmed | None] = {}
        self.foretold: dict[Pair, tuple[float, float]] = {}
        self.settled: set[int] = set()
        self.flattened = 0

    def emptied(self) -> Self:
        """A search of the same surface without pieces."""
        fresh = self.twin()
        fresh.pieces, fresh.loose, fresh._next = {}, [], 0
        return fresh

    def twin(self) -> Self:
        """The same pieces, to be changed for itself."""
        other = copy(self)
        other.pieces, other.loose = dict(self.pieces), list(self.loose)
        other.tried, other.foretold, other.settled, other.flattened = {}, {}, set(), 0
        return other

    def foretell(self, pair: Pair) -> tuple[float, float]:
        """What curvature foretells of two pieces as one: their cost, and the border that a merge is sure to save."""
        if pair not in self.foretold:
            first, second = (self.pieces[key] for key in pair)
            self.foretold[pair] = self.rules.cost(first, second), self.rules.longest_chain(first, second)
        return self.foretold[pair]

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
            cost, saved = self.foretell(pair)
            found.append((apart - self.price * (length - saved) - cost, pair, apart))
        return sorted(found, key=lambda entry: (-entry[0], entry[1]))

    def best_merge(self, least: float, excluded: frozenset[int] = frozenset()) -> Merge | None:
        """A merge that gains more than ``least``: the best of those foretold to, a few at a time; None for none."""
        ranked = [entry for entry in self.candidates(set(excluded)) if entry[0] > least - self.config.doubt]
        untried = [n for n, entry in enumerate(ranked) if entry[1] not in self.tried]
        patience = self.config.patience if len(self.tried) < self.config.tries else self.config.looks
        if np.isfinite(least) and len(untried) > patience:
            ranked = ranked[: untried[patience]]
        for at in range(0, len(ranked), self.config.looks):
            if np.isinf(least) and self.is_tired():
                return None
            block = ranked[at : at + self.config.looks]
            self.try_merges([pair for _, pair, _ in block])
            valid = [
                Merge(apart - self.cost(merged) + self.wasted(pair), pair, merged)
                for _, pair, apart in block
                if (merged := self.tried[pair])
            ]
            best = max(valid, key=lambda merge: merge.gain, default=None)
            if best is not None and best.gain > least:
                return best
        return None

    def wasted(self, pair: Pair) -> float:
        """What two pieces cost by the page that they waste."""
        return sum(self.cost_of(self.pieces[key]) - self.pieces[key].cost(self.price) for key in pair)

    def try_merges(self, pairs: list[Pair]) -> None:
        """Flatten pairs of pieces as one; each pair once."""
        new = [pair for pair in pairs if pair not in self.tried]
        self.tried.update(zip(new, parallel_map(self.merged, new), strict=True))
        self.flattened += sum(len(self.pieces[key].ids) for pair in new for key in pair)

    def is_tired(self) -> bool:
        """True once so many merges, or merges of so many faces, were flattened that none may raise the objective."""
        return len(self.tried) > self.config.most_tries or self.flattened > self.config.most_faces_tried

    def merged(self, pair: Pair) -> Trimmed | None:
        """The pair as one piece, less the flaps of it that lie over the rest; None where it overlaps by more."""
        return self.less_flaps(self.try_piece(np.concatenate([self.pieces[key].ids for key in pair])))

    def less_flaps(self, found: Piece | Overlapping | None) -> Trimmed | None:
        """A flattening as it is or without its flaps; None where these are too large."""
        if isinstance(found, Piece):
            return Trimmed(found, (), 0.0)
        return self.trimmed(found) if found is not None else None

    def apply_merge(self, merge: Merge, least: float) -> bool:
        """Replace two pieces by one; False, and not tried again, where that gains ``least`` or less in the end."""
        done = self.exchange(merge.pair, [merge.merged], least, len(self.pieces) - 1)
        if not done:
            self.tried[merge.pair] = None
        return done

    def best_split(self, piece: Piece) -> Split | None:
        """The best way found to cut a piece in two."""
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
        found = iter(parallel_map(lambda ids: self.part(piece, ids), [ids for parts in ways for ids in parts]))
        best: Split | None = None
        for parts_ids in ways:
            parts = [next(found) for _ in parts_ids]
            cut = links.cut_length(np.isin(piece.ids, parts_ids[0])) / self.unit
            gain = self.cost_of(piece) - sum(self.cost(part) for part in parts) - self.price * cut
            if best is None or gain > best.gain:
                best = Split(gain, parts)
        return best

    def cost(self, found: Trimmed) -> float:
        """What a piece adds to the objective, its outer border left out; its flaps' counted in."""
        return self.cost_of(found.piece) + self.price * found.rim

    def part(self, piece: Piece, ids: NDArray[np.int64]) -> Trimmed:
        """Some faces of a piece: laid out anew, or as they lie in it, relaxed or not, whichever costs least."""
        rows = np.flatnonzero(np.isin(piece.ids, ids))
        flat = restricted(piece.flat, rows)
        kept = Trimmed(
            measured(self.surface, piece.ids[rows], flat, self.area, piece.slits, self.config.slit.seams), (), 0.0
        )
        free = converge(flat.surface, Relaxed(flat.uv, {}), np.inf, self.config.slit.contact)
        ways = [kept, self.less_flaps(self.try_piece(ids))]
        if free is not None and np.isfinite(free).all():  # slivers may have no end
            ways.append(self.trimmed(Overlapping(piece.ids[rows], flat._replace(uv=free), piece.slits)))
        return min((way for way in ways if way is not None), key=self.cost)

    def begin(self, late: Late = never) -> Self:
        """Split what is stretched, and merge while that pays, unless it is ``late``; the search itself is returned."""
        self.place_loose()
        if not late():
            self.split_stretched()
        self.merge(0.0, 0, late)
        return self

    def finish(self, most: int, rounds: int, late: Late = never, last: Late = never) -> Self:
        """Merge down to ``most`` pieces as far as the stretch allows, then split and merge where that pays.

        The search itself is returned.  Once it is ``late``, only what the limits on pieces and stretch ask for; from
        the ``last`` moment on, nothing.
        """
        self.merge_down(most, last)
        for _ in range(rounds):
            if late() or len(self.settled) >= self.config.vain_splits or not self.improve(most):
                break
        self.split_down(last)
        return self

    def merge(self, least: float, down_to: int, late: Late = never) -> None:
        """Merges that gain more than ``least``, while there are more than ``down_to`` pieces and it is not ``late``."""
        while len(self.pieces) > down_to and not late():
            best = self.best_merge(least)
            if best is None or (best.gain < 0.0 and self.energy() - best.gain > self.config.most_excess):
                return
            self.apply_merge(best, least)

    def merge_down(self, most: int, last: Late = never) -> None:
        """Merge down to ``most`` pieces, whatever that costs within the bounds of stretch.

        Where they do not go that far, the limit is broken anyway: then the objective decides.  Pieces far above the
        limit are not even tried.
        """
        before, cost = dict(self.pieces), self.objective()
        if len(before) <= most + self.config.start.crowded:
            self.merge(-np.inf, most, last)
        if len(self.pieces) > most and self.objective() > cost:
            self.pieces = before

    def join_crumbs(self, late: Late = never) -> None:
        """Pieces too small to be charts of their own join one beside them, the least first, where that is valid.

        It may cost no more than a crumb is worth, and the stretch stays within its bound.
        """
        crumbs, vain = self.config.crumbs, set[int]()
        while not late():
            size = {key: float(self.areas[piece.ids].sum()) / self.area for key, piece in self.pieces.items()}
            small = [key for key in size if key not in vain and size[key] < crumbs.share]
            if not small:
                return
            least = min(small, key=lambda key: size[key])
            vain.add(least)
            self.join_crumb(least)

    def join_crumb(self, key: int) -> None:
        """Merge a crumb with the first piece that takes it, that of longest common border asked first."""
        borders = {pair: length for pair, length in self.borders().items() if key in pair}
        self.try_merges(list(borders))
        before, bound = dict(self.pieces), max(self.config.stretch or np.inf, self.energy())
        for pair in sorted(borders, key=lambda pair: -borders[pair]):
            merged = self.tried[pair]
            if merged and self.exchange(pair, [merged], -self.config.crumbs.price, len(before) - 1):
                if self.energy() <= bound:
                    return
                self.pieces = dict(before)

    def worst(self) -> int | None:
        """The key of the piece of highest cost that is not settled; None where none could gain from a split."""
        keys = [key for key in self.pieces if key not in self.settled]
        least = self.price * self.config.slit.shortest
        worst = max(keys, key=lambda key: self.cost_of(self.pieces[key]), default=None)
        return worst if worst is not None and self.cost_of(self.pieces[worst]) > least else None

    def improve(self, most: int) -> bool:
        """Split one piece, and merge two others where the limit asks for it; False when nothing is left to gain."""
        worst = self.worst()
        if worst is None:
            return False
        split = self.best_split(self.pieces[worst])
        if split is not None and split.gain > 0.0:
            full = len(self.pieces) >= most
            merge = self.best_merge(-split.gain, frozenset({worst})) if full else None
            if merge is not None and (not self.apply_merge(merge, -split.gain) or worst not in self.pieces):
                return True
            lost = merge.gain if merge is not None else 0.0
            if (merge is not None or not full) and self.exchange([worst], split.parts, max(-lost, 0.0), most):
                return True
        self.settled.add(worst)
        return True

    def split_stretched(self) -> None:
        """Split the pieces of much stretch where that pays, whatever the limit: merges then join better ones."""
        seen: set[int] = set()
        while keys := [key for key in self.pieces if key not in seen and self.is_stretched(self.pieces[key])]:
            seen.add(keys[0])
            split = self.best_split(self.pieces[keys[0]])
            if split is not None and split.gain > 0.0:
                self.exchange([keys[0]], split.parts, 0.0, len(self.surface.faces))

    def is_stretched(self, piece: Piece) -> bool:
        """True where the mean excess of a piece is so high that it is split before others are merged."""
        return piece.energy * self.area > self.config.stretched * float(self.areas[piece.ids].sum())

    def split_down(self, last: Late = never) -> None:
        """Split, whatever the limit on charts, until the stretch is within bounds or no split lowers it."""
        while self.energy() > self.config.most_excess and not last() and self.split_worst():
            pass

    def split_worst(self) -> bool:
        """Split the piece of most energy, whatever the limit; False where no split lowers it."""
        for key in sorted(self.pieces, key=lambda key: -self.pieces[key].energy)[: self.config.worst_splits]:
            split, most = self.best_split(self.pieces[key]), self.pieces[key].energy * self.config.split.energy_left
            if split is None or sum(part.piece.energy for part in split.parts) >= most:
                continue
            before = self.energy()
            if self.exchange([key], split.parts, -np.inf, len(self.surface.faces)) and self.energy() < before:
                return True
        return False

    def polish(self) -> None:
        """More SLIM for every piece, as long as it stays valid."""
        keys = list(self.pieces)
        found = parallel_map(lambda key: polished(self.pieces[key], self.area, self.config.slit.contact), keys)
        self.pieces.update(zip(keys, found, strict=True))

    def slit_all(self, above: float, *, contacts: bool = False, price: float | None = None) -> None:
        """Slits where they pay, at this price or that of the search, in pieces of more excess energy than ``above``."""
        config = self.config.slit if price is None else replace(self.config.slit, price=price)
        keys = [key for key, piece in self.pieces.items() if piece.energy > above]
        found = parallel_map(lambda key: slit_further(self.pieces[key], self.area, config, contacts=contacts), keys)
        self.pieces.update(zip(keys, found, strict=True))
