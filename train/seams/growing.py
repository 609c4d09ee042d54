"""Seams grown: few and short ones that make one disk of a surface, and from there to where curvature asks for more.

The other way round from closing: a slit at a time, to where a conformal map would squeeze or stretch most for the
length of the way there; first as far as is foretold, then as far as a flattening needs it.
v vertices · e edges · lengths in √A, energies in shares of A.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.cutgraph import edge_costs, path_mask, shortest_paths, trace_back
from ...runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic
from ..finish.contact import excess_energy
from ..finish.curvature import Curvature, foretold_energies
from ..finish.disks import disk_cuts
from ..finish.slits import Slit, path_length, slit_to
from .closing import laid_open, valid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ...runtime.process.deadline import Late
    from ..config import FinishConfig
    from ..finish.pieces import Piece
    from ..search.search import Search


class Grown(NamedTuple):
    """Seams on their way.  cut: (e,) bool.  rim: (v,) bool, on them or on the border.  energy: foretold.

    factor: (v,) log scale of the conformal map.
    """

    cut: NDArray[np.bool_]
    rim: NDArray[np.bool_]
    energy: float
    factor: NDArray[np.float64]


class Way(NamedTuple):
    """A slit along a path of vertices.  gain: energy saved per length.  after: what is then."""

    gain: float
    path: list[int]
    after: Grown


def grown(surface: Surface, energies: tuple[float, ...], config: FinishConfig) -> list[NDArray[np.bool_]]:
    """Cuts (e,) of a connected surface by which one chart is foretold to have at most each of these energies."""
    work = Growing(surface, float(surface.face_areas().sum()), config)
    state, found = work.begun(), []
    for energy in sorted(energies, reverse=True):
        state = work.led_on(state, energy)
        if not found or (found[-1] != state.cut).any():
            found.append(state.cut)
    return found


def as_one_chart(search: Search, cut: NDArray[np.bool_]) -> Search | None:
    """A search of the same surface with one piece, cut along a mask (e,); None where it can't be laid out."""
    found, ids = search.emptied(), np.arange(len(search.surface.faces))
    part = valid(found, laid_open(found, ids, cut, np.inf), search.config.closing.rounds)
    if part is None or not found.is_bearable(part.piece):
        return None
    found.add_trimmed(part)
    found.place_loose()
    return found


def opened_to(piece: Piece, total_area: float, energy: float, config: FinishConfig, late: Late) -> Piece:
    """The piece with slits until it has no more than that energy, or none of those looked at lowers it."""
    while piece.energy > energy and not late():
        better = best_slit(piece, total_area, config)
        if better is None:
            break
        piece = better
    return piece


def best_slit(piece: Piece, total_area: float, config: FinishConfig) -> Piece | None:
    """The piece with the slit that saves most for its length, of a few foretold to; None where none saves anything."""
    work, least = Growing(piece.flat.surface, total_area, config), config.closing.growing.shortest
    best, most = None, 0.0
    for way in work.ways(work.uncut())[: config.closing.growing.tries]:
        flat = slit_to(piece.flat, way.path, work.table).relaxed(config.slit.contact)
        energy = excess_energy(flat.surface, flat.uv) / total_area
        length = path_length(piece.flat.surface, way.path, config.slit.seams) / work.unit
        gain = (piece.energy - energy) / max(length, least)
        if gain > most:
            slit = Slit(piece.flat.surface.vertices[way.path[::-1]])
            longer = piece.slit_length + length
            best = replace(piece, flat=flat, energy=energy, slit_length=longer, slits=(*piece.slits, slit))
            most = gain
    return best


