"""Charts that set the scale of the page, cut where that is cheap: a long strip, or arms that branch.

A chart of length L and width W needs a page of side L, or (L + W)/√2 along its diagonal, whatever else lies on it; two
of half the length need about half of that.  A cut pays where what it saves of the page is worth more than its seam.
Cuts run straight across the plane, and from there to where edges are shortest.   m faces of a chart.
"""

from __future__ import annotations

from heapq import heappop, heappush
from itertools import count
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.topology import edge_table
from ..carry.arcs import straight_pieces
from ..carry.carry import WALL
from ..finish.contact import boundary_edges
from ..finish.flaps import restricted
from ..finish.pieces import Piece, measured
from ..search.labels import DualGraph, connected_pieces, dual_graph, smooth_labels
from .develop import least_rectangle

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig, ShortenConfig

    Corners = NDArray[np.float64]


class Page(NamedTuple):
    """What a part's charts are laid on.

    side: √(area of all that is unwrapped), in the part's units.  most: charts that the part may have.
    polygon: (f,) faces of one number are cut nowhere between them; None where the file had triangles alone.
    """

    side: float
    most: int
    polygon: NDArray[np.int64] | None = None


class Cut(NamedTuple):
    """A chart in two or more: part (m,) of each face, numbered 0…; gain: what that lowers the objective by."""

    part: NDArray[np.int64]
    gain: float


def shortened(surface: Surface, pieces: list[Piece], page: Page, config: FinishConfig) -> list[Piece]:
    """The charts of a part of area 1, those too long for the page cut, where that pays and there may be more."""
    waiting, done, number = list[tuple[float, int, Piece]](), list[Piece](), count()

    def wait(piece: Piece) -> None:
        heappush(waiting, (-page_side(piece.flat.uv), -next(number), piece))  # the longest first, of equals the last

    for piece in pieces:
        wait(piece)
    while waiting:
        piece = heappop(waiting)[-1]
        room = page.most - len(waiting) - len(done)
        cut = best_cut(piece, page, room, config) if room > 1 else None
        if cut is None:
            done.append(piece)
            continue
        parts = [np.flatnonzero(cut.part == each) for each in range(int(cut.part.max()) + 1)]
        for rows in parts:
            wait(measured(surface, piece.ids[rows], restricted(piece.flat, rows), 1.0, piece.slits, config.slit.seams))
    return straight_pieces(surface, done, config) if len(done) > len(pieces) else done


def page_side(points: Corners) -> float:
    """Side of the least square that holds the box around points (n, 2), straight or along the diagonal."""
    sides = least_rectangle(points)
    return float(min(sides.max(), sides.sum() / np.sqrt(2.0)))


def waste(side: float, page: Page, config: FinishConfig) -> float:
    """What a chart of that page side costs, as objective: nothing where others fill the page beside it."""
    price, full = config.shorten.worth * config.page.price, config.shorten.full
    return price * max(float(np.log(full * (side / page.side) ** 2)), 0.0)


def best_cut(piece: Piece, page: Page, room: int, config: FinishConfig) -> Cut | None:
    """The cut of most gain into at most ``room`` parts, among a few directions and places; None where none pays."""
    before = waste(page_side(piece.flat.uv), page, config)
    if before <= 0.0:
        return None
    flat = piece.flat.surface
    polygon = np.arange(len(flat.faces)) if page.polygon is None else page.polygon[piece.ids]
    exact = piece.energy <= config.shorten.exact
    graph = graph_of(flat, polygon, config.shorten.crease if exact else config.planar.bent, config)
    price, corners = config.slit.price / page.side, piece.flat.uv[flat.faces]
    rim = np.isin(flat.faces, boundary_edges(flat.faces)) @ np.ones(3) > 0.0

    def cut(label: NDArray[np.int64]) -> Cut:
        part = connected_pieces(label, graph)
        across = part[graph.pairs[:, 0]] != part[graph.pairs[:, 1]]
        outer = rim.copy()
        outer[graph.pairs[across].reshape(-1)] = True
        sides = [page_side(corners[outer & (part == each)]) for each in np.unique(part[outer])]
        seam = float(graph.length[across].sum())
        return Cut(part, before - waste(max(sides), page, config) - price * seam)

    places = list(straight_cuts(corners, polygon, config.shorten))
    straight = [cut((place > 0.0).astype(np.int64)) for place in places]
    best = np.argsort([-each.gain for each in straight], kind="stable")[: config.shorten.looks].tolist()
    moved = [cut(_smooth(places[at], graph, config.shorten)) for at in best]
    paying = [
        each
        for each in [*moved, *(straight[at] for at in best)]
        if each.gain > config.shorten.least and 0 < each.part.max() < room
    ]
    return max(paying, key=lambda each: each.gain, default=None)


def graph_of(flat: Surface, polygon: NDArray[np.int64], bent: float, config: FinishConfig) -> DualGraph:
    """The dual graph of a chart (m faces): a cut costs more where the surface is bent less, and all within polygons."""
    graph, normal = dual_graph(flat, edge_table(flat.faces), config.labels.seams), flat.face_normals()
    first, second = graph.pairs.T
    is_smooth = np.einsum("md,md->m", normal[first], normal[second]) > np.cos(bent)
    dear = np.where(is_smooth, config.shorten.smooth, 1.0)
    cost = np.where(polygon[first] == polygon[second], WALL, graph.cost * dear)
    return DualGraph(graph.pairs, graph.length * dear, cost)


def straight_cuts(corners: Corners, polygon: NDArray[np.int64], config: ShortenConfig) -> Iterator[NDArray[np.float64]]:
    """Where each face lies across each of the cuts tried, (m,): 0 on the cut, in shares of the chart's extent.

    corners: (m, 3, 2).  The faces of one polygon lie at one place.
    """
    middle, number = corners.mean(axis=1), np.unique(polygon, return_inverse=True)[1].reshape(-1)
    points = middle - middle.mean(axis=0)
    first = np.linalg.svd(points.T @ points)[0][:, 0]
    for angle in np.pi * np.arange(config.directions) / config.directions:
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        along = corners @ (turn @ first)
        place = (middle @ (turn @ first) - along.min()) / max(float(np.ptp(along)), 1e-300)
        place = (np.bincount(number, place) / np.bincount(number))[number]
        for share in np.arange(1, config.places + 1) / (config.places + 1.0):
            yield place - share


def _smooth(place: NDArray[np.float64], graph: DualGraph, config: ShortenConfig) -> NDArray[np.int64]:
    """The two sides (m,) of a cut, moved to where its edges are cheapest near."""
    second = place > 0.0
    doubt = np.where(np.abs(place) < config.shift, 0.0, WALL)
    return smooth_labels(np.stack([np.where(second, doubt, -1e-9), np.where(second, -1e-9, doubt)], axis=1), graph)
