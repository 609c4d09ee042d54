"""Tangent frames per atlas vertex: the ones written to the file are the ones the normal map is baked in.

n atlas vertices · f faces.  The tangent points along growing u, the bitangent w · (normal × tangent) along growing v
(v up), which is what glTF calls +Y.  After MikkTSpace (Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited"):
each face's u direction is projected into the plane of the vertex normal, normalised, weighted by the corner's angle
in that plane, summed.
Atlas vertices are split along seams, so the faces around one vertex lie in one chart, which is MikkTSpace's own
grouping for an atlas without mirrored faces; where faces of both orientations meet, the larger sum of angles decides.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Atlas

TINY = 1e-30


def vertex_tangents(atlas: Atlas) -> NDArray[np.float32]:
    """(n, 4) float32: unit tangent, perpendicular to the vertex normal, and w = ±1.

    A vertex whose faces have no uv area gets an arbitrary perpendicular direction and w = 1.
    """
    normal = unit(np.asarray(atlas.normals, np.float64))
    direction, sign = face_tangents(atlas)
    total = np.zeros((len(normal), 3))
    orientation = np.zeros(len(normal))
    for corner in range(3):
        vertex = atlas.faces[:, corner]
        along = unit(reject(direction, normal[vertex]))
        weight = corner_angles(atlas, normal, corner) * np.abs(sign)
        np.add.at(total, vertex, weight[:, None] * along)
        np.add.at(orientation, vertex, weight * sign)
    tangent = unit(reject(total, normal))
    lost = np.linalg.norm(tangent, axis=1) < 0.5
    tangent[lost] = any_perpendicular(normal[lost])
    return np.column_stack([tangent, np.where(orientation < 0.0, -1.0, 1.0)]).astype(np.float32)


def face_tangents(atlas: Atlas) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Direction of growing u on each face, (f, 3) not normalised, and the sign of its uv area, (f,) in {−1, 0, 1}."""
    corner, uv = atlas.positions[atlas.faces], atlas.corner_uv
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    uv_first, uv_second = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    sign = np.sign(uv_first[:, 0] * uv_second[:, 1] - uv_first[:, 1] * uv_second[:, 0])
    direction = (first * uv_second[:, 1:] - second * uv_first[:, 1:]) * sign[:, None]
    return direction, sign


def corner_angles(atlas: Atlas, normal: NDArray[np.float64], corner: int) -> NDArray[np.float64]:
    """(f,) angle in radians between the two edges at a corner, both projected into the plane of its vertex normal."""
    vertex = atlas.faces[:, corner]
    here, axis = atlas.positions[vertex], normal[vertex]
    ahead = unit(reject(atlas.positions[atlas.faces[:, (corner + 1) % 3]] - here, axis))
    behind = unit(reject(atlas.positions[atlas.faces[:, (corner + 2) % 3]] - here, axis))
    return np.arccos(np.clip(np.einsum("fi,fi->f", ahead, behind), -1.0, 1.0))


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…, 3) vectors at length 1; shorter than 1e-30 becomes zero."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.where(length > TINY, vector / np.maximum(length, TINY), 0.0)


def reject(vector: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…, 3) vector without its part along the unit axis."""
    return vector - np.einsum("...i,...i->...", vector, axis)[..., None] * axis


def any_perpendicular(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3) unit vectors perpendicular to unit normals: from the coordinate axis that is least along each."""
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    return unit(reject(axis, normal))
