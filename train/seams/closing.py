"""Seams closed: charts joined by a bridge of a few edges or a whole border, seams shortened from their loose ends.

Each way to close a run of seam edges is ranked by what curvature foretells of it, the best are flattened, and the best
of those is taken, as long as it stays valid and within a bound on stretch.   Lengths in √A, energies in shares of A.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.cutgraph import counted_length, cut_chains
from ...runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic
from ...runtime.mesh import Surface
from ...runtime.process.deadline import Late, never
from ..finish.contact import Relaxed, boundary_edges, excess_energy, rim_overlaps, separate
from ..finish.curvature import border_first, foretold_energies
from ..finish.disks import cut_open
from ..finish.flaps import Trimmed, flap_faces
from ..finish.flatten import sorted_loops
from ..finish.pieces import Overlapping, Piece, flattened, measured
from ..finish.slits import Flat, Slit
from ..workers import parallel_map
from .held import laid_within, sewn_up
from .network import chains, intervals, seam_edges

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..finish.pieces import Start
    from ..search.search import Search
    from .config import ClosingConfig

    Name = tuple[tuple[int, ...], tuple[int, int, int]]


@dataclass(frozen=True)
class Bounds:
    """What closing must keep.

    charts: so many are asked for.  excess: mean excess energy of the part at most.
    """

    charts: int
    excess: float


class Run(NamedTuple):
    """Seam edges to be closed.

    sides: keys of the pieces beside them.  saved: their length.  paid: energy foretold.
    """

    edges: NDArray[np.int64]
    sides: tuple[int, ...]
    saved: float
    paid: float

    @property
    def place(self) -> tuple[int, int, int]:
        """What tells it from others on the surface."""
        return int(self.edges[0]), int(self.edges[-1]), len(self.edges)

    @property
    def name(self) -> Name:
        """What tells it from others as long as the pieces beside it are what they are."""
        return self.sides, self.place


class Closing:
    """The closing of one search's seams; the search is changed in place."""

    def __init__(self, search: Search, bounds: Bounds, config: ClosingConfig, late: Late = never) -> None:
        self.search, self.bounds, self.config, self.late = search, bounds, config, late
        self.foretold: dict[Name, float] = {}
        self.tried: dict[Name, Trimmed | None] = {}
        self.vain: set[tuple[int, int, int]] = set()
        self.seen: list[Search] = []
        """The search after each run that was closed."""

    def close(self, price: float, tries: int) -> None:
        """Close what pays at this price of a seam, within the bounds and so many tries.

        Where there are too many charts, they are joined whatever that costs, by short bridges if need be.
        """
        last = len(self.tried) + tries
        self.vain = set()
        while len(self.tried) < last and not self.late():
            seam = seam_edges(self.search)
            runs = [run for run in self.runs(seam) if run.place not in self.vain]
            paying = sorted(runs, key=lambda run: run.paid - price * run.saved)
            paying = [run for run in paying if run.paid < price * run.saved + self.config.doubt]
            if self.take_best(paying, seam, price):
                continue
            many = len(self.search.pieces) > self.bounds.charts
            bridges = self.within_bounds([run for run in runs if len(run.sides) == 2])
            if not many or not bridges:
                return
            self.take_best(sorted(bridges, key=lambda run: run.saved), seam, np.inf)

    def take_best(self, runs: list[Run], seam: NDArray[np.bool_], price: float) -> bool:
        """Close the best of the first runs that pays at this price; False where none does."""
        worth = self.within_bounds(runs)[: self.config.patience]
        for at in range(0, len(worth), self.config.looks):
            block = worth[at : at + self.config.looks]
            self.flatten(block, seam)
            for run in sorted(block, key=lambda run: self.loss(run, price)):
                if self.loss(run, price) < 0.0 and self.take(run, price):
                    return True
                self.vain.add(run.place)
        return False

    def within_bounds(self, runs: list[Run]) -> list[Run]:
        """Those of the runs that are foretold to leave the stretch within bounds."""
        room = self.bounds.excess - self.search.energy()
        hope = self.config.hope if self.search.config.slit.contact.scaffold.rounds else 1.0
        return [run for run in runs if run.paid * hope < room + self.config.doubt]

    def flatten(self, runs: list[Run], seam: NDArray[np.bool_]) -> None:
        """Flatten what is left by closing each of these runs, those that are new."""
        new = [run for run in runs if run.name not in self.tried]
        found = parallel_map(lambda run: self.closed(run, seam), new)
        self.tried |= {run.name: part for run, part in zip(new, found, strict=True)}

    def loss(self, run: Run, price: float) -> float:
        """What closing a run, which was flattened, adds to the objective at a price; infinite where it can't be."""
        part = self.tried[run.name]
        if part is None:
            return np.inf
        sides = [self.search.pieces[key] for key in run.sides]
        saved = run.saved - part.rim
        if not np.isfinite(price):
            return -saved
        page = self.search.config.hull_price
        waste = page * (part.piece.waste - sum(piece.waste for piece in sides)) / self.search.area if page else 0.0
        return part.piece.energy - sum(piece.energy for piece in sides) - price * saved + waste

    def take(self, run: Run, price: float) -> bool:
        """Replace the pieces beside a run; False, and nothing done, where the bounds are broken."""
        search, part = self.search, self.tried[run.name]
        if part is None:
            return False
        before = dict(search.pieces)
        most = max(len(before), self.bounds.charts)
        least = 0.0 if price == search.price else -np.inf
        if search.exchange(run.sides, [part], least, most) and search.energy() <= self.bounds.excess:
            self.seen.append(search.twin())
            return True
        search.pieces = before
        self.tried[run.name] = None
        return False

    def runs(self, seam: NDArray[np.bool_]) -> list[Run]:
        """All runs that may be closed, with what curvature foretells."""
        found, config = [], self.config
        shares = config.shares_held if self.search.config.slit.contact.scaffold.rounds else config.shares
        for chain in chains(self.search, seam):
            if not chain.loose and len(chain.sides) < 2:
                continue
            for edges in intervals(chain, shares, config.least, both=self.search.config.stretch > 0.0):
                saved = path_length(self.search, edges)
                run = Run(edges, chain.sides, saved, 0.0)
                if run.name not in self.foretold:
                    self.foretold[run.name] = self.foretell(run, seam)
                found.append(run._replace(paid=self.foretold[run.name]))
        return found

    def foretell(self, run: Run, seam: NDArray[np.bool_]) -> float:
        """Energy that closing a run is foretold to cost."""
        before = (run.sides, (-1, -1, 0))
        if before not in self.foretold:
            self.foretold[before] = self.needed(run.sides, seam)
        still = seam.copy()
        still[run.edges] = False
        return self.needed(run.sides, still) - self.foretold[before]

    def needed(self, sides: tuple[int, ...], seam: NDArray[np.bool_]) -> float:
        """Energy foretold of pieces that are cut along a mask (e,), and joined elsewhere."""
        search = self.search
        ids = np.concatenate([search.pieces[key].ids for key in sides])
        faces = search.surface.faces[ids]
        rim = np.ones(len(search.surface.vertices), dtype=bool)
        rim[faces] = False
        rim[search.table.edges[seam | ~search.table.manifold]] = True
        u = search.rules.curvature.factor(rim)
        return float(foretold_energies(faces, search.areas[ids], u).sum()) / search.area * search.config.foretold

    def closed(self, run: Run, seam: NDArray[np.bool_]) -> Trimmed | None:
        """The pieces beside a run as one, with the run closed; None where that is not valid or not within bounds."""
        search = self.search
        ids = np.concatenate([search.pieces[key].ids for key in run.sides])
        others = search.energy() - sum(search.pieces[key].energy for key in run.sides)
        still = seam.copy()
        still[run.edges] = False
        goal = self.bounds.excess - others
        if not search.config.slit.contact.scaffold.rounds:
            return valid(search, laid_open(search, ids, still, goal), self.config.rounds)
        sewn = partial(sewn_up, search.pieces[min(run.sides)]) if len(run.sides) == 1 else None
        return valid(search, laid_open(search, ids, still, goal, sewn), self.config.rounds, goal, sewn)


