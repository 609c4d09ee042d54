"""Paths along the edges of a surface that are short and seldom turn.

On a grid all staircases between two corners are equally short.  Here a turn has a price too, so that a path keeps the
direction in which edges run.   v vertices · m edges.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra

from .cutgraph import trace_back

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Roads(NamedTuple):
    """Edges that a path may take: ends (m, 2) int64, cost (m,) > 0; points (v, 3) are where the vertices lie."""

    points: NDArray[np.float64]
    ends: NDArray[np.int64]
    cost: NDArray[np.float64]


def straightest_path(roads: Roads, first: int, last: int, turning: float) -> list[int]:
    """Vertices of the path of least cost from one vertex to another; empty where there is none.

    turning: price of a turn by a right angle, as a share of what the two edges beside it cost on average; a turn by
    another angle costs 1 − cos times that.  Dijkstra over edges with a direction, each joined to those after it.
    """
    tail, head = np.concatenate([roads.ends, roads.ends[:, ::-1]]).T
    count, cost = len(tail), np.tile(roads.cost, 2)
    source, target = count, count + 1
    before, after = followers(tail, head)
    way = roads.points[head] - roads.points[tail]
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), 1e-300)
    turn = 1.0 - np.einsum("ac,ac->a", way[before], way[after])
    step = cost[after] + turning * turn * (cost[before] + cost[after]) / 2.0
    begin, end = np.flatnonzero(tail == first), np.flatnonzero(head == last)
    rows = np.concatenate([before, np.full(len(begin), source), end])
    columns = np.concatenate([after, begin, np.full(len(end), target)])
    values = np.concatenate([step, cost[begin], np.full(len(end), 1e-12)])
    graph = sparse.csr_array((values, (rows, columns)), shape=(count + 2, count + 2))
    distance, parent = dijkstra(graph, indices=source, return_predecessors=True)
    if not np.isfinite(distance[target]):
        return []
    taken = trace_back(parent, target)[1:-1][::-1]
    return [first, *head[taken].tolist()]


def followers(tail: NDArray[np.int64], head: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(p,) and (p,) edges with a direction, tail → head (2 m,), the second of which goes on where the first ends.

    The way back along the same edge is none: the second half of the edges are the first, turned round.
    """
    size, order = len(tail), np.argsort(tail, kind="stable")
    first, last = (np.searchsorted(tail[order], head, side=side) for side in ("left", "right"))
    before = np.repeat(np.arange(size), last - first)
    step = np.arange(len(before)) - np.repeat(np.cumsum(last - first) - (last - first), last - first)
    after = order[first[before] + step]
    other = before % (size // 2) != after % (size // 2) if size else np.zeros(0, dtype=bool)
    return before[other], after[other]
