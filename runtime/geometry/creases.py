"""Normals where a file has none: smooth inside its smooth parts, broken along creases.   f faces · p pairs of faces.

Two faces along an edge are joined where the edge is smooth; the corners of faces that are joined around a vertex are a
fan, and share one normal.  Corner 3·face + i.  An edge whose two faces run along it in the same direction is a crease.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .normals import smooth_normals, unit
from .topology import edge_table, face_components, stable_order
from .triangles import corner_angles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Surface


def fan_normals(
    surface: Surface,
    angle: float,
    *,
    smoothing: NDArray[np.int64] | None = None,
    place: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """(f, 3, 3) float64 unit normals of corners: the mean over each fan, weighted by the faces' angles at the vertex.

    Args:
        surface: f faces.
        angle: between the normals of two faces, radians, above which their edge is a crease.
        smoothing: (f,) smoothing group of each face, 0 for a flat one: it decides in place of the angle.
        place: (f, 3) corner of a polygon that each corner is; the triangles of a polygon are always joined.
    """
    pairs = faces_along_edges(surface.faces)
    soft = smooth_pairs(surface, pairs // 3, angle) if smoothing is None else same_group(pairs // 3, smoothing)
    soft &= opposed(surface.faces, pairs)
    if soft.all() and smoothing is None:
        return smooth_normals(surface)[surface.faces]
    links = [corner_links(pairs[soft])]
    if place is not None:
        links.append(repeated(place.reshape(-1)))
    fan = face_components(surface.faces.size, np.concatenate(links))
    normal = surface.face_normals()
    weighted = (normal[:, None, :] * corner_angles(surface.triangles)[:, :, None]).reshape(-1, 3)
    total = np.zeros((int(fan.max()) + 1, 3))
    for axis in range(3):
        total[:, axis] = np.bincount(fan, weighted[:, axis])
    return unit(total[fan], np.repeat(normal, 3, axis=0)).reshape(-1, 3, 3)


def faces_along_edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(p, 2) half-edges of faces (f, 3) that follow each other along an edge, in face order."""
    return repeated(edge_table(faces).face_edges.reshape(-1))


def repeated(labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """(p, 2) places of labels (n,) that hold the same, each with the next such place."""
    order = stable_order(labels, int(labels.max(initial=0)) + 1)
    sorted_labels = labels[order]
    same = np.flatnonzero(sorted_labels[1:] == sorted_labels[:-1])
    return np.stack([order[same], order[same + 1]], axis=1)


def smooth_pairs(surface: Surface, faces: NDArray[np.int64], angle: float) -> NDArray[np.bool_]:
    """(p,) whether the normals of two faces (p, 2) are at most the angle apart, radians."""
    normal = surface.face_normals()[faces]
    return np.einsum("px,px->p", normal[:, 0], normal[:, 1]) >= np.cos(angle)


def same_group(faces: NDArray[np.int64], smoothing: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(p,) whether two faces (p, 2) are in one smoothing group."""
    group = smoothing[faces]
    return (group[:, 0] == group[:, 1]) & (group[:, 0] > 0)


def opposed(faces: NDArray[np.int64], pairs: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(p,) whether two half-edges (p, 2) run against each other, as those of faces with the same outside do."""
    start = faces.reshape(-1)[pairs]
    return start[:, 0] != start[:, 1]


def corner_links(pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """(2 p, 2) corners that meet at the two ends of half-edges (p, 2) which run against each other."""
    following = pairs - pairs % 3 + (pairs % 3 + 1) % 3
    ends = np.stack([pairs[:, 0], following[:, 1]], axis=1), np.stack([following[:, 0], pairs[:, 1]], axis=1)
    return np.concatenate(ends)