class Growing:
    """Seams grown on a surface, or in a part of one of total_area."""

    def __init__(self, surface: Surface, total_area: float, config: FinishConfig) -> None:
        self.surface, self.total_area, self.config = surface, total_area, config
        self.growing = config.closing.growing
        self.table = edge_table(surface.faces)
        self.cost = edge_costs(surface, self.table, config.slit.seams)
        self.areas, self.unit = surface.face_areas(), float(np.sqrt(total_area))
        self.curvature = Curvature.of(surface, config.slit.contact.cotangents)

    def state(self, cut: NDArray[np.bool_], rim: NDArray[np.bool_]) -> Grown:
        """What is foretold of a cut."""
        factor = self.curvature.factor(rim)
        energy = float(foretold_energies(self.surface.faces, self.areas, factor).sum()) / self.total_area
        return Grown(cut, rim, energy * self.config.foretold, factor)

    def uncut(self) -> Grown:
        """The surface as it is."""
        rim = np.zeros(len(self.surface.vertices), dtype=bool)
        rim[self.table.edges[~self.table.manifold]] = True
        return self.state(np.zeros(len(self.table.edges), dtype=bool), rim)

    def begun(self) -> Grown:
        """The fewest cuts that make a disk, holes allowed, of the surface; from tip to tip where it is a sphere."""
        surface, table = self.surface, self.table
        rim = np.zeros(len(surface.vertices), dtype=bool)
        rim[table.edges[~table.manifold]] = True
        loops, euler = len(boundary_loops(surface.faces)), euler_characteristic(surface.faces)
        cut = np.zeros(len(table.edges), dtype=bool)
        between = self.from_tip_to_tip() if loops == 0 and euler == 2 else []
        if len(between) > 2:  # one edge alone opens nothing
            cut = path_mask(table, [between])
        elif loops == 0 or 2 - loops != euler:
            cut = disk_cuts(surface, table, self.config.slit.seams)
        rim[table.edges[cut]] = True
        return self.state(cut, rim)

    def from_tip_to_tip(self) -> list[int]:
        """A path between the two vertices where a closed surface is most pointed."""
        tip, last, count = 0, 0, len(self.surface.vertices)
        for _ in range(self.growing.tips):
            rim = np.zeros(count, dtype=bool)
            rim[tip] = True
            tip, last = int(self.curvature.factor(rim).argmin()), tip
        paths = shortest_paths(count, self.table.edges, self.cost, np.array([last]))
        path = trace_back(paths.parent, tip)
        return (
            path if len(path) > 2 else [int(self.table.edges[(self.table.edges == path[0]).any(axis=1)].max()), *path]
        )

    def led_on(self, state: Grown, energy: float) -> Grown:
        """The seams grown until the energy foretold is no more than that, or nothing lowers it."""
        while state.energy > energy:
            best = next(iter(self.ways(state)), None)
            if best is None or best.gain <= self.growing.least:
                return state
            state = best.after
        return state

    def ways(self, state: Grown) -> list[Way]:
        """Slits to a few places, the one of most gain first."""
        points = self.surface.vertices
        from_rim = shortest_paths(len(points), self.table.edges, self.cost, np.flatnonzero(state.rim))
        near = self.growing.near * self.unit
        aside = np.isfinite(from_rim.distance) & (from_rim.distance >= near)
        found = []
        for sign, looks in ((-1.0, self.growing.looks), (1.0, self.growing.looks_stretched)):
            pressure = np.where(aside, sign * state.factor, 0.0)
            for _ in range(looks):
                tip = int(pressure.argmax())
                if pressure[tip] <= 0.0:
                    break
                found.append(self.slit(state, trace_back(from_rim.parent, tip)))
                pressure[np.linalg.norm(points - points[tip], axis=1) < 2.0 * near] = 0.0
        return sorted(found, key=lambda way: -way.gain)

    def slit(self, state: Grown, path: list[int]) -> Way:
        """A slit along a path, and what is foretold of it."""
        rim = state.rim.copy()
        rim[path] = True
        after = self.state(state.cut | path_mask(self.table, [path]), rim)
        length = path_length(self.surface, path, self.config.slit.seams) / self.unit
        return Way((state.energy - after.energy) / max(length, self.growing.shortest), path, after)
