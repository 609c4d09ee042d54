"""Arcs of seams made straight: between junctions, borders and slits take the straightest way along the edges nearby.

The shortest borders of `straighten` have teeth wherever edges run slantwise, and slits are not borders at all.  Here
seams are one network of chains.  Each may leave its place by a few edges; the pieces beside are laid out anew from
where they lay, and an arc goes back where a piece would not be valid, or gain more energy than the arc saves.
e edges of the surface's table · f faces · lengths in √A.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.cutgraph import path_mask
from ...runtime.geometry.distortion import excess, oriented_energy
from ...runtime.geometry.overlap import flipped_triangles
from ...runtime.geometry.straightpaths import straightest_path
from ...runtime.geometry.topology import boundary_loops, edge_table, face_components
from ...runtime.process.deadline import Late, never
from ..finish.arap import RigidSteps, evened_out
from ..finish.contact import Relaxed, boundary_edges, converge, relax, rim_overlaps, separate
from ..finish.flatten import jacobians
from ..finish.pieces import Overlapping, Piece, flattened, measured
from ..finish.slits import Flat
from ..seams.closing import opened_along
from ..seams.network import chains, seam_edges
from ..search.labels import dual_graph
from ..search.search import Search
from ..workers import parallel_map
from .exchange import Room, exchanged, turned
from .fine import bounded
from .junctions import straighter_junctions
from .layout import carried_jacobians
from .moved import as_others_lead
from .sides import faces_beside

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.config import ContactConfig
    from .config import ArcConfig
    from .exchange import Arc

    Laid = Piece | NDArray[np.int64]
    """What became of a piece, or the faces of the surface that make it invalid."""


def with_straight_arcs(search: Search, config: ArcConfig, late: Late = never) -> Search:
    """The search with its seams' arcs straightened and junctions moved, where that costs no more: pass by pass."""
    for number, (width, longest) in enumerate(config.passes):
        if late() or len(search.surface.faces) > config.most_faces:
            break
        arcs = straighter_arcs(search, width, longest, config, shifted=number % 2 == 1)
        search = Straightening(search, arcs).run(config.rounds)
        stars = straighter_junctions(search, width, longest, config, shifted=number % 2 == 1)
        search = Straightening(search, stars).run(config.rounds)
    return search


def straight_pieces(surface: Surface, pieces: list[Piece], config: FinishConfig) -> list[Piece]:
    """The charts of a part of area 1 with their seams' arcs straightened."""
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), config.labels.seams), config)
    for piece in pieces:
        search.add(piece)
    return list(with_straight_arcs(search, config.arcs).pieces.values())


