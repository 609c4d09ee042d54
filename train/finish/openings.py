"""Opening a piece into a disk: along short paths, or along the cuts that were made on another mesh of the same shape.

A piece is an oriented manifold: vertices (v, 3), faces (f, 3).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.cutgraph import cut_chains
from ...runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic, face_components
from ...runtime.mesh import Surface
from .disks import cut_open, disk_cuts, edge_costs, path_mask, shortest_paths, trace_back
from .slits import Slit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ...runtime.geometry.cutgraph import SeamPrices
    from .config import SlitConfig


class Opening(NamedTuple):
    """A piece as a disk, holes allowed, and the cuts that made it one."""

    disk: Surface
    cuts: tuple[Slit, ...]


def openings(piece: Surface, prices: SeamPrices) -> Iterator[Opening]:
    """The ways to see a piece as a disk: with its holes filled where it has no handles, and cut along short paths."""
    loops = len(boundary_loops(piece.faces))
    genus = 2 - loops - euler_characteristic(piece.faces)
    if genus == 0 and loops > 0:
        yield Opening(piece, ())
    if genus != 0 or loops != 1:
        table = edge_table(piece.faces)
        cut = disk_cuts(piece, table, prices)
        faces, old = cut_open(piece.faces, cut, table)
        cuts = tuple(Slit(piece.vertices[chain], through=True) for chain in cut_chains(table, cut))
        yield Opening(Surface(piece.vertices[old], faces), cuts)


def slit_along(surface: Surface, slits: tuple[Slit, ...], config: SlitConfig) -> Surface:
    """The piece with slits made elsewhere: between the vertices nearest to their ends, in their order.

    A slit that lies elsewhere, or would cut the piece in two, is left out.
    """
    if not slits:
        return surface
    table = edge_table(surface.faces)
    work = Slitting(surface, np.zeros(len(surface.vertices), dtype=bool), np.arange(len(surface.vertices)))
    work.border[table.edges[table.edge_count == 1]] = True
    joined = table.manifold.copy()
    for slit in slits:
        path = path_along(work, slit, config)
        if len(path) < 2:
            continue
        left = joined & ~path_mask(table, [work.source[path].tolist()])
        if not slit.through or not face_components(len(surface.faces), table.edge_faces[left]).any():
            work, joined = work.cut(path), left
    return work.surface


class Slitting(NamedTuple):
    """A piece on its way to be slit.  border: (v,) bool, vertices on it.  source: (v,) those of the piece as it was.

    On a fine mesh a slit is short: what does not lie near it is only numbered anew.
    """

    surface: Surface
    border: NDArray[np.bool_]
    source: NDArray[np.int64]

    def around(self, slit: Slit, reach: float) -> NDArray[np.int64]:
        """Faces with a corner in the box around a slit, so far wider on all sides."""
        lowest, highest = slit.points.min(axis=0) - reach, slit.points.max(axis=0) + reach
        points = self.surface.vertices
        return self.touching(((points >= lowest) & (points <= highest)).all(axis=1))

    def touching(self, chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Faces with a corner among the chosen (v,)."""
        faces = self.surface.faces
        return np.flatnonzero(chosen[faces[:, 0]] | chosen[faces[:, 1]] | chosen[faces[:, 2]])

    def cut(self, path: list[int]) -> Slitting:
        """The piece cut along a path of vertices, as ``cut_open`` does it; only faces around the path are looked at."""
        count, on_path = len(self.surface.vertices), np.zeros(len(self.surface.vertices), dtype=bool)
        on_path[path] = True
        rows = self.touching(on_path)
        near = self.surface.faces[rows]
        table = edge_table(near)
        split, old = cut_open(near, path_mask(table, [path]), table)
        whole = on_path[near]  # corners whose fans are all there
        fan = np.arange(len(old)) - np.searchsorted(old, old)  # of each vertex the first, the second, …
        copies = np.ones(count, dtype=np.int64)
        np.maximum.at(copies, old[on_path[old]], fan[on_path[old]] + 1)
        first = np.cumsum(copies) - copies
        faces = first[self.surface.faces]
        faces[rows] += np.where(whole, fan[split], 0)
        source = np.repeat(np.arange(count), copies)
        border, table = self.border[source], edge_table(faces[rows])
        rim = table.edges[table.edge_count == 1]
        border[rim[on_path[source[rim]].any(axis=1)]] = True
        return Slitting(Surface(self.surface.vertices[source], faces), border, self.source[source])


