"""An atlas to improve: charts that another tool made of the same surface, as a start of the search and as its bound.

f faces · a part has area 1 · corner_uv (f, 3, 2) in any unit.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.metrics import uv_charts
from ...runtime.geometry.overlap import flipped_triangles
from ...runtime.geometry.rows import grouped
from ...runtime.geometry.topology import edge_table, split_non_manifold_vertices
from ...runtime.geometry.triangles import signed_areas
from ...runtime.mesh import Surface
from ...runtime.process.deadline import Late, never
from ..carry.arcs import with_straight_arcs
from ..carry.carry import carry_piece
from ..carry.layout import nearest_faces
from ..finish.contact import boundary_edges, rim_overlaps
from ..finish.flatten import at_own_area
from ..finish.pieces import Overlapping, measured
from ..finish.slits import Flat
from ..search.labels import connected_pieces, dual_graph
from ..search.search import Search
from .objective import objective, priced, rank, wasted
from .parts import placed
from .slivers import steadied

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import FinishConfig
    from ..finish.pieces import Piece
    from ..search.labels import DualGraph
    from .parts import Part

    Corners = NDArray[np.float64]


class Improved(NamedTuple):
    """What came of a given atlas.   charts, objective, stretch: (before, after)."""

    charts: tuple[int, int]
    objective: tuple[float, float]
    stretch: tuple[float, float]

    def sentence(self) -> str:
        """What a user is told."""
        (before, after), (cost, less), (stretch, left) = self.charts, self.objective, self.stretch
        return (
            f"the atlas to start from, made valid, has {before} charts, mean stretch {stretch:.4f} and objective "
            f"{cost:.4f}; these are {after}, {left:.4f} and {less:.4f}"
        )


def given_charts(parts: list[Part], corner_uv: Corners | None, config: FinishConfig) -> dict[int, Search]:
    """The atlas given to each part by its number, made valid; of a copy on the part that it is a copy of."""
    if corner_uv is None:
        return {}
    found = {}
    for number, part in enumerate(parts):
        first = part if part.copy_of < 0 else parts[part.copy_of]
        own = corner_uv[part.ids]
        if part.mirrored:
            own = own[:, [0, 2, 1]] * np.array([-1.0, 1.0])
        seams = config.slit.seams.moved(first.origin, first.scale)
        found[number] = made_valid(steadied(first.surface, config.sliver), own, priced(config, seams))
    return found


def made_valid(surface: Surface, corner_uv: Corners, config: FinishConfig) -> Search:
    """A given atlas made valid: islands that are stay as they lie, at the size of their surface; others are mended.

    An island that lies over itself loses its flaps or is cut there; one with flipped triangles is laid out anew.
    """
    table = edge_table(surface.faces)
    island, seam = uv_charts(surface.faces, corner_uv, table)
    search = Search(surface, dual_graph(surface, table, config.labels.seams), config)
    faces, old = split_non_manifold_vertices(surface.faces, seam, table)
    opened, uv = Surface(surface.vertices[old], faces), np.zeros((len(old), 2))
    uv[faces.reshape(-1)] = corner_uv.reshape(-1, 2)
    for ids in grouped(island):
        piece, used = opened.part(ids)
        add_island(search, ids, Flat(piece, sized(piece, uv[used]), {}))
    search.place_loose()
    return search


def sized(piece: Surface, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Uv (v, 2) of the piece's own area, turned over where they are mirrored."""
    mirrored = signed_areas(uv[piece.faces]).sum() < 0.0
    return at_own_area(piece, uv * np.array([-1.0, 1.0]) if mirrored else uv)


def add_island(search: Search, ids: NDArray[np.int64], flat: Flat) -> None:
    """Take an island in, made valid."""
    faces = flat.surface.faces
    if not np.isfinite(flat.uv).all() or flipped_triangles(flat.uv[faces]).any():
        search.add_valid(ids)
        return
    piece = measured(search.surface, ids, flat, search.area, prices=search.config.slit.seams)
    overlaps = bool(rim_overlaps(faces, boundary_edges(faces), flat.uv))
    carry_piece(search, ids, piece, [Overlapping(ids, flat, ()) if overlaps else piece])


def as_start(given: Search, surface: Surface, graph: DualGraph) -> NDArray[np.int64]:
    """Connected pieces (f,) of a proxy, numbered 0…, by the given charts that lie nearest."""
    label = np.unique(given.label(), return_inverse=True)[1].reshape(-1)
    return connected_pieces(label[nearest_faces(surface, given.surface, given.config.carry)], graph)


def improved(given: Search, late: Late = never) -> Search:
    """The same charts, each with less distortion, their seams straight where the surface is not too large for it."""
    config, found = given.config, given.twin()
    found.polish()
    few = len(given.surface.faces) <= config.fine.above * config.fine.faces
    return with_straight_arcs(found, config.arcs, late) if few and not late() else found


def best_of_copies(given: dict[int, Search], parts: list[Part], charts: int) -> dict[int, Search]:
    """The best of the atlases given to each part and to its copies, by the part's number."""
    alike: dict[int, list[Search]] = {}
    for at, each in given.items():
        alike.setdefault(at if parts[at].copy_of < 0 else parts[at].copy_of, []).append(each)

    def place(each: Search) -> tuple[bool, bool, float]:
        return rank(list(each.pieces.values()), each.surface, charts, each.config)

    return {number: min(several, key=place) for number, several in alike.items()}


def no_worse(found: list[Piece], given: Search, charts: int, config: FinishConfig, late: Late = never) -> list[Piece]:
    """The pieces found, or the given charts, improved or as they are: what ranks first."""
    ways = [found, list(given.pieces.values())]
    if not late():
        ways.append(list(improved(given, late).pieces.values()))
    return min(ways, key=lambda pieces: rank(pieces, given.surface, charts, config))


def improvement(
    surface: Surface, parts: list[Part], given: dict[int, Search], pieces: list[Piece], config: FinishConfig
) -> Improved:
    """What came of a given atlas: pieces of the whole surface."""
    total = sum(part.scale**2 for part in parts)
    before = [placed(piece, parts[at], surface, total) for at, each in given.items() for piece in each.pieces.values()]
    cost = [objective(surface, each, config.slit.price) + wasted(each, config) for each in (before, pieces)]
    return Improved(
        (len(before), len(pieces)),
        (cost[0], cost[1]),
        (1.0 + sum(piece.energy for piece in before), 1.0 + sum(piece.energy for piece in pieces)),
    )