class Straightening:
    """One pass: the arcs that are left, and the layouts of pieces that were found."""

    def __init__(self, search: Search, arcs: list[Arc]) -> None:
        self.search, self.arcs = search, arcs
        self.plain, self.label = seam_edges(search), search.label()
        self.known: dict[tuple[int, frozenset[int]], tuple[NDArray[np.int64], Laid]] = {}
        self.failed: Counter[int] = Counter()

    def run(self, rounds: int) -> Search:
        """The search with those of the arcs on their new ways that leave every piece valid and do not cost more.

        Once that is so, those that cost more than they save go back too, as long as that helps.
        """
        best = self.search
        for _ in range(rounds):
            if not self.arcs:
                break
            found, wrong = self.laid()
            if found is not None and self.is_no_worse(found, best):
                best = found
            elif best is not self.search:
                break
            gain = self.gains(found) if found is not None else -self.nearest(wrong)
            back = gain < 0.0 if (gain < 0.0).any() else gain <= gain.min()
            if found is best and -gain[gain < 0.0].sum() < self.search.config.arcs.worth:
                break
            self.failed.update(set(self.label[wrong > 0.0].tolist()))
            given_up = {key for key, times in self.failed.items() if times >= self.search.config.arcs.failures}
            stuck = np.array([bool(given_up & set(arc.sides)) for arc in self.arcs])
            self.arcs = [arc for arc, each in zip(self.arcs, back | stuck, strict=True) if not each]
        return best

    def is_no_worse(self, found: Search, best: Search) -> bool:
        """Whether the objective is no higher than the best one, and the stretch within its bound, if it was."""
        bound = max(found.config.stretch or np.inf, self.search.energy())
        return self.cost(found) <= self.cost(best) and found.energy() <= bound

    def cost(self, found: Search) -> float:
        """The objective of a search, where turns count as length."""
        return found.objective() + found.price * found.config.arcs.corner * turned(found, seam_edges(found))

    def laid(self) -> tuple[Search | None, NDArray[np.float64]]:
        """The search with the arcs on their new ways; None where a piece is not valid then.

        With a weight (f,) on the faces that make it so: those that overlap, or all of a piece.
        """
        table, keys, wrong = self.search.table, list(self.search.pieces), np.zeros(len(self.label))
        seam = self.moved()
        part = face_components(len(self.label), table.edge_faces[table.manifold & ~seam])
        sides = [np.flatnonzero(part == number) for number in range(int(part.max()) + 1)]
        owner = [int(np.bincount(self.label[ids]).argmax()) for ids in sides]
        if sorted(owner) != sorted(keys):
            wrong[~np.isin(self.label, owner)] = 1.0  # what is cut off, and the pieces that are no more
            largest = {key: ids for ids, key in sorted(zip(sides, owner, strict=True), key=lambda side: len(side[0]))}
            for key, ids in zip(owner, sides, strict=True):
                wrong[ids] = np.maximum(wrong[ids], ids is not largest[key])
            return None, wrong
        jobs = list(zip(owner, sides, strict=True))
        made = parallel_map(lambda job: self.piece(*job, seam), jobs, lambda job: len(job[1]))
        found = self.search.emptied()
        for key, ids, (name, laid) in zip(owner, sides, made, strict=True):
            self.known[key, name] = ids, laid
            if isinstance(laid, Piece) and self.search.is_bearable(laid):
                found.add(laid)
            else:
                wrong[ids if isinstance(laid, Piece) else laid] = 1.0
        return (None if wrong.any() else found), wrong

    def moved(self) -> NDArray[np.bool_]:
        """(e,) bool: the seams with the arcs on their new ways."""
        seam = self.plain.copy()
        for arc in self.arcs:
            seam[arc.old] = False
        for arc in self.arcs:
            seam[arc.new] = True
        return seam

    def piece(self, key: int, ids: NDArray[np.int64], seam: NDArray[np.bool_]) -> tuple[frozenset[int], Laid]:
        """What becomes of a piece, once for the same arcs beside it; and their names."""
        name, source = frozenset(id(arc) for arc in self.arcs if key in arc.sides), self.search.pieces[key]
        known = self.known.get((key, name)) if name else (np.sort(source.ids), source)
        # an arc beside neither may still take faces of this piece, where ways of several meet
        if known is not None and np.array_equal(known[0], ids):
            return name, known[1]
        return name, laid_alike(self.search, ids, seam, source)

    def gains(self, found: Search) -> NDArray[np.float64]:
        """(n,) what each arc lowers the objective by: its length saves, the energy that faces near it gained costs."""
        lost = self.nearest(face_energies(found) - face_energies(self.search)) / self.search.area
        return self.search.price * np.array([arc.saved for arc in self.arcs]) - lost

    def nearest(self, value: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) sums of values (f,) of faces, each given to the arc that lies nearest."""
        ends = self.search.surface.vertices[self.search.table.edges]
        middles = [ends[np.union1d(arc.old, arc.new)].mean(axis=1) for arc in self.arcs]
        owner = np.repeat(np.arange(len(middles)), [len(points) for points in middles])
        near = owner[KDTree(np.concatenate(middles)).query(self.search.centroids)[1]]
        return np.bincount(near, value, minlength=len(middles)).astype(np.float64)


def face_energies(search: Search) -> NDArray[np.float64]:
    """(f,) area · excess of each face."""
    energy = np.zeros(len(search.surface.faces))
    for piece in search.pieces.values():
        energy[piece.ids] = excess(oriented_energy(jacobians(piece.flat.surface, piece.flat.uv)))
    return energy * search.areas


def laid_alike(search: Search, ids: NDArray[np.int64], seam: NDArray[np.bool_], source: Piece) -> Laid:
    """Faces cut along a mask (e,), laid out from where their source lies; or those that keep them from being valid."""
    opened = opened_along(search, ids, seam)
    if opened is None:
        return ids
    disk, slits = opened
    contact = replace(search.config.slit.contact, rounds=search.config.closing.rounds, steps=search.config.arcs.steps)
    led = as_others_lead(disk, ids, source, search.config.fine) if len(boundary_loops(disk.faces)) == 1 else None
    if led is None:
        uv = flattened(disk, contact, np.inf, lambda filled: as_it_lay(filled, source.flat, search.config))
    else:
        uv = relaxed(disk, led, contact)
    if uv is None:
        return ids if led is None else ids[flipped_triangles(led[disk.faces])]
    edges = boundary_edges(disk.faces)
    if rim_overlaps(disk.faces, edges, uv):
        apart = separate(disk, Relaxed(uv, {}), edges, contact)
        if apart is None:
            return ids[Overlapping(ids, Flat(disk, uv, {}), slits).pairs().reshape(-1)]
        uv = apart.uv
    return measured(search.surface, ids, Flat(disk, uv, {}), search.area, slits, search.config.slit.seams)


def relaxed(disk: Surface, uv: NDArray[np.float64], contact: ContactConfig) -> NDArray[np.float64] | None:
    """Uv (v, 2) by SLIM from uv, which may hold a few flips; None where these stay.  It overlaps if the start does."""
    start = evened_out(disk.faces, uv, contact.unfolding)
    if start is None:
        return None
    if rim_overlaps(disk.faces, boundary_edges(disk.faces), start):
        free = converge(disk, Relaxed(start, {}), np.inf, contact)
        return free if free is not None and np.isfinite(free).all() else None
    return relax(disk, Relaxed(start, {}), contact).uv


def as_it_lay(disk: Surface, source: Flat, config: FinishConfig) -> NDArray[np.float64]:
    """Uv (v, 2) of a piece that differs from its source along the border: the source's own, stretch and all."""
    nearest = faces_beside(disk, source, config)
    return RigidSteps(disk).solve(bounded(carried_jacobians(disk, source, nearest), config.fine.steepest))


