"""The state of a search: valid pieces of a part of area 1, what they cost, and how faces become pieces.

Objective: Σ area · excess + price · (seams + slits).
"""

from __future__ import annotations

from copy import copy
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.overlap import overlaps_anywhere
from ...runtime.geometry.topology import edge_table
from ..finish.fallback import unwrapped_by_xatlas
from ..finish.flaps import Trimmed, attached, trimmed
from ..finish.pieces import Overlapping, Piece, measured, try_piece
from ..workers import parallel_map
from .cuts import Links, cut_between, halves, overlap_sides
from .labels import DualGraph, border_lengths

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.pieces import Start
    from ..finish.slits import Slit

Pair = tuple[int, int]


class Loose(NamedTuple):
    """A flap (n,) without a piece yet, and a face of the piece that it came from."""

    flap: NDArray[np.int64]
    owner: int


class State:
    """Valid pieces by key; a key is never used twice."""

    def __init__(self, surface: Surface, graph: DualGraph, config: FinishConfig) -> None:
        self.surface, self.graph, self.config = surface, graph, config
        self.price = config.slit.price
        self.areas = surface.face_areas()
        self.area = float(self.areas.sum())
        self.unit = float(np.sqrt(self.area))
        self.centroids = surface.triangles.mean(axis=1)
        self.table = edge_table(surface.faces)
        self.pieces: dict[int, Piece] = {}
        self.loose: list[Loose] = []
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
        """Faces as one valid piece, less its flaps, or cut until they are valid; at last by xatlas."""
        found = self.try_piece(ids, slits)
        less = self.trimmed(found) if isinstance(found, Overlapping) else None
        if isinstance(found, Piece):
            self.add(found)
        elif slits:
            self.add_valid(ids, (), depth)
        elif less is not None:
            self.add_trimmed(less)
        elif depth == self.config.halvings or len(ids) == 1:
            for part in unwrapped_by_xatlas(self.surface, ids, self.area):
                self.add(part)
        else:
            for part in self.cut(ids, found):
                self.add_valid(part, (), depth + 1)

    def add_all_valid(self, jobs: list[tuple[NDArray[np.int64], tuple[Slit, ...]]]) -> None:
        """Faces and slits, each as one valid piece or several, found side by side; then a place for all flaps."""

        def found(job: tuple[NDArray[np.int64], tuple[Slit, ...]]) -> tuple[list[Piece], list[Loose]]:
            alone = copy(self)
            alone.pieces, alone.loose = {}, []
            alone.add_valid(*job)
            return list(alone.pieces.values()), alone.loose

        for pieces, loose in parallel_map(found, jobs):
            for piece in pieces:
                self.add(piece)
            self.loose += loose
        self.place_loose()

    def add_trimmed(self, found: Trimmed) -> None:
        """Take a piece in, and keep its flaps for ``place_loose``."""
        self.add(found.piece)
        self.loose += [Loose(flap, int(found.piece.ids[0])) for flap in found.flaps]

    def trimmed(self, found: Overlapping) -> Trimmed | None:
        """A flattening less its flaps; None where they are too large, or the rest too stretched."""
        less = trimmed(self.surface, found, self.area, self.config.flaps.most, self.config.slit.seams)
        return less if less is not None and self.is_bearable(less.piece) else None

    def is_bearable(self, piece: Piece) -> bool:
        """True where the mean excess of a piece is one that a search can start from."""
        return piece.energy * self.area <= self.config.bearable * float(self.areas[piece.ids].sum())

    def cut(self, ids: NDArray[np.int64], found: Overlapping | None) -> list[NDArray[np.int64]]:
        """Faces that can't be one piece, cut between what overlaps, or half way."""
        links = self.links(ids)
        pairs = found.pairs() if found is not None else np.zeros((0, 2), dtype=np.int64)
        if found is not None and len(pairs):
            sides = overlap_sides(found.flat.surface.faces, pairs)
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
        """Σ costs + price · borders, the page counted by the room that charts leave in their convex hulls."""
        return sum(self.cost_of(piece) for piece in self.pieces.values()) + self.price * sum(self.borders().values())

    def cost_of(self, piece: Piece) -> float:
        """What a piece adds to the objective, its border left out."""
        page = self.config.hull_price
        return piece.cost(self.price) + (page * piece.waste / self.area if page else 0.0)

    def exchange(self, keys: Sequence[int], parts: Sequence[Trimmed], least: float, most: int) -> bool:
        """Replace pieces by others, and find a place for their flaps.

        False, and nothing done, where that lowers the objective by ``least`` or less, or makes more than ``most``
        pieces.
        """
        before, cost = dict(self.pieces), self.objective()
        for key in keys:
            del self.pieces[key]
        for part in parts:
            self.add_trimmed(part)
        self.place_loose()
        if len(self.pieces) <= most and cost - self.objective() > least:
            return True
        self.pieces = before
        return False

    def give_away(self, flap: NDArray[np.int64], owner: int) -> bool:
        """Put a flap on a piece beside it: that of longest common border first, the one of the face ``owner`` last."""
        label, pairs = self.label(), self.graph.pairs
        inside = np.isin(pairs, flap)
        across = inside[:, 0] != inside[:, 1]
        beside = label[np.where(inside[across, 0], pairs[across, 1], pairs[across, 0])]
        length = np.bincount(beside[beside >= 0], self.graph.length[across][beside >= 0])
        keys = np.flatnonzero(length > 0.0)
        for key in keys[np.lexsort((-length[keys], keys == label[owner]))].tolist():
            piece = self.pieces[key]
            found = attached(piece, self.surface, self.table, flap, self.config.flaps)
            wider = (
                None
                if found is None
                else measured(self.surface, *found, self.area, piece.slits, self.config.slit.seams)
            )
            if wider is not None and self.is_bearable(wider):
                del self.pieces[key]  # under its key merges of the smaller piece are known
                self.add(wider)
                return True
        return False

    def mend(self) -> None:
        """Prove every piece; one that overlaps loses its flaps, or goes to xatlas where they are too large.

        The search tests borders alone, which do not cross where a part of a piece lies wholly inside another.
        """
        for key, piece in list(self.pieces.items()):
            if not overlaps_anywhere(piece.flat.uv[piece.flat.surface.faces]):
                continue
            del self.pieces[key]
            less = self.trimmed(Overlapping(piece.ids, piece.flat, piece.slits))
            for part in [] if less is not None else unwrapped_by_xatlas(self.surface, piece.ids, self.area):
                self.add(part)
            if less is not None:
                self.add_trimmed(less)
        self.place_loose()

    def place_loose(self) -> None:
        """Give all loose flaps away; those that nothing takes become pieces, whose own flaps come after."""
        while self.loose:
            loose, self.loose = self.loose, []
            for flap, owner in loose:
                if not self.give_away(flap, owner):
                    self.add_valid(flap)