def path_length(search: Search, edges: NDArray[np.int64]) -> float:
    """Length of edges, rows of the table (n,), in √A, as the objective counts it."""
    return counted_length(search.surface.vertices[search.table.edges[edges]], search.config.slit.seams) / search.unit


def laid_open(
    search: Search, ids: NDArray[np.int64], seam: NDArray[np.bool_], goal: float, start: Start | None = None
) -> Piece | Overlapping | None:
    """Faces cut along a mask (e,) of the surface's edges, flattened, from ``start`` if that has no flips.

    None where they are no disk then, or their excess energy is above ``goal``.
    """
    opened = opened_along(search, ids, seam)
    if opened is None:
        return None
    disk, slits = opened
    if start is None and len(boundary_loops(disk.faces)) == 1:
        first = border_first(disk, sorted_loops(disk)[0], search.config.slit.contact.cotangents)
        held = search.config.slit.contact.scaffold.rounds
        if not held and lies_over_itself(disk, first, search.config.closing.hopeless):
            return None
        start = lambda _: first  # noqa: E731
    uv = flattened(disk, search.config.slit.contact, goal * search.area, start)
    if uv is None or excess_energy(disk, uv) > goal * search.area:
        return None
    if rim_overlaps(disk.faces, boundary_edges(disk.faces), uv):
        return Overlapping(ids, Flat(disk, uv, {}), slits)
    return measured(search.surface, ids, Flat(disk, uv, {}), search.area, slits, search.config.slit.seams)


