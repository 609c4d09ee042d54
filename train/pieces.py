"""One piece of a surface: opened into a disk, flattened, relieved; and what that cost.

ids (m,) are faces of the surface.  Areas and lengths are shares of the whole surface: area / A, length / √A.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..runtime.mesh import Surface
from ..runtime.topology import boundary_loops, edge_table, euler_characteristic, split_non_manifold_vertices
from .contact import boundary_edges, rim_overlaps
from .disks import cut_open, disk_cuts
from .flatten import circle_map, fill_holes, slim, sorted_loops
from .relief import Flat, excess, relieve

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from .config import FinishConfig, ReliefConfig


@dataclass(frozen=True, eq=False)
class Piece:
    """A set of faces and its valid flattening.

    ids: (m,) int64.  flat: its faces are in the order of ids.  energy: Σ area · excess over the area of the whole surface.
    slits: length of the cuts inside the piece, in √A.  relieved: slits were tried.
    """

    ids: NDArray[np.int64]
    flat: Flat
    energy: float
    slits: float
    relieved: bool = False

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


def flattened(piece: Surface, iterations: int) -> NDArray[np.float64] | None:
    """uv (v, 2) of a disk, holes allowed, after SLIM: without flips and overlap, or None.

    Holes are filled while SLIM runs, so that they stay open.  The circle map is valid and SLIM leaves it step by step, so
    where the end overlaps, earlier states are tried.
    """
    outer, *holes = sorted_loops(piece)
    filled = fill_holes(piece, holes)
    start = circle_map(filled, outer)
    edges = boundary_edges(piece.faces)
    for count in (iterations, iterations // 4, 1):
        uv = slim(filled, start, count)[: len(piece.vertices)]
        if not rim_overlaps(piece.faces, edges, uv):
            return uv
    return None


def make_piece(
    surface: Surface, ids: NDArray[np.int64], total_area: float, config: FinishConfig
) -> Piece | None:
    """The best plain flattening of the faces, no slits but those that topology asks for; None where all overlap."""
    whole = extract(surface, ids)
    unit, best = float(np.sqrt(total_area)), None
    for disk in openings(whole, config.relief.crease_discount):
        uv = flattened(disk, config.trial_iterations)
        if uv is None:
            continue
        flat = Flat(disk, uv, {})
        slits = (border_length(disk) - border_length(whole)) / 2.0 / unit
        energy = float(disk.face_areas() @ excess(flat)) / total_area
        piece = Piece(ids, flat, energy, slits)
        if best is None or piece.cost(config.relief.price) < best.cost(config.relief.price):
            best = piece
    return best


def relieved(piece: Piece, total_area: float, config: ReliefConfig) -> Piece:
    """The piece with the slits that pay."""
    before = border_length(piece.flat.surface)
    flat = relieve(piece.flat, total_area, config)
    slits = piece.slits + (border_length(flat.surface) - before) / 2.0 / float(np.sqrt(total_area))
    energy = float(flat.surface.face_areas() @ excess(flat)) / total_area
    return Piece(piece.ids, flat, energy, slits, relieved=True)


def polished(piece: Piece, total_area: float, config: FinishConfig) -> Piece:
    """The piece after more SLIM, as long as that pays."""
    flat, energy = piece.flat, piece.energy
    areas = flat.surface.face_areas()
    for _ in range(config.polish_rounds):
        trial = flat.relaxed(config.polish_iterations, config.relief.contact)
        lowered = float(areas @ excess(trial)) / total_area
        if lowered >= energy:
            break
        enough = energy - lowered < config.polish_gain * energy
        flat, energy = trial, lowered
        if enough:
            break
    return replace(piece, flat=flat, energy=energy)
