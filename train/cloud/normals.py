"""Neighbours, spacing, and normals of a point cloud: fitted planes, oriented along a spanning tree.

d points · k neighbours, nearest first, the point itself not among them.  Lengths in the units of the points.
Planes by weighted principal components; orientation by a minimum spanning tree (Hoppe et al. 1992), the sign handed on
by reflection (Xie et al. 2003), which also holds around rims and across thin sheets.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.spatial import KDTree

from ...runtime.geometry.rows import distinct
from ...runtime.kernel.choice import kernel
from ...runtime.process.cores import core_count

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import CloudConfig

_BLOCK = 65536
_SIXTH = 6
_LEAST_COST = 1e-6  # scipy takes a weight of zero for no edge


def nearest_neighbours(points: NDArray[np.float64], k: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The k nearest other points of each point (fewer where there are fewer).

    Args:
        points: (d, 3) float64, all different, d ≥ 2.
        k: how many, ≥ 1.

    Returns:
        (d, k) int64 indices and (d, k) float64 distances, ascending.
    """
    return neighbours_of(np.arange(len(points)), points, k)


def neighbours_of(
    rows: NDArray[np.int64], points: NDArray[np.float64], k: int
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The same for some of the points: rows (m,) → (m, k) and (m, k).

    They are asked for in the order of the tree's leaves, one after the other in the same place of memory.
    """
    tree = KDTree(points)
    wanted = np.zeros(len(points), dtype=bool)
    wanted[rows] = True
    order = tree.indices[wanted[tree.indices]]
    found, place = tree.query(points[order], k=min(k + 1, len(points)), workers=core_count())
    row = np.full(len(points), -1)
    row[order] = np.arange(len(order))
    distance, index = np.asarray(found, dtype=np.float64), np.asarray(place, dtype=np.int64)
    return index[row[rows], 1:], distance[row[rows], 1:]


def thinned_out(
    points: NDArray[np.float64], k: int, closest: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Points that are not closer to an earlier one than a share ``closest`` of their spacing.

    Returns:
        (m,) int64 those points, and (m, k) int64 and (m, k) float64 their nearest neighbours among themselves.
    """
    chosen = np.arange(len(points))
    index, distance = nearest_neighbours(points, k)
    while True:
        spacing = local_spacing(distance)
        apart: NDArray[np.bool_] = (distance[:, 0] >= closest * spacing) | (index[:, 0] > np.arange(len(chosen)))
        if apart.all():
            return chosen, index, distance
        number = np.full(len(chosen), -1)
        number[apart] = np.arange(np.count_nonzero(apart))
        chosen, index, distance = chosen[apart], number[index[apart]], distance[apart]
        stale = np.flatnonzero((index < 0).any(axis=1))  # all others have the neighbours that they had
        if len(chosen) <= index.shape[1]:
            index, distance = nearest_neighbours(points[chosen], k)
        else:
            index[stale], distance[stale] = neighbours_of(stale, points[chosen], k)


def local_spacing(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """(d,) about 1/√(points per area), from the distances (d, k) to the nearest others: r₆ ≈ √(6/π) spacings."""
    sixth = min(_SIXTH, distance.shape[1])
    return distance[:, sixth - 1] * np.sqrt(np.pi / sixth)


def fitted_normals(
    points: NDArray[np.float64],
    index: NDArray[np.int64],
    distance: NDArray[np.float64],
    config: CloudConfig,
    given: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """Normals of planes fitted to neighbours, with the signs of those given, else arbitrary.

    Neighbours whose given normals point the other way (the far side of a thin sheet) are left out.

    Args:
        points: (d, 3) float64.
        index: (d, k) int64 neighbours.
        distance: (d, k) float64 to them.
        config: numbers.
        given: (d, 3) float64 unit, oriented, zero where unknown, or None.

    Returns:
        (d, 3) float64 unit.
    """
    k = min(config.plane_neighbours, index.shape[1])
    scale = config.plane_scale * local_spacing(distance)
    weight = np.exp(-2.0 * (distance[:, :k] / distance[:, k - 1, None]) ** 2)
    if given is not None:
        for start in range(0, len(points), _BLOCK):
            rows = slice(start, start + _BLOCK)
            weight[rows] *= np.einsum("bkc,bc->bk", given[index[rows, :k]], given[rows]) > config.opposite
    if compiled := kernel():
        normals = compiled.planes(points, index, weight, scale, config.plane_rounds, core_count())
    else:
        normals = planes(points, index[:, :k], weight, scale, config.plane_rounds)
    if given is None:
        return normals
    cosine = np.einsum("dc,dc->d", normals, given)
    doubtful = (np.abs(cosine) < config.doubtful) & given.any(axis=1)
    return np.where(doubtful[:, None], given, normals * np.where(cosine < 0.0, -1.0, 1.0)[:, None])


def planes(
    points: NDArray[np.float64],
    index: NDArray[np.int64],
    weight: NDArray[np.float64],
    scale: NDArray[np.float64],
    rounds: int,
) -> NDArray[np.float64]:
    """(d, 3) unit normals, of either sign, of planes through points (d, 3) and neighbours (d, k) of weights (d, k).

    A point off its plane by scale (d,) counts half in the next of the rounds.
    """
    normals = np.zeros_like(points)
    for start in range(0, len(points), _BLOCK):
        rows = slice(start, start + _BLOCK)
        way = points[index[rows]] - points[rows, None]
        around = np.concatenate([np.zeros((len(way), 1, 3)), way], axis=1)
        near = np.concatenate([np.ones((len(way), 1)), weight[rows]], axis=1)
        normals[rows] = _planes(around, near, scale[rows, None], rounds)
    return normals


def _planes(
    around: NDArray[np.float64], near: NDArray[np.float64], scale: NDArray[np.float64], rounds: int
) -> NDArray[np.float64]:
    """(b, 3) of offsets (b, k, 3) of weights (b, k); scale (b, 1)."""
    weight, normal = near, np.zeros((len(around), 3))
    for number in range(rounds + 1):
        total = weight / weight.sum(axis=1, keepdims=True)
        centred = around - np.einsum("bk,bkc->bc", total, around)[:, None]
        spread = np.einsum("bk,bkc,bke->bce", total, centred, centred, optimize=True)
        normal = np.linalg.eigh(spread)[1][:, :, 0]
        if number < rounds:
            off = np.einsum("bkc,bc->bk", centred, normal) / scale
            weight = near / (1.0 + off**2)
    return normal


def oriented_normals(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    index: NDArray[np.int64],
    spacing: NDArray[np.float64],
    config: CloudConfig,
) -> NDArray[np.float64]:
    """The normals with signs that agree with their neighbours'; outwards for each closed connected piece.

    The sign of a piece follows the divergence theorem: ∫ n·(p − c) dA is thrice the volume inside.

    Args:
        points: (d, 3) float64.
        normals: (d, 3) float64 unit, of any sign.
        index: (d, k) int64 neighbours.
        spacing: (d,) float64 local spacing.
        config: numbers.
    """
    count = len(points)
    one, other, agreement = _links(points, normals, index[:, : config.tree_neighbours])
    cost = 1.0 - np.abs(agreement) + _steepness(points, normals, one, other) ** 2 + _LEAST_COST
    tree = minimum_spanning_tree(coo_matrix((cost, (one, other)), shape=(count, count)).tocsr()).tocoo()
    here, there = tree.row.astype(np.int64), tree.col.astype(np.int64)
    twist = (_agreement(points, normals, here, there) < 0.0).astype(np.int64)
    # Each point stands twice, as it is (i) and turned round (i + count); tree links join the copies that agree.
    row = np.concatenate([here, here + count])
    column = np.concatenate([there + twist * count, there + (1 - twist) * count])
    side = _components(row, column, 2 * count)
    piece = _components(here, there, count)
    # One side of each piece, that of its first point as it is, decides about all.
    chosen = side[np.unique(piece, return_index=True)[1]][piece]
    signed = np.where((side[:count] == chosen)[:, None], normals, -normals)
    return signed * np.where(_outward(points, signed, spacing, piece), 1.0, -1.0)[:, None]


def _outward(
    points: NDArray[np.float64], normals: NDArray[np.float64], spacing: NDArray[np.float64], piece: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """(d,) bool: the normals of the point's piece enclose a volume that is not negative."""
    mass = np.bincount(piece)
    centre = np.stack([np.bincount(piece, column) / mass for column in points.T], axis=1)
    flux = np.einsum("dc,dc->d", normals, points - centre[piece]) * spacing**2
    return (np.bincount(piece, flux) >= 0.0)[piece]


def turned_to(
    normals: NDArray[np.float64], given: NDArray[np.float64], index: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Consistent normals (d, 3) turned, point by point, to the side that given ones (zero = unknown) nearby are on."""
    side = np.sign(np.einsum("dc,dc->d", normals, given))
    vote = np.where(side == 0.0, side[index].sum(axis=1), side)
    return np.where(vote[:, None] < 0.0, -normals, normals)


def disagreement(
    points: NDArray[np.float64], normals: NDArray[np.float64], index: NDArray[np.int64], config: CloudConfig
) -> float:
    """How far given normals are from an orientation: 0 consistent, 0.5 random signs.

    The share of links to neighbours across which normals turn over, times 1 − |mean side of the other point|: across a
    thin sheet they turn over too, but there the other point always lies below the tangent plane (across a gap, above).

    Args:
        points: (d, 3) float64.
        normals: (d, 3) float64 unit or zero.
        index: (d, k) int64 neighbours.
        config: numbers.
    """
    one, other, agreement = _links(points, normals, index)
    turned = agreement < -config.decisive
    if not turned.any():
        return 0.0
    way = points[other[turned]] - points[one[turned]]
    side = np.sign(np.einsum("mc,mc->m", way, normals[one[turned]]))
    return float(turned.sum() / np.count_nonzero(np.abs(agreement) > config.decisive) * (1.0 - np.abs(side.mean())))


def _links(
    points: NDArray[np.float64], normals: NDArray[np.float64], index: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Each pair of neighbours once: (m,) lower point, (m,) higher point, (m,) their agreement."""
    count, k = index.shape
    start = np.repeat(np.arange(count), k)
    end = index.reshape(-1)
    key = distinct(np.minimum(start, end) * count + np.maximum(start, end))
    one, other = key // count, key % count
    return one, other, _agreement(points, normals, one, other)


def _agreement(
    points: NDArray[np.float64], normals: NDArray[np.float64], one: NDArray[np.int64], other: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(m,) cosine of one normal, reflected into the other point along a circle through both, with the other normal."""
    way = points[other] - points[one]
    way /= np.maximum(np.linalg.norm(way, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    along = np.einsum("mc,mc->m", normals[one], way)[:, None]
    return np.einsum("mc,mc->m", normals[one] - 2.0 * along * way, normals[other])


def _steepness(
    points: NDArray[np.float64], normals: NDArray[np.float64], one: NDArray[np.int64], other: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(m,) larger sine between the way from one point to the other and their two tangent planes."""
    way = points[other] - points[one]
    rise = [np.abs(np.einsum("mc,mc->m", way, normals[end])) for end in (one, other)]
    return np.maximum(*rise) / np.maximum(np.linalg.norm(way, axis=1), np.finfo(np.float64).tiny)


def _components(row: NDArray[np.int64], column: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    graph = coo_matrix((np.ones(len(row), dtype=np.int8), (row, column)), shape=(count, count))
    return connected_components(graph.tocsr(), directed=False)[1].astype(np.int64)
