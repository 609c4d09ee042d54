"""The shape behind the noise of a cloud: its points moved along their normals to where their neighbours say.

A scanner's noise tilts and wrinkles every triangle, as if the surface were larger than what was scanned, and of another
size each way.  Charts found on such triangles fold, tear and go to pieces.  They are found on the calm shape instead:
same triangles, other places.  What is written, and measured, are the points as they were given.

v vertices · f faces.  Lengths in source units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import CloudConfig

MEDIAN = 1.4826
"""Standard deviation of a normal distribution over the median of its sizes."""


def calm_shape(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    spacing: NDArray[np.float64],
    faces: NDArray[np.int64],
    config: CloudConfig,
) -> NDArray[np.float64] | None:
    """Points (v, 3) of faces (f, 3) moved along unit normals (v, 3); None where they show little noise.

    spacing: (v,) of the points.
    """
    mean = ring_means(faces, len(points))
    level = noise_level(points, normals, spacing, mean)
    if level < config.noise:
        return None
    farthest, height = config.farthest * level * spacing, np.zeros(len(points))
    for _ in range(config.calming):
        higher = height + heights(points + normals * height[:, None], normals, mean)
        height = np.clip(higher, -farthest, farthest)
    return points + normals * height[:, None]


def noise_level(
    points: NDArray[np.float64], normals: NDArray[np.float64], spacing: NDArray[np.float64], mean: sparse.csr_array
) -> float:
    """How far points (v, 3) typically lie off the mean of their neighbours, beyond how these do; in spacings (v,).

    Curvature and creases lift neighbours alike, or few of the points.  Noise counts about 1.35 times, as neighbours
    have it too.
    """
    height = heights(points, normals, mean)
    return MEDIAN * float(np.median(np.abs(height - mean @ height) / spacing))


def heights(points: NDArray[np.float64], normals: NDArray[np.float64], mean: sparse.csr_array) -> NDArray[np.float64]:
    """(v,) how far along its normal the mean of a vertex's neighbours lies above it."""
    return np.einsum("vc,vc->v", normals, mean @ points - points)


def ring_means(faces: NDArray[np.int64], count: int) -> sparse.csr_array:
    """(count, count) weights that give each vertex the mean of its neighbours; one without any its own place."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    alone = np.ones(count, dtype=bool)
    alone[start] = False
    lonely = np.flatnonzero(alone)
    both = np.concatenate([start, end, lonely]), np.concatenate([end, start, lonely])
    links = sparse.csr_array((np.ones(len(both[0]), dtype=np.float32), both), shape=(count, count))
    links.data[:] = 1.0  # an edge inside the surface was named twice
    degree = np.diff(links.indptr)
    weights = np.repeat(1.0 / degree, degree)
    return sparse.csr_array((weights, links.indices, links.indptr), shape=(count, count))
