"""Cuts that open a connected piece of surface into one disk, along short paths.

A piece is an oriented manifold: vertices (v, 3), faces (f, 3).  Cuts are edge masks (e,) over its edge table.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.cutgraph import ShortestPaths as ShortestPaths
from ...runtime.geometry.cutgraph import closing_paths, edge_costs, path_mask, prune, shortest_paths, trace_back
from ...runtime.geometry.topology import EdgeTable, split_non_manifold_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.cutgraph import SeamPrices
    from ...runtime.mesh import Surface


def disk_cuts(surface: Surface, table: EdgeTable, prices: SeamPrices) -> NDArray[np.bool_]:
    """(e,) bool: edges that, cut open, leave one disk.  None for a disk.

    Tree-cotree: a shortest-path tree from the boundary (all loops as one source), a spanning tree of the dual graph of
    the longest loops; each edge in neither closes one short path between two boundary loops or around a handle.  A
    closed piece without handles is slit between two far points.
    """
    cost = edge_costs(surface, table, prices)
    count = len(surface.vertices)
    sources = np.unique(table.edges[table.edge_count == 1])
    closed = len(sources) == 0
    if closed:
        sources = np.array([0])
    routes = closing_paths(table, cost, shortest_paths(count, table.edges, cost, sources))
    if not routes:
        return path_mask(table, [_far_path(count, table, cost)]) if closed else np.zeros(len(table.edges), dtype=bool)
    return prune(table, path_mask(table, routes)) if closed else path_mask(table, routes)


def _far_path(count: int, table: EdgeTable, cost: NDArray[np.float64]) -> list[int]:
    """A shortest path between two vertices far apart: the farthest from vertex 0, and the farthest from that one.

    Two edges at least, as one alone opens nothing: where all vertices are neighbours, the path goes on to a third.
    """
    first = int(shortest_paths(count, table.edges, cost, np.array([0])).distance.argmax())
    paths = shortest_paths(count, table.edges, cost, np.array([first]))
    path = trace_back(paths.parent, int(paths.distance.argmax()))
    if len(path) > 2:
        return path
    around = table.edges[(table.edges == path[0]).any(axis=1)]
    return [int(np.setdiff1d(around, path)[0]), *path]


def cut_open(
    faces: NDArray[np.int64], cut: NDArray[np.bool_], table: EdgeTable
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Faces (f, 3) over the vertices of the opened piece, and the old vertex (v',) of each."""
    return split_non_manifold_vertices(faces, cut, table)
