"""From the simplified proxy back to the surface: labels, slits, and each chart's flattening.   f faces · area 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ...runtime.geometry.topology import edge_table
from ..finish.pieces import Overlapping, Piece
from ..search.labels import borders_of, connected_pieces, contracted, dual_graph, smooth_labels
from ..search.search import Search
from ..workers import parallel_map
from .layout import carried_uv, near_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..search.labels import DualGraph

WALL = 1e6
"""Cost of a label that a face may not take."""


def carried_back(surface: Surface, coarse: Surface, found: Search, charts: int, config: FinishConfig) -> Search:
    """The pieces and slits of the proxy, on the surface itself."""
    keys, label = np.unique(found.label(), return_inverse=True)
    graph = dual_graph(surface, edge_table(surface.faces), config.labels.seams)
    areas = surface.face_areas()
    near = near_faces(surface, coarse, config.carry, config.carry.neighbours)
    smooth = smoothed_in_band(votes(label.reshape(-1)[near]), areas, graph, config)
    limit = max(charts, len(keys))
    piece = fragments_joined(smooth, areas, graph, config.carry.islet)
    search = laid_on(Search(surface, graph, config), piece, smooth, [found.pieces[int(key)] for key in keys])
    search.split_stretched()
    search.merge_down(limit)
    search.split_down()
    return search


def laid_on(search: Search, piece: NDArray[np.int64], label: NDArray[np.int64], sources: list[Piece]) -> Search:
    """The search with the faces (f,) of each piece laid out like the source that most of their labels (f,) name.

    A source of the same surface whose faces are the piece's is taken as it is.
    """
    rows = [np.flatnonzero(piece == number) for number in range(int(piece.max()) + 1)]
    jobs = [(ids, sources[int(np.bincount(label[ids]).argmax())]) for ids in rows]
    found = parallel_map(lambda job: carried_ways(search, *job), jobs, lambda job: len(job[0]))
    for (ids, source), ways in zip(jobs, found, strict=True):
        carry_piece(search, ids, source, ways)
    search.place_loose()
    return search


def carry_piece(
    search: Search, ids: NDArray[np.int64], source: Piece, ways: list[Piece | Overlapping | None], depth: int = 0
) -> None:
    """Add a chart of the proxy on the faces ids (m,), less its flaps; where more overlaps there, cut between it."""
    valid = [way for way in ways if isinstance(way, Piece)]
    best = min(valid, key=lambda piece: piece.energy, default=None)
    overlapping = [way for way in ways if isinstance(way, Overlapping)]
    less = next((found for way in overlapping if (found := search.trimmed(way)) is not None), None)
    if best is not None and search.is_bearable(best):
        search.add(best)
    elif less is not None:
        search.add_trimmed(less)
    elif overlapping and depth < search.config.halvings:
        for part in search.cut(ids, overlapping[0]):
            carry_piece(search, part, source, carried_ways(search, part, source), depth + 1)
    else:
        search.add_valid(ids, source.slits)


def carried_ways(search: Search, ids: NDArray[np.int64], source: Piece) -> list[Piece | Overlapping | None]:
    """A chart of the proxy on the faces ids (m,): laid out as there, anew with its slits, or with slits of its own.

    Ends with the first of these that stretches about as little as the proxy's chart.
    """
    if is_the_same(search.surface, ids, source):
        return [source]
    config = search.config.carry
    enough = config.worse * source.energy + config.slack * float(search.areas[ids].sum()) / search.area
    found: list[Piece | Overlapping | None] = []
    for slits, start in (
        (source.slits, lambda disk: carried_uv(disk, source.flat, config)),
        (source.slits, None),
        ((), None),
    ):
        found.append(search.try_piece(ids, slits, start))
        if isinstance(found[-1], Piece) and found[-1].energy <= enough:
            break
    return found


def is_the_same(surface: Surface, ids: NDArray[np.int64], source: Piece) -> bool:
    """True where a source consists of the faces ids (m,) of this very surface."""
    here = np.array_equal(ids, np.sort(source.ids))
    return here and np.array_equal(surface.triangles[source.ids], source.flat.surface.triangles)


def votes(near: NDArray[np.int64]) -> NDArray[np.float64]:
    """(f, k) share of each label among those of the faces (f, n) of the proxy that are nearest."""
    return np.stack([(near == k).mean(axis=1) for k in range(int(near.max()) + 1)], axis=1)


def smoothed_in_band(
    share: NDArray[np.float64], areas: NDArray[np.float64], graph: DualGraph, config: FinishConfig
) -> NDArray[np.int64]:
    """Labels (f,) of short borders, from the share of votes (f, k).

    A face may take the labels that were voted for within a few rings of it, which away from borders is its own alone.
    """
    doubt = -np.log(np.maximum(share, 1e-3)) * areas[:, None] / config.labels.smoothing
    doubt[~within_reach(share > 0.0, graph, config.carry.band)] = WALL
    return smooth_labels(doubt, graph)


def within_reach(marked: NDArray[np.bool_], graph: DualGraph, rings: int) -> NDArray[np.bool_]:
    """(f, k) bool: what is marked at a face, or at another within so many rings of it."""
    count = len(marked)
    pairs = np.concatenate([graph.pairs, graph.pairs[:, ::-1], np.repeat(np.arange(count)[:, None], 2, axis=1)])
    links = sparse.csr_array((np.ones(len(pairs), dtype=np.int32), tuple(pairs.T)), shape=(count, count))
    found = sparse.csr_array(marked.astype(np.int32))
    for _ in range(rings):
        found = sparse.csr_array(links @ found)
        found.data[:] = 1
    return found.toarray() > 0


def fragments_joined(
    label: NDArray[np.int64], areas: NDArray[np.float64], graph: DualGraph, islet: float
) -> NDArray[np.int64]:
    """Connected pieces (f,), numbered 0…: each label's largest, and what else has at least ``islet`` of the area.

    Smaller fragments join the neighbour of longest border.  A larger one may not: half a limb that lost its narrow base
    would make a closed limb of the other half, which no disk can carry.
    """
    least_area = islet * float(areas.sum())
    part = connected_pieces(label, graph)
    between = contracted(part, graph)  # thousands of crumbs are joined one by one: not on the faces
    area, of_part = np.bincount(part, areas), np.zeros(int(part.max()) + 1, dtype=np.int64)
    of_part[part] = label
    while True:
        piece = connected_pieces(of_part, between)
        count = int(piece.max()) + 1
        size = np.bincount(piece, area, minlength=count)
        of = np.zeros(count, dtype=np.int64)
        of[piece] = of_part
        largest = np.zeros(count, dtype=bool)
        order = np.lexsort((np.arange(count), -size, of))
        largest[order[np.unique(of[order], return_index=True)[1]]] = True
        fragments = np.flatnonzero(~largest & (size < least_area))
        if len(fragments) == 0:
            return piece[part]
        least = fragments[size[fragments].argmin()]
        border = borders_of(least, piece, count, between)
        of_part = np.where(piece == least, of[border.argmax()], of_part)
