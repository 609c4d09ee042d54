"""First labels for the search: clusters of a part's faces by position and normal.   f faces · k clusters · area 1."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .labels import connected_pieces, islets_joined, smooth_labels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from .config import LabelConfig, StartConfig
    from .labels import DualGraph


def clusters(
    surface: Surface, graph: DualGraph, count: int, config: FinishConfig, rng: np.random.Generator
) -> NDArray[np.int64]:
    """Connected pieces (f,), numbered 0…: k-means of faces, its borders shortened and drawn into creases."""
    if count == 1:
        return connected_pieces(np.zeros(len(surface.faces), dtype=np.int64), graph)
    areas = surface.face_areas()
    doubt = distances(surface, areas, count, config.start, rng) * config.start.certainty
    label = smooth_labels(doubt * areas[:, None] / config.labels.smoothing, graph)
    return islets_joined(label, areas, graph, config.labels)


def pieces_by_score(
    score: NDArray[np.float64], areas: NDArray[np.float64], graph: DualGraph, config: LabelConfig
) -> NDArray[np.int64]:
    """Connected pieces (f,), numbered 0…, from log chart probabilities (f, k) at the faces."""
    label = smooth_labels(-score * areas[:, None] / config.smoothing, graph)
    return islets_joined(label, areas, graph, config)


def distances(
    surface: Surface, areas: NDArray[np.float64], count: int, config: StartConfig, rng: np.random.Generator
) -> NDArray[np.float64]:
    """(f, k) squared distance of each face from each cluster's centre, less that from its nearest."""
    feature = np.concatenate(
        [config.position_weight * surface.triangles.mean(axis=1), config.normal_weight * surface.face_normals()], axis=1
    )
    centre = feature[farthest_points(feature, count, int(rng.integers(len(feature))))]
    for _ in range(config.rounds):
        label = squared(feature, centre).argmin(axis=1)
        weight = np.bincount(label, areas, minlength=count)
        total = np.stack([np.bincount(label, areas * column, minlength=count) for column in feature.T], axis=1)
        centre = np.where(weight[:, None] > 0.0, total / np.maximum(weight, 1e-300)[:, None], centre)
    gap = squared(feature, centre)
    return gap - gap.min(axis=1, keepdims=True)


def farthest_points(feature: NDArray[np.float64], count: int, first: int) -> NDArray[np.int64]:
    """Indices (count,) of points picked one by one, each the farthest from those before; feature (n, c)."""
    chosen = np.full(count, first, dtype=np.int64)
    distance = np.full(len(feature), np.inf)
    for i in range(1, count):
        distance = np.minimum(distance, ((feature - feature[chosen[i - 1]]) ** 2).sum(axis=1))
        chosen[i] = distance.argmax()
    return chosen


def squared(feature: NDArray[np.float64], centre: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, k) squared distances of features (f, c) from centres (k, c)."""
    return ((feature[:, None] - centre[None]) ** 2).sum(axis=2)
