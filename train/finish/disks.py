"""Cuts that open a connected piece of surface into one disk, along short paths.

A piece is an oriented manifold: vertices (v, 3), faces (f, 3).  Cuts are edge masks (e,) over its edge table.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ...runtime.geometry.topology import EdgeTable, edge_table, split_non_manifold_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface


class ShortestPaths(NamedTuple):
    """Distances (v,) and the tree from a set of sources: parent (v,), −1 at sources and where nothing leads."""

    distance: NDArray[np.float64]
    parent: NDArray[np.int64]


def edge_costs(surface: Surface, table: EdgeTable, crease_discount: float) -> NDArray[np.float64]:
    """(e,) length of each edge, down to (1 − crease_discount) of it along sharp creases: cuts hide there."""
    ends = surface.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    normals = surface.face_normals()
    cosine = np.einsum("ec,ec->e", normals[table.edge_faces[:, 0]], normals[table.edge_faces[:, 1]])
    sharpness = np.where(table.manifold, np.clip((1.0 - cosine) / 0.5, 0.0, 1.0), 0.0)
    return np.maximum(length * (1.0 - crease_discount * sharpness), 1e-12)


def shortest_paths(
    count: int, edges: NDArray[np.int64], cost: NDArray[np.float64], sources: NDArray[np.int64]
) -> ShortestPaths:
    """Dijkstra along edges (e, 2) with positive costs (e,) from the nearest of ``sources``, over ``count`` vertices."""
    graph = sparse.csr_array((cost, (edges[:, 0], edges[:, 1])), shape=(count, count))
    distance, parent, _ = dijkstra(graph, directed=False, indices=sources, min_only=True, return_predecessors=True)
    return ShortestPaths(distance, np.where(parent < 0, -1, parent).astype(np.int64))


def trace_back(parent: NDArray[np.int64], vertex: int) -> list[int]:
    """The path from ``vertex`` to its source, both ends included."""
    path = [vertex]
    while parent[path[-1]] >= 0:
        path.append(int(parent[path[-1]]))
    return path


def path_mask(table: EdgeTable, paths: list[list[int]]) -> NDArray[np.bool_]:
    """(e,) bool: edges on any of the vertex paths."""
    span = int(table.edges.max(initial=0)) + 1
    key = table.edges[:, 0] * span + table.edges[:, 1]
    steps = [sorted(pair) for path in paths for pair in pairwise(path)]
    wanted = np.array([a * span + b for a, b in steps], dtype=np.int64)
    return np.isin(key, wanted) & table.manifold


def disk_cuts(surface: Surface, table: EdgeTable, crease_discount: float) -> NDArray[np.bool_]:
    """(e,) bool: edges that, cut open, leave one disk.  None for a disk.

    Tree-cotree (Eppstein 2003; Erickson & Whittlesey 2005): a shortest-path tree from the boundary (all loops as one
    source), a maximum spanning tree of the dual graph over the other edges; each edge in neither closes one short path
    between two boundary loops or around a handle.  A closed piece without handles is slit between two far points.
    """
    cost = edge_costs(surface, table, crease_discount)
    count = len(surface.vertices)
    sources = np.unique(table.edges[table.edge_count == 1])
    closed = len(sources) == 0
    if closed:
        sources = np.array([0])
    paths = shortest_paths(count, table.edges, cost, sources)
    generators = _leftover_edges(table, cost, paths)
    if len(generators) == 0:
        return path_mask(table, [_far_path(count, table, cost)]) if closed else np.zeros(len(table.edges), dtype=bool)
    routes = [
        [*trace_back(paths.parent, a)[::-1], *trace_back(paths.parent, b)] for a, b in table.edges[generators].tolist()
    ]
    return prune(table, path_mask(table, routes)) if closed else path_mask(table, routes)


def _leftover_edges(table: EdgeTable, cost: NDArray[np.float64], paths: ShortestPaths) -> NDArray[np.int64]:
    """Indices of the manifold edges in neither the path tree nor the maximum spanning cotree."""
    a, b = table.edges.T
    in_tree = (paths.parent[a] == b) | (paths.parent[b] == a)
    candidates = np.flatnonzero(table.manifold & ~in_tree)
    loop = paths.distance[a[candidates]] + paths.distance[b[candidates]] + cost[candidates]
    i, j = table.edge_faces[candidates].T
    faces = int(table.edge_faces.max()) + 1
    # longest loops first into the cotree, so that the short ones are left; parallel dual edges: keep the longest
    order = np.lexsort((-loop, np.maximum(i, j), np.minimum(i, j)))
    low, high = np.minimum(i, j)[order], np.maximum(i, j)[order]
    first = np.ones(len(order), dtype=bool)
    first[1:] = (low[1:] != low[:-1]) | (high[1:] != high[:-1])
    kept = order[first]
    weight = loop.max(initial=0.0) + 1.0 - loop[kept]
    dual = sparse.csr_array((weight, (i[kept], j[kept])), shape=(faces, faces))
    tree = minimum_spanning_tree(dual).tocoo()
    row, column = tree.row.astype(np.int64), tree.col.astype(np.int64)  # scipy's int32 can't hold faces² from 46,341 on
    chosen = np.isin(i * faces + j, np.concatenate([row * faces + column, column * faces + row]))
    unique = np.zeros(len(candidates), dtype=bool)
    unique[kept] = True
    return candidates[~(chosen & unique)]


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


def prune(table: EdgeTable, cut: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The cut without its dead ends: on a closed surface a path that ends inside opens nothing."""
    cut = cut.copy()
    count = int(table.edges.max(initial=0)) + 1
    while True:
        degree = np.bincount(table.edges[cut].reshape(-1), minlength=count)
        dead = cut & (degree[table.edges] == 1).any(axis=1)
        if not dead.any():
            return cut
        cut &= ~dead


def cut_open(
    faces: NDArray[np.int64], cut: NDArray[np.bool_], table: EdgeTable
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Faces (f, 3) over the vertices of the opened piece, and the old vertex (v',) of each."""
    return split_non_manifold_vertices(faces, cut, table)


def is_disk(faces: NDArray[np.int64]) -> bool:
    """True for V − E + F = 1: with one component and a manifold, a disk."""
    table = edge_table(faces)
    return len(np.unique(faces)) - len(table.edges) + len(faces) == 1
