"""The edges along which a search's pieces are cut or lie apart, as chains between junctions.

e edges of the surface's table.  A chain is a path of vertices; its edges are rows of the table.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.topology import EdgeTable
    from ..search.state import State


class Chain(NamedTuple):
    """Seam edges in a row.

    path: (n + 1,) vertices.  edges: (n,) rows of the table.  reach: (n + 1,) length up to each vertex, in √A.
    sides: keys of the pieces beside it, one where it lies inside a piece.  loose: it ends inside a piece, where it can
    be closed from.  free: it begins inside a piece as well.
    """

    path: NDArray[np.int64]
    edges: NDArray[np.int64]
    reach: NDArray[np.float64]
    sides: tuple[int, ...]
    loose: bool
    free: bool = False


def seam_edges(state: State) -> NDArray[np.bool_]:
    """(e,) bool: manifold edges whose two faces do not share both corners in a flattening."""
    table = state.table
    corner = np.zeros((len(state.surface.faces), 3), dtype=np.int64)
    count = 0
    for piece in state.pieces.values():
        corner[piece.ids] = piece.flat.surface.faces + count
        count += len(piece.flat.surface.vertices)
    first, second = table.edge_halfedges.T
    flat = corner.reshape(-1)
    ahead = np.roll(corner, -1, axis=1).reshape(-1)
    return table.manifold & ((flat[first] != ahead[second]) | (ahead[first] != flat[second]))


def chains(state: State, seam: NDArray[np.bool_]) -> list[Chain]:
    """All chains of a seam mask (e,): from junction, end or border to the next, and closed ones."""
    table, label = state.table, state.label()
    around: dict[int, list[int]] = {}
    for edge in np.flatnonzero(seam).tolist():
        for vertex in table.edges[edge].tolist():
            around.setdefault(vertex, []).append(edge)
    border = np.zeros(len(state.surface.vertices), dtype=bool)
    border[table.edges[~table.manifold]] = True
    nodes = {vertex for vertex, edges in around.items() if len(edges) != 2 or border[vertex]}
    seen: set[int] = set()
    found = []
    for vertex in [*sorted(nodes), *sorted(set(around) - nodes)]:
        for edge in around[vertex]:
            if edge not in seen:
                path, way = walked(table, around, nodes, vertex, edge)
                seen |= set(way)
                ends = [len(around[end]) == 1 and not border[end] for end in (path[0], path[-1])]
                found.append(as_chain(state, label, path, way, ends))
    return found


def walked(
    table: EdgeTable, around: dict[int, list[int]], nodes: set[int], vertex: int, edge: int
) -> tuple[list[int], list[int]]:
    """The vertices and edges from a vertex along an edge up to the next node, or back to where it began."""
    path, way = [vertex], [edge]
    while True:
        a, b = table.edges[way[-1]].tolist()
        path.append(b if path[-1] == a else a)
        if path[-1] in nodes or path[-1] == vertex:
            return path, way
        way.append(next(other for other in around[path[-1]] if other != way[-1]))


def as_chain(state: State, label: NDArray[np.int64], path: list[int], way: list[int], ends: list[bool]) -> Chain:
    """A chain; one that ends inside a piece is turned so that it ends there."""
    if ends[0] and not ends[1]:
        path, way = path[::-1], way[::-1]
    edges = np.array(way, dtype=np.int64)
    points = state.surface.vertices[path]
    reach = np.concatenate([[0.0], np.cumsum(np.linalg.norm(points[1:] - points[:-1], axis=1))]) / state.unit
    sides = tuple(np.unique(label[state.table.edge_faces[edges[0]]]).tolist())
    return Chain(np.array(path, dtype=np.int64), edges, reach, sides, any(ends), all(ends))


def intervals(chain: Chain, shares: tuple[float, ...], least: int, *, both: bool = False) -> list[NDArray[np.int64]]:
    """Runs of edges that may be closed: at the loose end, or where two pieces meet, at both ends and half way.

    shares: of the chain's length.  least: edges of each run.  both: at each loose end, where there are two.
    """
    total, count = float(chain.reach[-1]), len(chain.edges)
    found: dict[tuple[int, int], None] = {}
    for share in shares:
        places = [total - share * total] if chain.loose else [0.0, total - share * total, 0.5 * (1.0 - share) * total]
        places = [0.0, *places] if chain.free and both else places
        for start in places:
            first = int(np.argmin(np.abs(chain.reach - start)))
            last = int(np.argmin(np.abs(chain.reach - start - share * total)))
            last = min(max(last, first + least), count)
            first = max(min(first, last - least), 0)
            found[first, last] = None
    return [chain.edges[first:last] for first, last in found]
