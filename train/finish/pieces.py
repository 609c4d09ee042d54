"""One piece of a surface: opened into a disk, flattened, relieved; and what that cost.

ids (m,) are faces of the surface.  Areas and lengths are shares of the whole surface: area / A, length / √A.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic, split_non_manifold_vertices
from ...runtime.mesh import Surface
from .contact import Relaxed, boundary_edges, converge, excess_energy, rim_overlaps
from .disks import cut_open, disk_cuts
from .flatten import circle_map, fill_holes, slim, sorted_loops
from .relief import Flat, Slit, relieve, slit_along

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..config import ContactConfig, FinishConfig, ReliefConfig


@dataclass(frozen=True, eq=False)
class Piece:
    """A set of faces and its valid flattening.

    ids: (m,) int64.  flat: its faces are in the order of ids.  energy: Σ area · excess over the whole surface's area.
    slits: length of the cuts inside the piece, in √A.  relief: those made for relief, in order.
    resort: "xatlas" where all else failed.
    """

    ids: NDArray[np.int64]
    flat: Flat
    energy: float
    slits: float
    relief: tuple[Slit, ...] = ()
    resort: str = ""

    @property
    def method(self) -> str:
        """How the piece became valid: "slim", "slit" where cuts inside it helped, or its last resort."""
        return self.resort or ("slit" if self.slits > 0.0 else "slim")

    def cost(self, price: float) -> float:
        """What the piece adds to the objective, its border left out."""
        return self.energy + price * self.slits


def extract(surface: Surface, ids: NDArray[np.int64]) -> Surface:
    """The faces as an oriented manifold of their own."""
    faces, old = split_non_manifold_vertices(surface.faces[ids])
    return Surface(surface.vertices[old], faces)


def border_length(piece: Surface) -> float:
    """Length of all boundary edges, in source units."""
    edges = boundary_edges(piece.faces)
    return float(np.linalg.norm(piece.vertices[edges[:, 1]] - piece.vertices[edges[:, 0]], axis=1).sum())


def openings(piece: Surface, crease_discount: float) -> Iterator[Surface]:
    """The ways to see a piece as a disk: with its holes filled where it has no handles, and cut along short paths."""
    loops = len(boundary_loops(piece.faces))
    genus = 2 - loops - euler_characteristic(piece.faces)
    if genus == 0 and loops > 0:
        yield piece
    if genus != 0 or loops != 1:
        table = edge_table(piece.faces)
        faces, old = cut_open(piece.faces, disk_cuts(piece, table, crease_discount), table)
        yield Surface(piece.vertices[old], faces)


def flattened(piece: Surface, config: ContactConfig, goal: float) -> NDArray[np.float64] | None:
    """The uv (v, 2) of a disk, holes allowed, after SLIM: without flips and overlap.

    None where that can't be had, or where ``goal`` (excess energy, source units squared) is out of sight.  Holes are
    filled while SLIM runs, so that they stay open.  The circle map is valid and SLIM leaves it step by step, so where
    the end overlaps, early states are tried.
    """
    outer, *holes = sorted_loops(piece)
    filled = fill_holes(piece, holes)
    start = circle_map(filled, outer)
    edges = boundary_edges(piece.faces)
    free = converge(filled, Relaxed(start, {}), goal, config)
    if free is None:
        return None
    for attempt in (lambda: free, lambda: slim(filled, start, 3), lambda: slim(filled, start, 1)):
        uv = attempt()[: len(piece.vertices)]
        if np.isfinite(uv).all() and not rim_overlaps(piece.faces, edges, uv):
            return uv
    return None


def make_piece(
    surface: Surface,
    ids: NDArray[np.int64],
    total_area: float,
    config: FinishConfig,
    slits: tuple[Slit, ...] = (),
    goal: float = np.inf,
) -> Piece | None:
    """The best plain flattening of the faces, with the slits given and where topology asks for it.

    None where all overlap, or cost more than ``goal`` (excess energy over the whole area).
    """
    whole = extract(surface, ids)
    unit, best = float(np.sqrt(total_area)), None
    for plain in openings(whole, config.relief.crease_discount):
        disk = slit_along(plain, slits, config.relief)
        uv = flattened(disk, config.relief.contact, goal * total_area)
        if uv is None:
            continue
        flat = Flat(disk, uv, {})
        length = (border_length(disk) - border_length(whole)) / 2.0 / unit
        energy = excess_energy(disk, uv) / total_area
        piece = Piece(ids, flat, energy, length, slits)
        if best is None or piece.cost(config.relief.price) < best.cost(config.relief.price):
            best = piece
    return best


def relieved(piece: Piece, total_area: float, config: ReliefConfig) -> Piece:
    """The piece with the slits that pay."""
    before = border_length(piece.flat.surface)
    flat, slits = relieve(piece.flat, total_area, config)
    length = piece.slits + (border_length(flat.surface) - before) / 2.0 / float(np.sqrt(total_area))
    energy = excess_energy(flat.surface, flat.uv) / total_area
    return Piece(piece.ids, flat, energy, length, (*piece.relief, *slits))
