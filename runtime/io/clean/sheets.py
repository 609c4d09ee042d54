"""Faces that lie on each other become sheets of their own: second sides of paper-thin parts, parts that stand twice.

f faces · v welded vertices.  Twins are faces with the same three vertices, whatever their winding: a face and its
second side, or a face and its copy.  Welding has glued them along every edge; here each sheet gets vertices of its own,
so that it can be unwrapped like any other open surface.

Which faces go on in one sheet is decided edge by edge.  Two faces alone along an edge do, unless they are twins.
Where more meet and some have twins, those that run through the edge opposite ways do, if they are no twins and both are
the same copy (the first of their winding, the second, …): of a front and a back side two fronts go together, and two
backs.  A surface without twins goes on beneath a fin that stands on it, and the fin's sides end there.  Then the faces
around a vertex fall into fans, and each fan with twins in it gets a vertex of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...geometry.rows import by_first_appearance, equal_rows, first_of_each
from .orient import connected_labels

if TYPE_CHECKING:
    from numpy.typing import NDArray


def twins(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(f,) int64: label of the three vertices of each face (f, 3), the same for twins."""
    return equal_rows(np.sort(faces, axis=1))


def separate_sheets(faces: NDArray[np.int64], group: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give faces that lie on each other vertices of their own.

    Args:
        faces: (f, 3) int64 welded vertices 0 … v − 1, each used, no corner repeated in a face.
        group: (f,) int64, the label that `twins` gives them.

    Returns:
        (f, 3) int64 faces into the vertices after the split, and (v', ) int64, v' ≥ v, the welded vertex of each; the
        first v are those given.
    """
    count = int(faces.max()) + 1
    has_twin = np.bincount(group)[group] > 1
    if not has_twin.any():
        return faces, np.arange(count)
    involved = np.zeros(count, dtype=np.bool_)
    involved[faces[has_twin]] = True
    label = connected_labels(_corner_links(faces, group, has_twin, involved), faces.size)
    return _split(faces, label, has_twin, involved)


def _copy_number(faces: NDArray[np.int64], group: NDArray[np.int64]) -> NDArray[np.int64]:
    """(f,) int64: 0 for the first face of its vertices and winding, 1 for the next one, and so on."""
    first = np.argmin(faces, axis=1)
    rows = np.arange(len(faces))
    upward = faces[rows, (first + 1) % 3] < faces[rows, (first + 2) % 3]
    order = np.lexsort((upward, group))
    new = (np.diff(group[order]) != 0) | (np.diff(upward[order].astype(np.int8)) != 0)
    start = np.concatenate([[True], new])
    number = np.zeros(len(faces), dtype=np.int64)
    number[order] = np.arange(len(faces)) - np.maximum.accumulate(np.where(start, np.arange(len(faces)), 0))
    return number


def _corner_links(
    faces: NDArray[np.int64], group: NDArray[np.int64], has_twin: NDArray[np.bool_], involved: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """(…, 2) int64 corners 3 face + i that stay one vertex, at edges that touch the vertices involved."""
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    half = np.flatnonzero(involved[tail] | involved[head])
    low, high = np.minimum(tail, head)[half], np.maximum(tail, head)[half]
    order = np.lexsort((high, low))
    half, low, high = half[order], low[order], high[order]
    new = np.concatenate([[True], (np.diff(low) != 0) | (np.diff(high) != 0)])
    edge = np.cumsum(new) - 1
    size = np.bincount(edge)[edge]
    crowded = np.zeros(len(size), dtype=np.bool_)
    crowded[has_twin[half // 3]] = True
    crowded = (np.bincount(edge, weights=crowded) > 0)[edge] & (size > 2)
    next_on_edge = ~np.append(new[1:], True)
    plain = np.flatnonzero(next_on_edge & ~crowded)
    pairs = np.stack([half[plain], half[plain + 1]], axis=1)
    pairs = pairs[group[pairs[:, 0] // 3] != group[pairs[:, 1] // 3]]
    bundle = _bundles(half[crowded], edge[crowded], tail < head, _copy_number(faces, group), has_twin)
    many = _crowded_pairs(half[crowded], bundle, tail < head, group)
    return _corners_of(np.concatenate([pairs, many]), tail)


def _bundles(
    half: NDArray[np.int64],
    edge: NDArray[np.int64],
    forward: NDArray[np.bool_],
    copy: NDArray[np.int64],
    has_twin: NDArray[np.bool_],
) -> NDArray[np.int64]:
    """(h,) int64: half-edges of one edge and copy have one number; those with twins another where the rest gets along.

    The rest gets along when faces without twins run both ways through the edge.
    """
    face = half // 3
    together = equal_rows(np.stack([edge, copy[face]], axis=1)) if len(half) else np.zeros(0, dtype=np.int64)
    ahead, back = (np.zeros(int(together.max(initial=0)) + 1, dtype=np.bool_) for _ in range(2))
    ahead[together[forward[half] & ~has_twin[face]]] = True
    back[together[~forward[half] & ~has_twin[face]]] = True
    return 2 * together + ((ahead & back)[together] & has_twin[face])


def _crowded_pairs(
    half: NDArray[np.int64], bundle: NDArray[np.int64], forward: NDArray[np.bool_], group: NDArray[np.int64]
) -> NDArray[np.int64]:
    """(…, 2) half-edges that go on in one sheet, at edges of three faces or more with twins among them.

    Of the same bundle all that run opposite ways are joined, twins excepted.  Where three or more run one way and two
    or more the other this joins all of them, so that a chain says the same.
    """
    if len(half) == 0:
        return np.zeros((0, 2), dtype=np.int64)
    order = np.lexsort((half, ~forward[half], bundle))
    half = half[order]
    new = np.diff(bundle[order]) != 0
    bundle = np.concatenate([[0], np.cumsum(new)])
    ahead = np.bincount(bundle, weights=forward[half]).astype(np.int64)
    total = np.bincount(bundle)
    back, start = total - ahead, np.cumsum(total) - total
    chained = (np.minimum(ahead, back) >= 2) & (np.maximum(ahead, back) >= 3)
    link = np.flatnonzero(chained[bundle[1:]] & ~new)
    chains = np.stack([half[link], half[link + 1]], axis=1)
    products = np.where(chained, 0, ahead * back)
    own = np.repeat(np.arange(len(products)), products)
    step = np.arange(len(own)) - np.repeat(np.cumsum(products) - products, products)
    one = half[start[own] + step // np.maximum(back[own], 1)]
    other = half[start[own] + ahead[own] + step % np.maximum(back[own], 1)]
    apart = group[one // 3] != group[other // 3]
    return np.concatenate([chains, np.stack([one[apart], other[apart]], axis=1)])


def _corners_of(pairs: NDArray[np.int64], tail: NDArray[np.int64]) -> NDArray[np.int64]:
    """(…, 2) corners at both ends of the edge that two half-edges (…, 2) share; tail (3 f,) vertex of each corner."""
    one, other = pairs[:, 0], pairs[:, 1]
    end_of = np.arange(len(tail)).reshape(-1, 3)[:, [1, 2, 0]].ravel()  # half-edge → corner at its head
    same_way = tail[one] == tail[other]
    at_tail = np.where(same_way, other, end_of[other])
    at_head = np.where(same_way, end_of[other], other)
    return np.concatenate([np.stack([one, at_tail], axis=1), np.stack([end_of[one], at_head], axis=1)])


def _split(
    faces: NDArray[np.int64], label: NDArray[np.int64], has_twin: NDArray[np.bool_], involved: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """A vertex for each fan (label of corners) that has twins in it; other fans share that of their first corner."""
    corner = faces.ravel()
    with_twin = np.zeros(int(label.max()) + 1, dtype=np.bool_)
    with_twin[label[np.repeat(has_twin, 3)]] = True
    fan = np.where(involved[corner] & with_twin[label], label, -1)
    order = np.lexsort((fan, corner))
    new = np.concatenate([[True], (np.diff(corner[order]) != 0) | (np.diff(fan[order]) != 0)])
    piece = np.zeros(len(corner), dtype=np.int64)
    piece[order] = np.cumsum(new) - 1
    piece = by_first_appearance(piece)
    vertex = corner[first_of_each(piece)]  # of each piece, in the order of first appearance
    _, keeper = np.unique(vertex, return_index=True)  # the first piece of each vertex keeps its number
    extra = np.ones(len(vertex), dtype=np.bool_)
    extra[keeper] = False
    number = np.zeros(len(vertex), dtype=np.int64)
    number[keeper] = np.arange(len(keeper))
    number[extra] = len(keeper) + np.arange(np.count_nonzero(extra))
    return number[piece].reshape(-1, 3), np.concatenate([np.arange(len(keeper)), vertex[extra]])
