"""Small closed parts cut open as nets: bubbles and crumbs, that noise leaves about a surface by the thousands.

Their faces stay joined along a spanning tree of their longest edges, so that each unrolls without stretch as one chart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import minimum_spanning_tree

from ...runtime.geometry.topology import edge_table, face_components, split_non_manifold_vertices
from ...runtime.mesh import Surface
from ..carry.layout import face_frames

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.topology import EdgeTable


LEAST = 1e-4
"""Longest edge of a part, as a share of √(area of all), below which it is no net: layouts take its edges for one."""


def cut_to_nets(surface: Surface, most: int) -> Surface:
    """The surface, its faces in their order, with closed parts of so many faces at most cut open, and manifold."""
    table = edge_table(surface.faces)
    pairs = table.edge_faces[table.manifold]
    part = face_components(len(surface.faces), pairs)
    size = np.bincount(part)
    inside = np.bincount(part[pairs[:, 0]], minlength=len(size))
    ends = np.take(surface.vertices, table.edges[table.manifold], axis=0)
    longest = np.zeros(len(size))
    np.maximum.at(longest, part[pairs[:, 0]], np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))
    seen = longest > LEAST * np.sqrt(surface.face_areas().sum())
    small = (size <= most) & (2 * inside == 3 * size) & seen
    cut = np.zeros(len(table.edges), dtype=np.bool_)
    if small.any():
        edges = np.flatnonzero(table.manifold)
        edges = edges[small[part[table.edge_faces[edges, 0]]]]
        cut[edges] = True
        cut[tree_edges(surface, table, edges)] = False
    faces, old = split_non_manifold_vertices(surface.faces, cut, table)
    return Surface(surface.vertices[old], faces)


def tree_edges(surface: Surface, table: EdgeTable, edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of edges (n,) along which faces stay joined: trees of the longest."""
    ends, count = np.take(surface.vertices, table.edges[edges], axis=0), len(surface.faces)
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    pairs = np.sort(table.edge_faces[edges], axis=1)
    key, first = np.unique(pairs[:, 0] * count + pairs[:, 1], return_index=True)  # two faces may share two edges
    weight = 1.0 / np.maximum(length[first], 1e-300)
    matrix = sparse.csr_array((weight, (key // count, key % count)), shape=(count, count))
    tree = minimum_spanning_tree(matrix).tocoo()
    kept = np.searchsorted(key, tree.row.astype(np.int64) * count + tree.col)
    return edges[first[kept]]


def unrolled(surface: Surface, chart: NDArray[np.int64], turn: NDArray[np.float64]) -> NDArray[np.float64]:
    """Turns (f, 2, 2) of faces in the plane; those of charts (f,) that are nets as the faces unroll, one by one.

    A net's faces hang together like a tree: whatever the turn of one, the edges that it shares say those of the others.
    """
    table = edge_table(surface.faces)
    half = table.edge_halfedges[table.manifold]
    pairs = half // 3
    size = np.bincount(chart)
    net = (np.bincount(chart[pairs[:, 0]], minlength=len(size)) == size - 1) & (size > 1)
    half = half[net[chart[pairs[:, 0]]]]
    if len(half) == 0:
        return turn
    angle = np.arctan2(turn[:, 1, 0], turn[:, 0, 0])
    known = np.zeros(len(chart), dtype=np.bool_)
    known[np.unique(chart, return_index=True)[1]] = True
    half = np.concatenate([half, half[:, ::-1]])
    shared = edge_angles(surface)
    while len(half):
        onto = half[known[half[:, 0] // 3] & ~known[half[:, 1] // 3]]
        if len(onto) == 0:
            break
        near, far = onto.T
        angle[far // 3] = angle[near // 3] + shared[near] - shared[far] + np.pi
        known[far // 3] = True
        half = half[~known[half[:, 1] // 3]]
    cosine, sine = np.cos(angle), np.sin(angle)
    rolled = np.stack([np.stack([cosine, -sine], axis=1), np.stack([sine, cosine], axis=1)], axis=1)
    return np.where(net[chart][:, None, None], rolled, turn)


def edge_angles(surface: Surface) -> NDArray[np.float64]:
    """(3f,) the direction of each half-edge in its face's own axes, in radians: the first runs along the first edge."""
    corner = surface.triangles
    edge = np.roll(corner, -1, axis=1) - corner
    frame = face_frames(surface)
    flat = np.einsum("fec,fac->fea", edge, frame[:, :2])
    return np.arctan2(flat[..., 1], flat[..., 0]).reshape(-1)
