"""Places where several sheets of a surface coincide: a double-sided leaf, a wall of two skins.   n points · f faces.

A map that is asked by position alone cannot tell such sheets apart, and the answer of either is right.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ..geometry.rows import grouped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Atlas

TOUCH = 1e-6
"""Distance, as a share of the atlas's extent in space, up to which a point lies on a face: float32's rounding."""
NEIGHBOURS = 16
"""Faces of a chart, those of nearest centroids, that are looked at for each point."""


def uv_on_sheet(atlas: Atlas, points: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, 2) the uv that each point (n, 3) has on the chart (n,) named for it; NaN where none of its faces is there."""
    found = np.full((len(points), 2), np.nan)
    near, corner_uv = TOUCH * float(np.ptp(atlas.positions, axis=0).max()), atlas.corner_uv
    asked = grouped(chart)
    for faces, rows in zip(grouped(atlas.face_chart, len(asked)), asked, strict=False):
        if len(faces) == 0 or len(rows) == 0:
            continue
        corner = atlas.positions[atlas.faces[faces]]
        count = min(NEIGHBOURS, len(faces))
        index = KDTree(corner.mean(axis=1)).query(points[rows], k=count)[1].reshape(len(rows), count)
        weight, distance = barycentric(points[rows, None], corner[index])
        inside = (weight.min(axis=2) >= -TOUCH) & (distance <= near)
        best = inside.argmax(axis=1)
        at = np.arange(len(rows))
        uv = np.einsum("nc,ncx->nx", weight[at, best], corner_uv[faces[index[at, best]]])
        found[rows] = np.where(inside.any(axis=1)[:, None], uv, np.nan)
    return found


def barycentric(
    points: NDArray[np.float64], corners: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Weights (…, 3) of the corners (…, 3, 3) at the feet of the points (…, 3) on their planes, and the distances.

    NaN for triangles without area.
    """
    first, second = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    offset = points - corners[..., 0, :]
    aa, ab, bb = ((x * y).sum(axis=-1) for x, y in ((first, first), (first, second), (second, second)))
    a, b = (offset * first).sum(axis=-1), (offset * second).sum(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u, v = (bb * a - ab * b) / (aa * bb - ab**2), (aa * b - ab * a) / (aa * bb - ab**2)
    foot = u[..., None] * first + v[..., None] * second
    return np.stack([1.0 - u - v, u, v], axis=-1), np.linalg.norm(offset - foot, axis=-1)
