"""Cutting a set of faces in two: between parts that overlap once flat, at a neck, or half way.   m faces."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components, dijkstra

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .labels import DualGraph


class Links:
    """Dual edges inside a set of faces ids (m,): i, j (e,) positions in ids; length and cost (e,) of a seam there."""

    def __init__(self, ids: NDArray[np.int64], graph: DualGraph, count: int) -> None:
        position = np.full(count, -1, dtype=np.int64)
        position[ids] = np.arange(len(ids))
        i, j = position[graph.pairs].T
        inside = (i >= 0) & (j >= 0)
        self.ids = ids
        self.i, self.j = i[inside], j[inside]
        self.length, self.cost = graph.length[inside], graph.cost[inside]

    def parts(self, side: NDArray[np.bool_]) -> list[NDArray[np.int64]]:
        """Connected parts, as faces, once the edges between the two sides (m,) are cut."""
        same = side[self.i] == side[self.j]
        size = len(self.ids)
        matrix = sparse.coo_array((np.ones(int(same.sum())), (self.i[same], self.j[same])), shape=(size, size))
        count, part = connected_components(matrix, directed=False)
        return [self.ids[part == number] for number in range(count)]

    def cut_length(self, side: NDArray[np.bool_]) -> float:
        """Length of the border between the two sides (m,)."""
        return float(self.length[side[self.i] != side[self.j]].sum())

    def distance(self, centroids: NDArray[np.float64], seeds: NDArray[np.int64]) -> NDArray[np.float64]:
        """(m,) distance of each face from the nearest at positions ``seeds``, from centroid to centroid."""
        step = np.linalg.norm(centroids[self.ids[self.i]] - centroids[self.ids[self.j]], axis=1) + 1e-12
        size = len(self.ids)
        matrix = sparse.csr_array((step, (self.i, self.j)), shape=(size, size))
        return dijkstra(matrix, directed=False, indices=seeds, min_only=True)


def overlap_sides(faces: NDArray[np.int64], pairs: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Two sets of faces, as rows of faces (m, 3), that lie over each other, from the pairs (p, 2) that do.

    They are the two connected patches with most overlap between them, or two faces where a patch lies over itself.
    """
    involved, index = np.unique(pairs, return_inverse=True)
    vertex = faces[involved].reshape(-1)
    row = np.repeat(np.arange(len(involved)), 3)
    incidence = sparse.csr_array((np.ones(len(row)), (row, vertex)), shape=(len(involved), int(faces.max()) + 1))
    patch = connected_components(incidence @ incidence.T, directed=False)[1]
    sides = patch[index.reshape(-1, 2)]
    apart = sides[:, 0] != sides[:, 1]
    if not apart.any():
        return pairs[:1, 0], pairs[:1, 1]
    kinds, kind, count = np.unique(np.sort(sides[apart], axis=1), axis=0, return_inverse=True, return_counts=True)
    most = kind.reshape(-1) == count.argmax()
    chosen, low = pairs[apart][most], sides[apart][most][:, :1] == kinds[count.argmax(), 0]
    return np.unique(np.where(low[:, 0], chosen[:, 0], chosen[:, 1])), np.unique(
        np.where(low[:, 0], chosen[:, 1], chosen[:, 0])
    )


def cut_between(
    links: Links,
    centroids: NDArray[np.float64],
    areas: NDArray[np.float64],
    sides: tuple[NDArray[np.int64], NDArray[np.int64]],
    levels: int,
) -> NDArray[np.bool_]:
    """(m,) bool: the side of the first of two sets of positions, in a short cut that leaves both some area.

    Among isolines of the share of the way from one set to the other, the one of least length / √smaller area.
    """
    first, second = (links.distance(centroids, side) for side in sides)
    way = first / np.maximum(first + second, 1e-300)
    isolines = np.quantile(way, np.linspace(0.0, 1.0, levels + 2)[1:-1])
    isolines = np.minimum(isolines, way[way < way.max()].max())  # where many are farthest: some faces on either side
    area = areas[links.ids]
    share = np.array([area[way <= level].sum() for level in isolines]) / area.sum()
    crossing = np.array([links.cut_length(way <= level) for level in isolines])
    quality = crossing / np.sqrt(np.maximum(np.minimum(share, 1.0 - share), 1e-9))
    return way <= isolines[int(quality.argmin())]


def halves(links: Links, centroids: NDArray[np.float64]) -> list[NDArray[np.int64]]:
    """The faces cut in two at half their distance from the face farthest from their mean, as connected parts."""
    points = centroids[links.ids]
    seed = int(np.linalg.norm(points - points.mean(axis=0), axis=1).argmax())
    distance = links.distance(centroids, np.array([seed]))
    return links.parts(distance < np.median(distance))  # the seed alone at least, and never the farthest


def necks(
    links: Links,
    centroids: NDArray[np.float64],
    areas: NDArray[np.float64],
    seed: int,
    levels: int,
    outermost: float,
    tries: int,
) -> list[list[NDArray[np.int64]]]:
    """The shortest borders between the faces near a seed and the rest: isolines of distance, by length / √smaller area.

    Where an isoline leaves more than two parts, one of the largest is taken off and the others stay together.
    seed: position in ids.  levels, outermost: isolines at so many quantiles, from ``outermost`` to 1 − outermost.
    Returns up to ``tries`` splittings into two connected parts.
    """
    distance = links.distance(centroids, np.array([seed]))
    area = areas[links.ids]
    isolines = np.quantile(distance, np.linspace(outermost, 1.0 - outermost, levels))
    crossing = np.array([links.cut_length(distance <= level) for level in isolines])
    share = np.array([area[distance <= level].sum() for level in isolines]) / area.sum()
    quality = crossing / np.sqrt(np.maximum(np.minimum(share, 1.0 - share), 1e-9))
    minima = [n for n in range(levels) if quality[n] <= quality[max(n - 2, 0) : n + 3].min()]
    found: list[list[NDArray[np.int64]]] = []
    for n in sorted(minima, key=lambda n: quality[n])[:tries]:
        parts = sorted(links.parts(distance <= isolines[n]), key=lambda part: -areas[part].sum())
        for apart in parts[: min(len(parts) - 1, 2)]:
            rest = np.setdiff1d(links.ids, apart)
            on = np.isin(links.ids, apart)
            if len(links.parts(on)) == 2:
                found.append([apart, rest])
    return found[:tries]