def path_along(work: Slitting, slit: Slit, config: SlitConfig) -> list[int]:
    """The cheapest way between a slit's ends, from the inner one to the border; fewer than two vertices for none."""
    for reach in (config.astray * slit.step, config.reach * slit.step, np.inf):
        rows = work.around(slit, reach)
        near, vertex = work.surface.part(rows)
        border = np.flatnonzero(work.border[vertex])
        # a vertex near enough to an end would be among these
        if (work.border.any() and not len(border)) or is_astray(near, border, slit, config):
            return []
        path = way_along(near, border, slit, config)
        if len(path) > 1:
            return vertex[path].tolist()
    return []


def is_astray(surface: Surface, border: NDArray[np.int64], slit: Slit, config: SlitConfig) -> bool:
    """Whether an end of a slit is far from all vertices that it could be at."""
    points = surface.vertices
    beginnings = points[border] if len(border) else points
    ends = (beginnings, slit.points[0]), (points, slit.points[-1])
    return any(
        not len(near) or np.linalg.norm(near - end, axis=1).min() > config.astray * slit.step for near, end in ends
    )


def way_along(surface: Surface, border: NDArray[np.int64], slit: Slit, config: SlitConfig) -> list[int]:
    """The same among the faces near a slit; border: those of their vertices that lie on the piece's."""
    points, table = surface.vertices, edge_table(surface.faces)
    begin = np.linalg.norm(points - slit.points[0], axis=1)
    end = np.linalg.norm(points - slit.points[-1], axis=1)
    beginnings = border if len(border) else np.arange(len(points))
    # where an earlier slit passes, both of its sides are as near: the cheaper way starts on the right one
    sources = beginnings[begin[beginnings] <= begin[beginnings].min()]
    cost = edge_costs(surface, table, config.seams) * detour(points[table.edges], slit)
    if not slit.through or not len(border):
        path = trace_back(shortest_paths(len(points), table.edges, cost, sources).parent, int(end.argmin()))
        # the border itself is no way to cut along: the path leaves it where it last touches it
        on_border = np.flatnonzero(np.isin(path, border))
        return path[: int(on_border[0]) + 1] if len(on_border) else path
    # through the inside: no edge along the border, no border vertex between the ends
    targets = np.setdiff1d(np.flatnonzero(end <= end.min()), sources)
    outer = np.isin(table.edges, border)
    ending = np.isin(table.edges, np.concatenate([sources, targets]))
    inside = ~outer.all(axis=1) & (~outer | ending).all(axis=1)
    paths = shortest_paths(len(points), table.edges[inside], cost[inside], sources)
    if not np.isfinite(paths.distance[targets]).any():
        return []
    return trace_back(paths.parent, int(targets[paths.distance[targets].argmin()]))


def detour(edges: NDArray[np.float64], slit: Slit) -> NDArray[np.float64]:
    """(e,) ≥ 1: how much dearer edges (e, 2, 3) are the farther they lie from a slit, in steps of its own points."""
    step = slit.step
    if step <= 0.0:
        return np.ones(len(edges))
    t = np.linspace(0.0, 1.0, 4, endpoint=False)[None, :, None]
    along = (slit.points[:-1, None] * (1.0 - t) + slit.points[1:, None] * t).reshape(-1, 3)
    distance = KDTree(np.concatenate([along, slit.points[-1:]])).query(edges.mean(axis=1))[0]
    return 1.0 + (distance / step) ** 2
