"""Topology of triangle index arrays: edges, components, boundary loops, and cutting a mesh open along edges.

f faces · e edges · v vertices.  Corner 3·face + i; half-edge 3·face + i runs from corner i to corner (i + 1) % 3.
Everything here reads vertex indices only: positions play no part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ..kernel.choice import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class EdgeTable:
    """The undirected edges of a triangle mesh, sorted by their vertex pair.

    edges: (e, 2) int64, lower vertex first.
    face_edges: (f, 3) int64; edge i of a face joins its corner i and corner (i + 1) % 3.
    edge_faces: (e, 2) int64, the first two faces along the edge in face order, −1 where there is none.
    edge_halfedges: (e, 2) int64, the half-edges 3·face + i of those two faces, −1 where there is none.
    edge_count: (e,) int64, the number of faces along the edge.
    manifold: (e,) bool, exactly two faces run along it, in opposite directions.
    """

    edges: NDArray[np.int64]
    face_edges: NDArray[np.int64]
    edge_faces: NDArray[np.int64]
    edge_halfedges: NDArray[np.int64]
    edge_count: NDArray[np.int64]
    manifold: NDArray[np.bool_]

    @property
    def interior(self) -> NDArray[np.bool_]:
        """(e,) bool: two faces or more run along the edge."""
        return self.edge_count >= 2

    @property
    def boundary(self) -> NDArray[np.bool_]:
        """(e,) bool: one face runs along the edge."""
        return self.edge_count == 1


def edge_table(faces: NDArray[np.int64]) -> EdgeTable:
    """Edges of faces (f, 3) int64.  Non-manifold edges are allowed; a face with a repeated vertex is not."""
    if compiled := kernel():
        return EdgeTable(*compiled.edge_table(faces))
    start = faces.reshape(-1).astype(np.int64)
    end = np.roll(faces, -1, axis=1).reshape(-1).astype(np.int64)
    span = int(start.max(initial=0)) + 1
    key = np.minimum(start, end) * span + np.maximum(start, end)
    order = stable_order(key, span * span)
    is_first = np.ones(len(key), dtype=bool)
    is_first[1:] = key[order][1:] != key[order][:-1]
    first = np.flatnonzero(is_first)
    count = np.diff(np.append(first, len(key)))
    edge_of_half = np.zeros(len(key), dtype=np.int64)
    edge_of_half[order] = np.cumsum(is_first) - 1
    halfedges = np.full((len(first), 2), -1, dtype=np.int64)
    halfedges[:, 0] = order[first]
    shared = count >= 2
    halfedges[shared, 1] = order[first[shared] + 1]
    opposite = start[halfedges[:, 0]] == end[halfedges[:, 1]]
    return EdgeTable(
        edges=np.stack([key[order[first]] // span, key[order[first]] % span], axis=1),
        face_edges=edge_of_half.reshape(-1, 3),
        edge_faces=np.where(halfedges >= 0, halfedges // 3, -1),
        edge_halfedges=halfedges,
        edge_count=count,
        manifold=(count == 2) & opposite,
    )


def stable_order(key: NDArray[np.int64], bound: int) -> NDArray[np.int64]:
    """``np.argsort(key, kind="stable")`` of keys in [0, bound): each sorted with its place as one number, if that fits.

    Numbers sort several times as fast as places.
    """
    bits = max(len(key) - 1, 1).bit_length()
    if (bound << bits) > np.iinfo(np.int64).max:
        return np.argsort(key, kind="stable")
    packed = (key << bits) | np.arange(len(key))
    packed.sort()
    return packed & ((1 << bits) - 1)


def face_components(n_faces: int, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Connected components of faces joined by pairs.

    Args:
        n_faces: number of faces.
        pairs: (p, 2) int64 face indices; order and repetition don't matter.

    Returns:
        (n_faces,) int64 labels 0 … k − 1, numbered by the lowest face of each component.
    """
    if compiled := kernel():
        return compiled.face_components(n_faces, pairs)
    link = coo_matrix((np.ones(len(pairs), dtype=np.int8), (pairs[:, 0], pairs[:, 1])), shape=(n_faces, n_faces))
    return connected_components(link, directed=False)[1].astype(np.int64)


def within_rings(faces: NDArray[np.int64], chosen: NDArray[np.bool_], count: int, rings: int) -> NDArray[np.bool_]:
    """(f,) bool: chosen (f,) faces (f, 3) and those within so many rings of them; count: of vertices."""
    for _ in range(rings if chosen.any() else 0):
        touched = np.zeros(count, dtype=bool)
        touched[faces[chosen]] = True
        chosen = touched[faces[:, 0]] | touched[faces[:, 1]] | touched[faces[:, 2]]
    return chosen