def opened_along(
    search: Search, ids: NDArray[np.int64], seam: NDArray[np.bool_]
) -> tuple[Surface, tuple[Slit, ...]] | None:
    """Faces cut along a mask (e,) of the surface's edges, and the slits that are; None where that is no disk."""
    whole, _ = search.surface.part(ids)
    table = edge_table(whole.faces)
    source = np.zeros(len(table.edges), dtype=np.int64)
    source[table.face_edges.reshape(-1)] = search.table.face_edges[ids].reshape(-1)
    cut = table.manifold & seam[source]
    opened, old = cut_open(whole.faces, cut, table)
    loops = len(boundary_loops(opened))
    if loops == 0 or 2 - loops != euler_characteristic(opened):
        return None
    return Surface(whole.vertices[old], opened), as_slits(whole, cut)


def lies_over_itself(disk: Surface, uv: NDArray[np.float64], most: float) -> bool:
    """True where more than a share ``most`` of a layout lies over the rest: relaxed, it will overlap too."""
    if not rim_overlaps(disk.faces, boundary_edges(disk.faces), uv):
        return False
    areas = disk.face_areas()
    return float(areas[flap_faces(uv[disk.faces], areas)].sum()) > most * float(areas.sum())


def valid(
    search: Search, found: Piece | Overlapping | None, rounds: int, goal: float = np.inf, start: Start | None = None
) -> Trimmed | None:
    """A flattening as it is; where a little overlaps, drawn apart in so many rounds, or less its flaps; else None.

    With scaffolds, one that overlaps is laid out anew within them, from ``start`` if that is valid, where that leads
    to an excess energy of ``goal``.
    """
    if isinstance(found, Overlapping) and search.config.slit.contact.scaffold.rounds:
        return laid_within(search, found, goal, start)
    less = search.less_flaps(found)
    if not isinstance(found, Overlapping) or less is None:
        return less
    flat, contact = found.flat, replace(search.config.slit.contact, rounds=rounds)
    apart = separate(flat.surface, Relaxed(flat.uv, {}), boundary_edges(flat.surface.faces), contact)
    if apart is None:
        return less
    whole = measured(
        search.surface, found.ids, flat._replace(uv=apart.uv), search.area, found.slits, search.config.slit.seams
    )
    return Trimmed(whole, (), 0.0) if search.is_bearable(whole) else less


def as_slits(surface: Surface, cut: NDArray[np.bool_]) -> tuple[Slit, ...]:
    """Cut edges (e,) as slits, each from the border or from one before it."""
    table = edge_table(surface.faces)
    open_at = set(np.unique(table.edges[table.edge_count == 1]).tolist())
    found = []
    for path in cut_chains(table, cut):
        found.append(Slit(surface.vertices[path], through=not open_at or path[-1] in open_at))
        open_at |= set(path)
    return tuple(found)
