"""Faces that run through their edges alike: which ones to turn.

f faces · m pairs of faces.  Faces are (f, 3) int64 welded vertices; nothing else plays a part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree

from ...geometry.rows import by_first_appearance
from ...geometry.topology import stable_order

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class FaceEdges:
    """Faces that share an edge.

    pairs: (m, 2) int64 faces at manifold edges.  agree: (m,) bool, they run through it opposite ways.
    links: (…, 2) int64 faces at any shared edge, as a chain.  non_manifold: how many edges have three faces or more.
    """

    pairs: NDArray[np.int64]
    agree: NDArray[np.bool_]
    links: NDArray[np.int64]
    non_manifold: int


def face_edges(faces: NDArray[np.int64]) -> FaceEdges:
    """Which of faces (f, 3) share an edge, and how."""
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    span = int(high.max(initial=0)) + 1
    key = low * span + high
    order = stable_order(key, span * span)
    same = np.diff(key[order]) == 0
    face, forward = order // 3, (tail < head)[order]
    before = np.concatenate([[False], same[:-1]])
    after = np.concatenate([same[1:], [False]])
    alone = np.flatnonzero(same & ~before & ~after)
    pairs = np.stack([face[alone], face[alone + 1]], axis=1)
    links = np.stack([face[:-1][same], face[1:][same]], axis=1)
    return FaceEdges(
        pairs=pairs,
        agree=forward[alone] != forward[alone + 1],
        links=links,
        non_manifold=int(np.count_nonzero(same & after & ~before)),
    )


def inconsistent_faces(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which faces to flip so that neighbours across manifold edges run their edge opposite ways.

    The winding of most faces of a component stays (of a tie, that of the first face).  A surface that can't be oriented
    is flipped along a spanning tree that crosses as few disagreeing edges as it can: best effort.

    Args:
        faces: (f, 3) int64 welded vertices.

    Returns:
        (f,) bool.
    """
    edges, count = face_edges(faces), len(faces)
    if edges.agree.all():
        return np.zeros(count, dtype=np.bool_)
    tree = _spanning_forest(edges, count)
    one, other, twist = tree.row.astype(np.int64), tree.col.astype(np.int64), (tree.data > 1.5).astype(np.int64)
    # Each face stands twice, as it is (i) and flipped (i + count); tree edges join the copies that agree.
    links = np.concatenate(
        [np.stack([one, other + twist * count], axis=1), np.stack([one + count, other + (1 - twist) * count], axis=1)]
    )
    side = connected_labels(links, 2 * count)
    same_way, opposite = side[:count], side[count:]
    size = np.bincount(same_way, minlength=int(side.max()) + 1)
    return (size[opposite] > size[same_way]) | ((size[opposite] == size[same_way]) & (opposite < same_way))


def _spanning_forest(edges: FaceEdges, count: int) -> coo_matrix:
    """(count, count) tree edges between faces: 1 where they agree, 2 where one has to flip; few of the latter."""
    cost = np.where(edges.agree, 1.0, 2.0)
    order = np.lexsort((cost, edges.pairs[:, 1], edges.pairs[:, 0]))
    pairs = edges.pairs[order]
    first = np.concatenate([[True], (np.diff(pairs, axis=0) != 0).any(axis=1)])  # two faces may share two edges
    graph = coo_matrix((cost[order][first], (pairs[first, 0], pairs[first, 1])), shape=(count, count))
    return minimum_spanning_tree(graph.tocsr()).tocoo()


def connected_labels(links: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(count,) int64 component of each node, numbered by first appearance; links (m, 2) int64 joins nodes."""
    graph = coo_matrix((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(count, count))
    return by_first_appearance(connected_components(graph.tocsr(), directed=False)[1].astype(np.int64))
