"""Valid charts of all faces of a surface: laid flat, and what is not valid cut off or in two, and laid flat again.

f faces · m faces that are looked at.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ...runtime.geometry.topology import within_rings
from ..carry.hurried import crumbs_given, followed
from ..finish.projected import directions
from ..search.labels import DualGraph

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .sheet import Batch, Sheet

    Left = tuple[NDArray[np.int64], NDArray[np.int64]]
    """Faces (m,) that have no valid chart yet, and numbers (m,) of the charts to try."""


def settled(sheet: Sheet) -> None:
    """Give each face a valid chart; what has none after so many rounds is projected."""
    left = np.arange(len(sheet.chart)), clusters(sheet)
    for _ in range(sheet.config.swift.rounds):
        if len(left[0]) == 0:
            break
        left = numbered([rest for batch in sheet.laid(*left) if len((rest := valid_kept(sheet, batch))[0])])
    if len(left[0]):
        sheet.project(left[0])


def clusters(sheet: Sheet) -> NDArray[np.int64]:
    """(f,) numbers of connected faces that face one way, as those around them do; crumbs join what is beside them."""
    own, count = sheet.config.swift, len(sheet.chart)
    both = np.concatenate([sheet.graph.pairs, sheet.graph.pairs[:, ::-1]])
    links = sparse.csr_array((np.ones(len(both)), tuple(both.T)), shape=(count, count))
    links += sparse.eye_array(count)
    around = sheet.surface.face_cross() * (count / sheet.total)
    for _ in range(int(np.clip(own.reach * np.sqrt(count), *own.rings))):
        around = links @ around / 4.0
    label = (around @ directions().T).argmax(axis=1)
    for _ in range(own.votes):
        votes = (np.arange(len(directions())) == label[:, None]).astype(np.float64)
        for _ in range(own.vote_rings):
            votes = links @ votes
        label = votes.argmax(axis=1)
    label = followed(label, sheet.graph, own.follow)
    return crumbs_given(label, sheet.areas, sheet.graph, own.crumb / count)


def numbered(left: list[Left]) -> Left:
    """What is left of several batches as one, its numbers all different."""
    if not left:
        nothing = np.zeros(0, dtype=np.int64)
        return nothing, nothing
    begin = np.cumsum([0, *(int(label.max()) + 1 for _, label in left[:-1])])
    return (
        np.concatenate([ids for ids, _ in left]),
        np.concatenate([label + more for (_, label), more in zip(left, begin.tolist(), strict=True)]),
    )


def valid_kept(sheet: Sheet, batch: Batch) -> Left:
    """Take what is valid of a batch; what is left, in charts that are smaller."""
    own, ids, chart = sheet.config.swift, batch.ids, batch.chart
    off = in_the_way(sheet, batch)
    torn = (np.bincount(chart, off) > own.most_off * np.bincount(chart))[chart]
    kept = ~torn & ~off
    sheet.keep(batch, np.flatnonzero(kept))
    rest = np.flatnonzero(~kept)
    half = halves(sheet, batch, np.flatnonzero(torn))
    return ids[rest], sheet.connected(ids[rest], (2 * chart + half)[rest])


def in_the_way(sheet: Sheet, batch: Batch) -> NDArray[np.bool_]:
    """(m,) bool: flipped faces and those of their charts around them, and the smaller of two that overlap."""
    laid, faces = batch.laid, sheet.surface.faces[batch.ids]
    off = within_rings(faces, laid.flipped, len(sheet.surface.vertices), sheet.config.swift.around)
    off &= np.bincount(batch.chart, laid.flipped)[batch.chart] > 0
    first, second = laid.pairs[~off[laid.pairs].any(axis=1)].T
    area = sheet.areas[batch.ids]
    off[np.where(area[first] < area[second], first, second)] = True
    return off


def halves(sheet: Sheet, batch: Batch, torn: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) 0 or 1: to which of two faces of its chart, far apart, one is nearer; 0 for all but the rows ``torn``."""
    half = np.zeros(len(batch.ids), dtype=np.int64)
    if len(torn) == 0:
        return half
    ids, number = batch.ids[torn], np.unique(batch.chart[torn], return_inverse=True)[1].reshape(-1)
    place = np.full(len(half), -1)
    place[torn] = np.arange(len(torn))
    overlaps = place[batch.laid.pairs]
    seeds = far_apart(sheet.surface.triangles[ids].mean(axis=1), number, overlaps[(overlaps >= 0).all(axis=1)])
    pairs = sheet.inside(ids)
    pairs = pairs[number[pairs[:, 0]] == number[pairs[:, 1]]]
    found = spread(np.concatenate([pairs, pairs[:, ::-1]]), seeds, len(ids))
    size, own = np.bincount(number)[number], sheet.config.swift
    smooth = followed(found, DualGraph(pairs, *np.ones((2, len(pairs)))), own.follow_cut)
    half[torn] = np.where(size < own.crumb, found, smooth)
    return half


def spread(links: NDArray[np.int64], seeds: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(count,) 0 or 1: which column of seeds (k, 2) fewer links (p, 2) lead to; 0 where none does."""
    found = np.full(count, -1)
    found[seeds[:, 1]], found[seeds[:, 0]] = 1, 0
    while len(links):
        onto = links[(found[links[:, 0]] >= 0) & (found[links[:, 1]] < 0)]
        if len(onto) == 0:
            break
        found[onto[:, 1]] = found[onto[:, 0]]
        links = links[found[links[:, 1]] < 0]
    return np.maximum(found, 0)


def far_apart(centre: NDArray[np.float64], number: NDArray[np.int64], overlaps: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k, 2) two faces of each group (m,): the farthest that overlap (p, 2), else the ends of its longest side."""
    count = int(number.max()) + 1
    low, high = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    np.minimum.at(low, number, centre)
    np.maximum.at(high, number, centre)
    along = centre[np.arange(len(centre)), (high - low).argmax(axis=1)[number]]
    order, end = np.lexsort((along, number)), np.cumsum(np.bincount(number))
    seeds = np.stack([order[np.append(0, end[:-1])], order[end - 1]], axis=1)
    apart = np.linalg.norm(centre[overlaps[:, 0]] - centre[overlaps[:, 1]], axis=1)
    overlaps = overlaps[np.argsort(apart, kind="stable")]
    seeds[number[overlaps[:, 0]]] = overlaps  # of several the last one written stays
    return seeds
