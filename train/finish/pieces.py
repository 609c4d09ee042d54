"""One piece of a surface: opened into a disk, flattened, slit; and what that cost.

ids (m,) are faces of the surface.  Areas and lengths are shares of the whole surface: area / A, length / √A.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ...runtime.geometry.cutgraph import PLAIN, counted_length
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.topology import split_non_manifold_vertices
from ...runtime.geometry.triangles import signed_areas
from ...runtime.mesh import Surface
from .arap import unfolded
from .contact import Relaxed, boundary_edges, converge, excess_energy, rim_faces, rim_overlaps, separate
from .curvature import Curvature, border_first
from .flatten import circle_map, fill_holes, slim, sorted_loops
from .openings import openings, slit_along
from .slits import Flat, Slit, foreseen_slits, slit_where_it_pays

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.geometry.cutgraph import SeamPrices

    Start = Callable[[Surface], NDArray[np.float64]]

    from ..config import FinishConfig
    from .config import ContactConfig, SlitConfig


@dataclass(frozen=True, eq=False)
class Piece:
    """A set of faces and its valid flattening.

    ids: (m,) int64.  flat: its faces are in the order of ids.  energy: Σ area · excess over the whole surface's area.
    slit_length: of all cuts inside the piece, in √A, as the objective counts it.
    slits: those made against stretch, in order.
    resort: "xatlas" where all else failed, "projection" where time was out.
    """

    ids: NDArray[np.int64]
    flat: Flat
    energy: float
    slit_length: float
    slits: tuple[Slit, ...] = ()
    resort: str = ""

    @property
    def method(self) -> str:
        """How the piece became valid: "slim", "slit" where cuts inside it helped, or its last resort."""
        return self.resort or ("slit" if self.slit_length > 0.0 else "slim")

    def cost(self, price: float) -> float:
        """What the piece adds to the objective, its border left out."""
        return self.energy + price * self.slit_length

    @cached_property
    def waste(self) -> float:
        """Area between the flattening and its convex hull, in the units of uv squared."""
        uv = self.flat.uv
        points = uv[boundary_edges(self.flat.surface.faces)[:, 0]]
        try:
            hull = float(ConvexHull(points).volume)
        except QhullError:  # all points on a line
            return 0.0
        return max(hull - float(np.abs(signed_areas(uv[self.flat.surface.faces])).sum()), 0.0)

    def rim(self, surface: Surface) -> NDArray[np.int64]:
        """Vertices of the surface that lie on the piece's border or on its slits."""
        faces = self.flat.surface.faces
        on_border = np.zeros(len(self.flat.surface.vertices), dtype=bool)
        on_border[boundary_edges(faces)] = True
        return np.unique(surface.faces[self.ids][on_border[faces]])


@dataclass(frozen=True, eq=False)
class Overlapping:
    """A set of faces whose flattening without flips lies over itself.

    ids: (m,) int64.  flat: its faces are in the order of ids.  slits: in it, as of a piece.
    """

    ids: NDArray[np.int64]
    flat: Flat
    slits: tuple[Slit, ...]

    def pairs(self) -> NDArray[np.int64]:
        """(p, 2) rows of faces along the border that overlap."""
        faces = self.flat.surface.faces
        rim = rim_faces(faces, boundary_edges(faces))
        return rim[overlapping_pairs(self.flat.uv[faces[rim]])]


def extract(surface: Surface, ids: NDArray[np.int64]) -> Surface:
    """The faces as an oriented manifold of their own."""
    faces, old = split_non_manifold_vertices(surface.faces[ids])
    return Surface(surface.vertices[old], faces)


def border_length(piece: Surface, prices: SeamPrices = PLAIN) -> float:
    """Length of all boundary edges, in source units, as the objective counts it at these prices."""
    return counted_length(piece.vertices[boundary_edges(piece.faces)], prices)


def flattened(
    piece: Surface, config: ContactConfig, goal: float, given: Start | None = None, curvature: Curvature | None = None
) -> NDArray[np.float64] | None:
    """The uv (v, 2) of a disk, holes allowed, after SLIM: without flips; it may overlap.

    None where that can't be had, or where ``goal`` (excess energy, source units squared) is out of sight.  Holes are
    filled while SLIM runs, so that they stay open.  SLIM starts from the border laid out with its own lengths, which
    is close to where it ends, or where that folds over, from the circle.
    """
    outer, *holes = sorted_loops(piece)
    filled = fill_holes(piece, holes)
    start = flipless_start(filled, outer, config, given, curvature)
    if start is None:
        return None
    uv = converge(filled, Relaxed(start, {}), goal, config)
    if uv is None or not np.isfinite(uv).all():
        return None
    return uv[: len(piece.vertices)]