def components(faces: NDArray[np.int64], table: EdgeTable | None = None) -> NDArray[np.int64]:
    """Components of faces (f, 3) connected through edges; (f,) int64 labels numbered by the lowest face.

    Faces that share only a vertex are not connected; all faces along a non-manifold edge are.
    """
    table = table or edge_table(faces)
    half_order = stable_order(table.face_edges.reshape(-1), len(table.edges))
    edge = table.face_edges.reshape(-1)[half_order]
    same = edge[1:] == edge[:-1]
    return face_components(len(faces), np.stack([half_order[:-1][same] // 3, half_order[1:][same] // 3], axis=1))


def euler_characteristic(faces: NDArray[np.int64], table: EdgeTable | None = None) -> int:
    """V − E + F over the vertices in use: 2 for a sphere, 1 for a disk, 0 for an annulus or torus."""
    table = table or edge_table(faces)
    return vertices_used(faces) - len(table.edges) + len(faces)


def vertices_used(faces: NDArray[np.int64]) -> int:
    """How many different vertices faces (f, 3) name."""
    used = np.zeros(int(faces.max(initial=-1)) + 1, dtype=bool)
    used[faces] = True
    return int(np.count_nonzero(used))


def is_manifold(faces: NDArray[np.int64], table: EdgeTable | None = None) -> bool:
    """True where each edge has one face or two that agree in orientation, and the faces of each vertex form one fan."""
    table = table or edge_table(faces)
    if not bool(np.all(table.manifold | table.boundary)):
        return False
    return len(split_non_manifold_vertices(faces, table=table)[1]) == vertices_used(faces)


def split_non_manifold_vertices(
    faces: NDArray[np.int64],
    cut_edges_mask: NDArray[np.bool_] | None = None,
    table: EdgeTable | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Cut a mesh open along edges: each fan of faces around a vertex gets a vertex of its own.

    Two corners belong to one fan when a chain of manifold edges that are not cut joins their faces around the vertex.
    Edges that are not manifold are always cut, so the result is an oriented manifold, whatever went in.  An edge whose
    two ends both stay whole stays joined: to open a slit inside a surface takes two edges or more.

    Args:
        faces: (f, 3) int64.
        cut_edges_mask: (e,) bool over ``edge_table(faces).edges``, True = cut; None cuts nothing more.
        table: ``edge_table(faces)`` where it is at hand.

    Returns:
        (f, 3) int64 faces over the new vertices, and (w,) int64 the old vertex of each new one, ascending: unused
        vertices vanish, and a manifold that uses all its vertices comes back as it was.
    """
    table = table or edge_table(faces)
    joined = table.manifold if cut_edges_mask is None else table.manifold & ~cut_edges_mask
    if compiled := kernel():
        return compiled.opened(faces, table.edge_halfedges, joined)
    fan = fans(faces, table.edge_halfedges[joined])
    first = np.flatnonzero(fan == np.arange(len(fan)))
    order = first[np.argsort(faces.reshape(-1)[first], kind="stable")]
    rank = np.zeros(len(fan), dtype=np.int64)
    rank[order] = np.arange(len(order))
    return rank[fan].reshape(-1, 3), faces.reshape(-1)[order].astype(np.int64)


def fans(faces: NDArray[np.int64], joined: NDArray[np.int64]) -> NDArray[np.int64]:
    """(3f,) the lowest corner of each corner's fan; joined (e, 2): half-edges along which faces hang together.

    Each corner points at the next one around its vertex, or at itself where the fan ends.  Pointers are doubled until
    they have gone all the way round, or to the end, with the lowest corner seen.
    """
    corner = np.arange(faces.size)
    after = corner.copy()
    after[next_halfedge(joined[:, 0])] = joined[:, 1]
    after[next_halfedge(joined[:, 1])] = joined[:, 0]
    lowest, jump = corner, after
    for _ in range(int(np.bincount(faces.reshape(-1)).max(initial=1)).bit_length()):
        lowest, jump = np.minimum(lowest, lowest[jump]), jump[jump]
    open_fan = np.flatnonzero(after[jump] == jump)
    whole = corner.copy()
    np.minimum.at(whole, jump[open_fan], open_fan)
    lowest[open_fan] = whole[jump[open_fan]]
    return lowest


def next_halfedge(half: NDArray[np.int64]) -> NDArray[np.int64]:
    """The half-edge (or corner) that follows each of half (…) int64 inside its face."""
    return half - half % 3 + (half + 1) % 3


def boundary_loops(faces: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """The boundary as closed vertex loops, each running as its faces' half-edges do (the surface lies to the left).

    Where loops touch in a vertex they are kept apart; an edge that is not manifold counts as boundary.

    Args:
        faces: (f, 3) int64.

    Returns:
        List of (n,) int64 vertex indices in order, the first not repeated; longest loop first, then lowest vertex.
    """
    if compiled := kernel():
        return compiled.boundary_loops(faces)
    cut_faces, old_vertex = split_non_manifold_vertices(faces)
    table = edge_table(cut_faces)
    half = table.edge_halfedges[table.boundary, 0]
    if len(half) == 0:
        return []
    successor = np.full(len(old_vertex), -1, dtype=np.int64)
    successor[cut_faces.reshape(-1)[half]] = cut_faces.reshape(-1)[next_halfedge(half)]
    loops = [old_vertex[loop] for loop in _cycles(successor)]
    return sorted(loops, key=lambda loop: (-len(loop), int(loop.min())))


def _cycles(successor: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Cycles of a partial permutation (n,) int64 (−1 = not on a cycle), each starting at its lowest element."""
    following: list[int] = successor.tolist()
    seen = [target < 0 for target in following]
    cycles: list[NDArray[np.int64]] = []
    for first in np.flatnonzero(successor >= 0).tolist():
        if seen[first]:
            continue
        cycle, at = [], first
        while not seen[at]:
            seen[at] = True
            cycle.append(at)
            at = following[at]
        cycles.append(np.asarray(cycle, dtype=np.int64))
    return cycles
