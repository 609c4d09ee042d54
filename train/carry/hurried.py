"""Labels carried to a fine surface when there is no time to weigh their borders.   f faces · k labels."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..search.labels import connected_pieces, contracted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..search.labels import DualGraph

NOTHING = -1


def followed(label: NDArray[np.int64], graph: DualGraph, rounds: int) -> NDArray[np.int64]:
    """(f,) labels after rounds in which each triangle takes the label that two of its neighbours have."""
    ends = np.concatenate([graph.pairs, graph.pairs[:, ::-1]])
    ends = ends[np.argsort(ends[:, 0], kind="stable")]
    count = np.bincount(ends[:, 0], minlength=len(label))
    slot = np.arange(len(ends)) - np.repeat(np.cumsum(count) - count, count)
    beside = np.full((len(label), 3), NOTHING)
    beside[ends[:, 0], slot] = ends[:, 1]
    for _ in range(rounds):
        a, b, c = np.where(beside == NOTHING, NOTHING, label[beside]).T
        most = np.where((a == b) | (a == c), a, np.where(b == c, b, NOTHING))
        label = np.where(most == NOTHING, label, most)
    return label


def crumbs_given(
    label: NDArray[np.int64], areas: NDArray[np.float64], graph: DualGraph, islet: float
) -> NDArray[np.int64]:
    """Connected pieces (f,), numbered 0…; those of less than a share of the area join a larger one beside them.

    All at once, to the neighbour of longest border among those that are larger, until none has one: `fragments_joined`
    does it one by one, the smallest first.
    """
    piece = connected_pieces(label, graph)
    least = islet * float(areas.sum())
    while True:
        between = contracted(piece, graph)
        size = np.bincount(piece, areas)
        ends = np.concatenate([between.pairs, between.pairs[:, ::-1]])
        length = np.tile(between.length, 2)
        joins = (size[ends[:, 0]] < least) & (size[ends[:, 1]] > size[ends[:, 0]])
        if not joins.any():
            return piece
        ends, length = ends[joins], length[joins]
        order = np.lexsort((length, ends[:, 0]))
        target = np.arange(len(size))
        target[ends[order, 0]] = ends[order, 1]  # the longest of each stays
        for _ in range(len(size).bit_length()):
            target = target[target]  # a crumb of a crumb goes where that goes: sizes grow along the way
        piece = np.unique(target[piece], return_inverse=True)[1].reshape(-1)