def flipless_start(
    disk: Surface,
    loop: NDArray[np.int64],
    config: ContactConfig,
    given: Start | None = None,
    curvature: Curvature | None = None,
) -> NDArray[np.float64] | None:
    """A first uv (v, 2) of a disk without flips: near its isometry, else on the circle; None where both have flips.

    ``given`` is tried before the border laid out with its own lengths.  ``curvature``: of the disk, where it is known;
    that of another surface plays no part.
    """
    known = curvature if curvature is not None and curvature.surface is disk else None
    laid_out = [lambda disk: border_first(disk, loop, config.cotangents, known)]
    for start in laid_out if given is None else [given, *laid_out]:
        uv = start(disk)
        if not np.isfinite(uv).all():
            continue
        near = unfolded(disk, uv, config.unfolding) if flipped_triangles(uv[disk.faces]).any() else uv
        if near is not None:
            return near
    uv = circle_map(disk, loop)
    return uv if np.isfinite(uv).all() and not flipped_triangles(uv[disk.faces]).any() else None


def make_piece(
    surface: Surface,
    ids: NDArray[np.int64],
    total_area: float,
    config: FinishConfig,
    slits: tuple[Slit, ...] = (),
    goal: float = np.inf,
) -> Piece | None:
    """The best flattening of the faces, with the slits given, those that curvature asks for, and where topology does.

    None where all overlap, or cost more than ``goal`` (excess energy over the whole area).
    """
    found = try_piece(surface, ids, total_area, config, slits, goal)
    return found if isinstance(found, Piece) else None


def try_piece(
    surface: Surface,
    ids: NDArray[np.int64],
    total_area: float,
    config: FinishConfig,
    slits: tuple[Slit, ...] = (),
    goal: float = np.inf,
    start: Start | None = None,
) -> Piece | Overlapping | None:
    """As ``make_piece``; where every flattening overlaps, the first of them.

    ``start``: a first uv of the opened piece, which then gets no slits but those given.
    """
    whole = extract(surface, ids)
    price = config.slit.price
    best: Piece | Overlapping | None = None
    for disk, cuts in openings(slit_along(whole, slits, config.slit), config.slit.seams):
        more, curvature = cuts, None
        if start is None:
            curvature = Curvature.of(disk, config.slit.contact.cotangents)
            disk, foreseen = foreseen_slits(curvature, total_area, config.slit)
            more = (*cuts, *foreseen)
        uv = flattened(disk, config.slit.contact, goal * total_area, start, curvature)
        if uv is None:
            continue
        energy = excess_energy(disk, uv) / total_area
        if energy * total_area > config.hopeless * float(disk.face_areas().sum()):
            continue
        edges = boundary_edges(disk.faces)
        if rim_overlaps(disk.faces, edges, uv):
            apart = separate(disk, Relaxed(uv, {}), edges, config.slit.contact) if start is not None else None
            if apart is None:
                best = best or Overlapping(ids, Flat(disk, uv, {}), (*slits, *more))
                continue
            uv = apart.uv
        piece = measured(surface, ids, Flat(disk, uv, {}), total_area, (*slits, *more), config.slit.seams)
        if not isinstance(best, Piece) or piece.cost(price) < best.cost(price):
            best = piece
    return best


def measured(
    surface: Surface,
    ids: NDArray[np.int64],
    flat: Flat,
    total_area: float,
    slits: tuple[Slit, ...] = (),
    prices: SeamPrices = PLAIN,
) -> Piece:
    """A flattening of faces of the surface as a piece, with its energy and the counted length of the cuts in it."""
    cuts = (border_length(flat.surface, prices) - border_length(extract(surface, ids), prices)) / 2.0
    energy = excess_energy(flat.surface, flat.uv) / total_area
    return Piece(ids, flat, energy, cuts / float(np.sqrt(total_area)), slits)


def slit_further(piece: Piece, total_area: float, config: SlitConfig, *, contacts: bool = False) -> Piece:
    """The piece with the slits that pay.  ``contacts``: those that overlap are held apart (slow), else left out."""
    if not contacts:
        config = replace(config, contact=replace(config.contact, rounds=0))
    before = border_length(piece.flat.surface, config.seams)
    flat, slits = slit_where_it_pays(piece.flat, total_area, config)
    length = piece.slit_length + (border_length(flat.surface, config.seams) - before) / 2.0 / float(np.sqrt(total_area))
    energy = excess_energy(flat.surface, flat.uv) / total_area
    return Piece(piece.ids, flat, energy, length, (*piece.slits, *slits))


def polished(piece: Piece, total_area: float, config: ContactConfig) -> Piece:
    """The piece after more SLIM, where that leaves it valid and lowers its energy; holes stay as they are."""
    surface = piece.flat.surface
    holes = sorted_loops(surface)[1:]
    if holes or piece.energy <= 0.0 or len(surface.faces) > config.polished_faces:
        return piece
    uv = slim(surface, piece.flat.uv, config.polish)
    energy = excess_energy(surface, uv) / total_area if np.isfinite(uv).all() else np.inf
    if energy >= piece.energy or rim_overlaps(surface.faces, boundary_edges(surface.faces), uv):
        return piece
    return replace(piece, flat=Flat(surface, uv, {}), energy=energy)
