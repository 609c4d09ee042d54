"""Face labels: from what each face would rather be to connected pieces with short seams along creases.

f faces · k labels · a *dual graph* joins faces across interior edges: pairs (m, 2), seam cost (m,) in lengths.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components, maximum_flow

from ...runtime.geometry.cutgraph import counted_prices, seam_prices

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.cutgraph import SeamPrices
    from ...runtime.geometry.topology import EdgeTable
    from ...runtime.mesh import Surface
    from .config import LabelConfig


class DualGraph(NamedTuple):
    """Faces joined across manifold edges.

    pairs: (m, 2) int64.  length: (m,) of the edges as a border of charts counts it, which places and creases may
    change.  cost: (m,) of a seam there, by which ways are chosen.
    """

    pairs: NDArray[np.int64]
    length: NDArray[np.float64]
    cost: NDArray[np.float64]


def dual_graph(surface: Surface, table: EdgeTable, prices: SeamPrices) -> DualGraph:
    """The dual graph of a surface; a seam costs what `seam_prices` says.

    Edges that are not manifold, or where two faces disagree in orientation (a Möbius strip's), join
    nothing: the surface is cut there anyway.
    """
    inside = np.flatnonzero(table.manifold)
    pairs = table.edge_faces[inside]
    ends = surface.vertices[table.edges[inside]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    cost = length * seam_prices(surface, table, prices)[inside]
    return DualGraph(pairs, length * counted_prices(surface, table, prices)[inside], cost)


def label_energy(label: NDArray[np.int64], unary: NDArray[np.float64], graph: DualGraph) -> float:
    """Σ unary of the labels + Σ cost of the seams: what ``smooth_labels`` lowers."""
    seam = label[graph.pairs[:, 0]] != label[graph.pairs[:, 1]]
    return float(unary[np.arange(len(label)), label].sum() + graph.cost[seam].sum())


def smooth_labels(unary: NDArray[np.float64], graph: DualGraph, *, sweeps: int = 2) -> NDArray[np.int64]:
    """Labels (f,) of low energy by α-expansion (Boykov, Veksler & Zabih 2001); unary (f, k) costs in lengths."""
    label = unary.argmin(axis=1)
    energy = label_energy(label, unary, graph)
    reach = sum(np.bincount(end, graph.cost, minlength=len(label)) for end in graph.pairs.T)
    for _ in range(sweeps):
        for alpha in range(unary.shape[1]):
            free = (label != alpha) & (unary[np.arange(len(label)), label] - unary[:, alpha] + reach > 0.0)
            if not free.any():
                continue
            moved = expand_label(label, alpha, unary, graph, free)
            moved_energy = label_energy(moved, unary, graph)
            if moved_energy < energy:
                label, energy = moved, moved_energy
    return label


def expand_label(
    label: NDArray[np.int64], alpha: int, unary: NDArray[np.float64], graph: DualGraph, free: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """The best labelling in which each face keeps its label or takes ``alpha``: one minimum cut.

    free: (f,) bool, the faces that take part; the others are walls that keep their label.
    """
    rows = np.flatnonzero(free)
    number = np.cumsum(free) - 1
    keep, take = unary[rows, label[rows]], unary[rows, alpha]
    touched = free[graph.pairs].any(axis=1)
    (i, j), cost = graph.pairs[touched].T, graph.cost[touched]
    for a, b in ((i, j), (j, i)):
        one = free[a] & ~free[b]
        at, wall, price = number[a[one]], label[b[one]], cost[one]
        keep += np.bincount(at, price * (label[a[one]] != wall), minlength=len(rows))
        take += np.bincount(at, price * (wall != alpha), minlength=len(rows))
    both = free[i] & free[j]
    i, j, cost = i[both], j[both], cost[both]
    apart = cost * (label[i] != label[j])
    # E(0,0) = apart, E(0,1) = E(1,0) = cost, E(1,1) = 0, as unary terms plus one directed edge
    take += np.bincount(number[i], cost - apart, minlength=len(rows))
    take -= np.bincount(number[j], cost, minlength=len(rows))
    moved = label.copy()
    moved[rows[minimum_cut(keep, take, (number[i], number[j]), 2.0 * cost - apart)]] = alpha
    return moved


def minimum_cut(
    keep: NDArray[np.float64],
    take: NDArray[np.float64],
    edges: tuple[NDArray[np.int64], NDArray[np.int64]],
    capacity: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Which faces switch (m,): least Σ keep/take costs + Σ capacity of the edges where only the second switches."""
    size = len(keep)
    source, sink = size, size + 1
    base = np.minimum(keep, take)
    node = np.arange(size)
    rows = np.concatenate([np.full(size, source), node, edges[0]])
    cols = np.concatenate([node, np.full(size, sink), edges[1]])
    # cut source→node when the node switches (pays take), node→sink when it keeps (pays keep)
    costs = np.concatenate([take - base, keep - base, capacity])
    scale = 1e5 / max(costs.max(), 1e-30)
    matrix = sparse.csr_array((np.round(costs * scale).astype(np.int32), (rows, cols)), shape=(size + 2, size + 2))
    matrix.sum_duplicates()
    flow = maximum_flow(matrix, source, sink)
    residual = matrix - flow.flow
    residual.data[residual.data < 0] = 0
    residual.eliminate_zeros()
    reached = sparse.csgraph.breadth_first_order(residual, source, return_predecessors=False)
    switch = np.ones(size + 2, dtype=bool)
    switch[reached] = False
    return switch[:size]


def connected_pieces(label: NDArray[np.int64], graph: DualGraph) -> NDArray[np.int64]:
    """Number (f,) of the connected piece of equal label that each face lies in."""
    same = label[graph.pairs[:, 0]] == label[graph.pairs[:, 1]]
    i, j = graph.pairs[same].T
    links = sparse.coo_array((np.ones(len(i), dtype=np.int8), (i, j)), shape=(len(label), len(label)))
    return connected_components(links, directed=False)[1].astype(np.int64)


def islets_joined(
    label: NDArray[np.int64], areas: NDArray[np.float64], graph: DualGraph, config: LabelConfig
) -> NDArray[np.int64]:
    """Connected pieces (f,), numbered 0…: each islet joins the neighbour it shares most border with, the least first.

    A piece that is a whole connected component has no neighbour and stays.
    """
    piece = connected_pieces(label, graph)
    smallest = config.islet_area * areas.sum()
    while True:
        count = int(piece.max()) + 1
        size = np.bincount(piece, areas, minlength=count)
        border = border_lengths(piece, count, graph)
        mergeable = np.flatnonzero(border.sum(axis=1) > 0)
        if len(mergeable) == 0:
            return piece
        least = int(mergeable[size[mergeable].argmin()])
        if size[least] >= smallest:
            return piece
        piece = np.where(piece == least, border[least].argmax(), piece)
        piece = np.unique(piece, return_inverse=True)[1].astype(np.int64)


def contracted(piece: NDArray[np.int64], graph: DualGraph) -> DualGraph:
    """The graph of pieces (f,): what joins each two of them, added up."""
    ends = np.sort(piece[graph.pairs], axis=1)
    apart = ends[:, 0] != ends[:, 1]
    pairs, which = np.unique(ends[apart], axis=0, return_inverse=True)
    which = which.reshape(-1)
    length, cost = (np.bincount(which, of[apart], minlength=len(pairs)) for of in (graph.length, graph.cost))
    return DualGraph(pairs, length.astype(np.float64), cost.astype(np.float64))


def borders_of(one: int, piece: NDArray[np.int64], count: int, graph: DualGraph) -> NDArray[np.float64]:
    """(count,) length of the border between one piece and each of the others."""
    i, j = piece[graph.pairs].T
    mine = (i == one) != (j == one)
    return np.bincount(np.where(i == one, j, i)[mine], graph.length[mine], minlength=count).astype(np.float64)


def border_lengths(piece: NDArray[np.int64], count: int, graph: DualGraph) -> NDArray[np.float64]:
    """(count, count) length of the border between each two pieces; zero diagonal."""
    i, j = piece[graph.pairs[:, 0]], piece[graph.pairs[:, 1]]
    apart = i != j
    i, j, length = i[apart], j[apart], graph.length[apart]
    matrix = np.bincount(i * count + j, length, minlength=count * count).reshape(count, count)
    return (matrix + matrix.T).astype(np.float64)
