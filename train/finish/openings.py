"""Opening a piece into a disk: along short paths, or along the cuts that were made on another mesh of the same shape.

A piece is an oriented manifold: vertices (v, 3), faces (f, 3).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.cutgraph import cut_chains
from ...runtime.geometry.topology import boundary_loops, components, edge_table, euler_characteristic
from ...runtime.mesh import Surface
from .disks import cut_open, disk_cuts, edge_costs, path_mask, shortest_paths, trace_back
from .slits import Slit

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ...runtime.geometry.cutgraph import SeamPrices
    from ...runtime.geometry.topology import EdgeTable
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
    for slit in slits:
        table = edge_table(surface.faces)
        path = path_along(surface, table, slit, config)
        if len(path) < 2:
            continue
        faces, old = cut_open(surface.faces, path_mask(table, [path]), table)
        if not slit.through or not components(faces).any():
            surface = Surface(surface.vertices[old], faces)
    return surface


def path_along(surface: Surface, table: EdgeTable, slit: Slit, config: SlitConfig) -> list[int]:
    """The cheapest way between a slit's ends, from the inner one to the border; fewer than two vertices for none."""
    points = surface.vertices
    border = np.unique(table.edges[table.edge_count == 1])
    begin = np.linalg.norm(points - slit.points[0], axis=1)
    end = np.linalg.norm(points - slit.points[-1], axis=1)
    beginnings = border if len(border) else np.arange(len(points))
    if max(begin[beginnings].min(), end.min()) > config.astray * slit.step:
        return []
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