def straighter_arcs(search: Search, width: float, longest: int, config: ArcConfig, *, shifted: bool) -> list[Arc]:
    """Arcs that have a straighter way no farther off than ``width`` mean edges; any of them may be taken.

    No new way meets another arc, old or new.  longest: edges of an arc.  shifted: chains are parted elsewhere.
    """
    seam = seam_edges(search)
    parts = [
        (part, chain.sides) for chain in chains(search, seam) for part in parted(chain.path, longest, shifted=shifted)
    ]
    room, found = Room(search, seam), []
    for path, sides in sorted(parts, key=lambda part: len(part[0])):
        old = np.flatnonzero(path_mask(search.table, [path.tolist()]))
        if len(old) < config.least:
            continue
        way = straightest_path(room.around(old, width), int(path[0]), int(path[-1]), config.turning)
        new = np.flatnonzero(path_mask(search.table, [way])) if way else old
        if not np.array_equal(new, old):
            room.barred[way] = True
            found.append(exchanged(search, seam, old, new, sides))
    return found


def parted(path: NDArray[np.int64], longest: int, *, shifted: bool) -> list[NDArray[np.int64]]:
    """A chain in parts of like length of so many edges at most, a closed one in three at least.

    shifted: the first part is half as long, or a closed chain begins half a part later.
    """
    closed, length = path[0] == path[-1], len(path) - 1
    count = max(-(-length // longest), 3 if closed else 1)
    if length < count:
        return []
    if closed and shifted:
        ring = np.roll(path[:-1], -(length // (2 * count)))
        path = np.append(ring, ring[0])
    places = np.linspace(0, length, count + 1)
    if shifted and not closed and count > 1:
        places = np.concatenate([[0.0], (places[1:] + places[:-1]) / 2.0, [length]])
    at = places.astype(np.int64)
    return [path[first : last + 1] for first, last in pairwise(at.tolist()) if last > first]
