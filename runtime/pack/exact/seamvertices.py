"""Seams become vertices: those of an atlas, doubled where uv differ, and their normals.

n file vertices · a atlas vertices · f faces.  uv is v up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...geometry.normals import smooth_normals
from ...geometry.rows import first_places

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...mesh import Asset


def split_vertices(
    faces: NDArray[np.int64], face_chart: NDArray[np.int64], corner_uv: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """One atlas vertex per (file vertex, chart, distinct uv).

    Args:
        faces: (f, 3) int64 file vertices.
        face_chart: (f,) int64.
        corner_uv: (f, 3, 2) float64.

    Returns:
        (f, 3) int64 faces over atlas vertices, (a,) int64 the file vertex of each, ascending, and (a, 2) float64 uv.
    """
    vertex, chart, uv = faces.reshape(-1), np.repeat(face_chart, 3), corner_uv.reshape(-1, 2)
    found = first_places(vertex)
    copies = (found < len(vertex)).astype(np.int64)  # of each file vertex; most have one
    like = found[vertex]
    split = np.zeros(len(found), dtype=bool)
    split[vertex[(chart != chart[like]) | (uv != uv[like]).any(axis=1)]] = True
    rows = np.flatnonzero(split[vertex])
    order = rows[np.lexsort((uv[rows, 1], uv[rows, 0], chart[rows], vertex[rows]))]
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (vertex[order][1:] != vertex[order][:-1]) | (chart[order][1:] != chart[order][:-1])
    fresh[1:] |= (uv[order][1:] != uv[order][:-1]).any(axis=1)
    seam = order[fresh]
    copies[split] = np.bincount(vertex[seam], minlength=len(found))[split]
    before = np.cumsum(copies) - copies
    of_corner = before[vertex]
    number = np.cumsum(fresh) - 1
    of_corner[order] += number - np.searchsorted(vertex[seam], vertex[order])
    source = np.repeat(np.arange(len(found)), copies)
    first = found[source]
    first[of_corner[seam]] = seam
    return of_corner.reshape(-1, 3), source, uv[first]


def atlas_normals(asset: Asset, source_vertex: NDArray[np.int64]) -> NDArray[np.float32]:
    """(a, 3) float32 unit normals: the file's own where it has them, else smooth normals of the welded surface."""
    if asset.normals is None:
        return smooth_normals(asset.surface)[asset.weld[source_vertex]].astype(np.float32)
    normals = asset.normals[source_vertex]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    smooth = smooth_normals(asset.surface)[asset.weld[source_vertex]]
    with np.errstate(invalid="ignore"):
        return np.where(length > 0.0, normals / length, smooth).astype(np.float32)
