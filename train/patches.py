"""Patches: parts of a chart on which uv is a smooth function of position, one Unwrap-Net each.   unit ball.

A network sees a point, not the face it lies on.  Where two faces of one chart are close in space and far apart in uv (the two
sides of a slit, of an ear, of a thin sheet), one smooth map can't answer for both: the chart is halved between them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import cKDTree

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Surface
    from .config import PatchConfig
    from .pieces import Piece


class Conflict(NamedTuple):
    """Two faces (positions in a piece) that are close in space and far apart in uv."""

    first: int
    second: int


def split_into_patches(surface: Surface, piece: Piece, config: PatchConfig) -> NDArray[np.int64]:
    """Patch (m,), numbered from 0, of each face of a piece."""
    uv = piece.flat.uv[piece.flat.surface.faces].mean(axis=1)
    xyz = surface.triangles[piece.ids].mean(axis=1)
    links = joined_faces(piece.flat.surface.faces, xyz)
    patch = np.zeros(len(piece.ids), dtype=np.int64)
    open_patches, count = [0], 1
    while open_patches and count < config.most:
        members = np.flatnonzero(patch == open_patches[-1])
        conflict = worst_conflict(xyz[members], uv[members], config)
        if conflict is None:
            open_patches.pop()
            continue
        inside = links[members][:, members]
        distance = dijkstra(inside, directed=False, indices=[conflict.first, conflict.second])
        patch[members[distance[1] < distance[0]]] = count
        open_patches.append(count)
        count += 1
    return patch


def joined_faces(faces: NDArray[np.int64], centroids: NDArray[np.float64]) -> sparse.csr_array:
    """(m, m) distances between the centroids of faces that share an edge of the flattened piece: slits don't join."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    owner = np.repeat(np.arange(len(faces)), 3)
    count = int(faces.max()) + 1
    along = sparse.csr_array((owner + 1, (start, end)), shape=(count, count))
    back = along.T.tocsr()
    shared = along.multiply(back > 0).tocoo()
    twin = back.multiply(along > 0).tocoo()
    i, j = shared.data - 1, twin.data - 1
    step = np.linalg.norm(centroids[i] - centroids[j], axis=1) + 1e-9
    return sparse.csr_array((step, (i, j)), shape=(len(faces), len(faces)))


def worst_conflict(xyz: NDArray[np.float64], uv: NDArray[np.float64], config: PatchConfig) -> Conflict | None:
    """The pair within ``config.reach`` in space whose uv lie farthest apart, if farther than smoothness allows.

    Near in space means near in uv for a smooth map with singular values around 1: farther than ``config.stretch`` · distance
    plus ``config.gap`` is a tear.
    """
    if len(xyz) < 4:
        return None
    near = min(config.neighbours, len(xyz))
    distance, index = cKDTree(xyz).query(xyz, k=near, distance_upper_bound=config.reach)
    row = np.repeat(np.arange(len(xyz)), near)
    found = np.isfinite(distance.reshape(-1))
    row, other, distance = row[found], index.reshape(-1)[found], distance.reshape(-1)[found]
    tear = np.linalg.norm(uv[row] - uv[other], axis=1) - config.stretch * distance - config.gap
    worst = int(tear.argmax())
    return Conflict(int(row[worst]), int(other[worst])) if tear[worst] > 0.0 else None
