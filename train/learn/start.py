"""The geometric start: K clusters of a surface, each projected onto its plane.   n samples · K clusters · unit ball.

Training from random weights collapses to two charts; from here it only has to move borders and bend planes.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import StartConfig


def farthest_points(feature: NDArray[np.float64], count: int, first: int) -> NDArray[np.int64]:
    """Indices (count,) of points picked one by one, each the farthest from those before; feature (n, c)."""
    chosen = np.full(count, first, dtype=np.int64)
    distance = np.full(len(feature), np.inf)
    for i in range(1, count):
        distance = np.minimum(distance, ((feature - feature[chosen[i - 1]]) ** 2).sum(axis=1))
        chosen[i] = distance.argmax()
    return chosen


def cluster(
    xyz: NDArray[np.float64], normal: NDArray[np.float64], count: int, config: StartConfig, rng: np.random.Generator
) -> NDArray[np.int64]:
    """k-means on (position, weight · normal) from farthest-point seeds: labels (n,) in [0, count)."""
    feature = np.concatenate([xyz, config.normal_weight * normal], axis=1)
    centre = feature[farthest_points(feature, count, int(rng.integers(len(feature))))]
    label = np.zeros(len(feature), dtype=np.int64)
    for _ in range(config.rounds):
        gap = (centre**2).sum(axis=1) - 2.0 * feature @ centre.T
        label = gap.argmin(axis=1)
        size = np.bincount(label, minlength=count)[:, None]
        total = np.stack([np.bincount(label, column, minlength=count) for column in feature.T], axis=1)
        centre = np.where(size > 0, total / np.maximum(size, 1), centre)
    return label


def plane_projection(
    xyz: NDArray[np.float64], normal: NDArray[np.float64], label: NDArray[np.int64], count: int
) -> NDArray[np.float64]:
    """Uv (count, n, 2): each point projected onto the plane of each cluster, seen from outside.

    Outside is where the mean normal points; where the normals cancel out, the plane faces the flattest direction.
    The axes are the cluster's principal directions within its plane; the origin is its mean.
    """
    uv = np.zeros((count, len(xyz), 2))
    for k in range(count):
        members = label == k
        if not members.any():
            continue
        centred = xyz - xyz[members].mean(axis=0)
        axis = normal[members].mean(axis=0)
        if np.linalg.norm(axis) < 1e-9:  # a sheet with two sides, a closed surface
            axis = np.linalg.svd(centred[members], full_matrices=False)[2][-1]
        axis /= np.linalg.norm(axis)
        flat = centred[members] - np.outer(centred[members] @ axis, axis)
        first = np.linalg.svd(flat, full_matrices=False)[2][0]
        first -= (first @ axis) * axis
        first /= max(np.linalg.norm(first), 1e-12)
        uv[k] = centred @ np.stack([first, np.cross(axis, first)], axis=1)
    return uv
