"""Cut graphs: shortest paths along the edges of a surface, and the edges that close a loop around each handle.

v vertices · e edges of an edge table · f faces.  Paths are lists of vertices; masks are (e,) bool.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra, minimum_spanning_tree

from ..kernel.choice import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Surface
    from .places import Places
    from .topology import EdgeTable


@dataclass(frozen=True)
class SeamPrices:
    """What a seam costs per length of the edge that it follows: 1 where nothing speaks for or against it."""

    crease_discount: float = 0.8
    """How much cheaper it is along a sharp crease, in [0, 1)."""
    flat: float = 5e-9
    """1 − cos of the dihedral deviation below which an edge lies inside a flat face: about 1e-4 radians."""
    flat_price: float = 8.0
    """What it costs through a flat face: a crease nearby is cheaper."""
    places: Places | None = None
    """What it costs by place, in the frame of the surface; None: everywhere alike."""
    counted: bool = False
    """Whether creases make a border cheaper in the objective too, so that charts are merged and split for them; places
    always do."""

    def moved(self, origin: NDArray[np.float64], scale: float) -> SeamPrices:
        """The same for a surface whose points are (xyz − origin) / scale."""
        return self if self.places is None else replace(self, places=self.places.moved(origin, scale))


PLAIN = SeamPrices()
"""The same everywhere, but for creases."""


class ShortestPaths(NamedTuple):
    """Distances (v,) and the tree from a set of sources: parent (v,), −1 at sources and where nothing leads."""

    distance: NDArray[np.float64]
    parent: NDArray[np.int64]


def crease_sharpness(surface: Surface, table: EdgeTable) -> NDArray[np.float64]:
    """(e,) how sharp the crease along each edge is: (1 − cos of the dihedral deviation) / ½, at most 1.

    0 on flat ground, 1 from 60° on; 0 where an edge is not manifold, or two faces disagree in orientation.
    """
    normals = surface.face_normals()
    cosine = np.einsum("ec,ec->e", normals[table.edge_faces[:, 0]], normals[table.edge_faces[:, 1]])
    return np.where(table.manifold, np.clip((1.0 - cosine) / 0.5, 0.0, 1.0), 0.0)


def seam_prices(surface: Surface, table: EdgeTable, prices: SeamPrices) -> NDArray[np.float64]:
    """(e,) price per length of a cut along each edge: 1, down to 1 − crease_discount in creases, more in flat faces."""
    sharpness = crease_sharpness(surface, table)
    flat = table.manifold & (sharpness * 0.5 < prices.flat)
    price = np.where(flat, prices.flat_price, 1.0 - prices.crease_discount * sharpness)
    return price * place_prices(surface, table, prices)


def place_prices(surface: Surface, table: EdgeTable, prices: SeamPrices) -> NDArray[np.float64]:
    """(e,) price per length of a cut along each edge for where it lies."""
    if prices.places is None:
        return np.ones(len(table.edges))
    return prices.places.at(surface.vertices[table.edges].mean(axis=1))


def counted_lengths(segments: NDArray[np.float64], prices: SeamPrices) -> NDArray[np.float64]:
    """(n,) lengths of segments (n, 2, 3) as the objective counts seams: times what they cost for where they lie."""
    length = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
    return length if prices.places is None else length * prices.places.at(segments.mean(axis=1))


def counted_length(segments: NDArray[np.float64], prices: SeamPrices) -> float:
    """The sum of `counted_lengths`."""
    return float(counted_lengths(segments, prices).sum())


def counted_prices(surface: Surface, table: EdgeTable, prices: SeamPrices) -> NDArray[np.float64]:
    """(e,) what a border counts in the objective, per length of each edge: 1, but for places and counted creases."""
    price = place_prices(surface, table, prices)
    return price * (1.0 - prices.crease_discount * crease_sharpness(surface, table)) if prices.counted else price


def edge_costs(surface: Surface, table: EdgeTable, prices: SeamPrices) -> NDArray[np.float64]:
    """(e,) what a cut along each edge costs: its length times its price."""
    ends = surface.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    return np.maximum(length * seam_prices(surface, table, prices), 1e-12)


def shortest_paths(
    count: int, edges: NDArray[np.int64], cost: NDArray[np.float64], sources: NDArray[np.int64]
) -> ShortestPaths:
    """Dijkstra along edges (e, 2) with positive costs (e,) from the nearest of ``sources``, over ``count`` vertices."""
    if compiled := kernel():
        return ShortestPaths(*compiled.shortest_paths(count, edges, cost, sources))
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


def closing_edges(table: EdgeTable, cost: NDArray[np.float64], paths: ShortestPaths) -> NDArray[np.int64]:
    """Edges (g,) that each close one short loop around a handle, or way between two borders (tree-cotree).

    They are in neither the tree of shortest paths nor the spanning tree of the dual graph of the longest such loops
    (Eppstein 2003; Erickson & Whittlesey 2005).  Each edge's rank is its weight in that graph, so the spanning tree's
    weights name its edges.

    Args:
        table: of one connected oriented manifold.
        cost: (e,) float64, positive.
        paths: the shortest paths by that cost.
    """
    a, b = table.edges.T
    in_tree = (paths.parent[a] == b) | (paths.parent[b] == a)
    free = np.flatnonzero(table.manifold & ~in_tree)
    loop = paths.distance[a] + paths.distance[b] + cost
    ranked = free[np.argsort(-loop[free], kind="stable")]
    ends = np.sort(table.edge_faces[ranked], axis=1)
    faces = int(table.edge_faces.max()) + 1
    longest = np.unique(ends[:, 0] * faces + ends[:, 1], return_index=True)[1]
    weight = (longest + 1.0, (ends[longest, 0], ends[longest, 1]))
    tree = minimum_spanning_tree(sparse.csr_array(weight, shape=(faces, faces)))
    return np.setdiff1d(free, ranked[tree.data.astype(np.int64) - 1])


def closing_paths(table: EdgeTable, cost: NDArray[np.float64], paths: ShortestPaths) -> list[list[int]]:
    """The shortest path through each of the `closing_edges`, from source to source; arguments as there."""
    ends = table.edges[closing_edges(table, cost, paths)].tolist()
    return [[*trace_back(paths.parent, a)[::-1], *trace_back(paths.parent, b)] for a, b in ends]


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


def cut_chains(table: EdgeTable, cut: NDArray[np.bool_]) -> list[list[int]]:
    """The cut edges as vertex paths between its junctions, ends and the border: each begins where it can be cut from.

    That is the border, or a path before it; a path back to its own beginning comes in two halves.
    """
    around: dict[int, list[int]] = {}
    for a, b in table.edges[cut].tolist():
        around.setdefault(a, []).append(b)
        around.setdefault(b, []).append(a)
    border = set(np.unique(table.edges[table.edge_count == 1]).tolist())
    nodes = {vertex for vertex, others in around.items() if len(others) != 2 or vertex in border}
    begin = sorted(nodes & border) or sorted(nodes) or sorted(around)
    queue, seen, chains = list(begin) if nodes & border else begin[:1], set[tuple[int, int]](), list[list[int]]()
    while queue:
        first = queue.pop(0)
        for second in around[first]:
            if (first, second) in seen:
                continue
            path = [first, second]
            while path[-1] not in nodes and path[-1] != first:
                path.append(next(vertex for vertex in around[path[-1]] if vertex != path[-2]))
            seen |= {(path[0], path[1]), (path[-1], path[-2])}
            half = len(path) // 2
            chains += [path] if path[0] != path[-1] else [path[: half + 1], path[half:]]
            if path[-1] not in queue:
                queue.append(path[-1])
    return chains
