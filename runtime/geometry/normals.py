"""Normals and tangents of a surface, unit length.   v vertices · f faces · n vectors · angles in radians."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .triangles import corner_angles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Surface

CREASE = np.deg2rad(40.0)
"""Faces at a vertex whose normals differ by more don't share a vertex normal there."""


def smooth_normals(surface: Surface) -> NDArray[np.float64]:
    """(v, 3) float64 unit vertex normals: face normals weighted by the angle at the vertex; +z where they cancel."""
    weighted = surface.face_normals()[:, None, :] * corner_angles(surface.triangles)[:, :, None]
    total = np.zeros_like(surface.vertices)
    np.add.at(total, surface.faces.reshape(-1), weighted.reshape(-1, 3))
    length = np.linalg.norm(total, axis=1, keepdims=True)
    up = np.array([0.0, 0.0, 1.0])
    return np.where(length > 1e-12, total / np.maximum(length, 1e-12), up)


def tangent_frames(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-handed tangents (2, n, 3): t₁ × t₂ = normal, for unit normals (n, 3).  Duff et al. 2017, branchless ONB."""
    x, y, z = normal.T
    sign = np.copysign(1.0, z)
    a = -1.0 / (sign + z)
    b = x * y * a
    first = np.stack([1.0 + sign * x * x * a, sign * b, -sign * x], axis=1)
    second = np.stack([b, sign + y * y * a, -y], axis=1)
    return np.stack([first, second])


def corner_normals(surface: Surface, *, crease: float = CREASE) -> NDArray[np.float64]:
    """(f, 3, 3) float64 unit normals of the corners of faces: smooth across edges, sharp along creases.

    A corner averages the faces around its vertex whose normals lie within ``crease`` (radians) of its own face's,
    weighted by their angle there.
    """
    normal = surface.face_normals()
    weighted = (normal[:, None, :] * corner_angles(surface.triangles)[:, :, None]).reshape(-1, 3)
    vertex = surface.faces.reshape(-1)
    order = np.argsort(vertex, kind="stable")
    valence = np.bincount(vertex, minlength=len(surface.vertices))
    first = np.cumsum(valence) - valence
    count = valence[vertex]
    corner = np.repeat(np.arange(len(vertex)), count)
    step = np.arange(len(corner)) - np.repeat(np.cumsum(count) - count, count)
    other = order[first[vertex[corner]] + step]
    alike = np.einsum("nx,nx->n", normal[corner // 3], normal[other // 3]) > np.cos(crease)
    corner, other = corner[alike], other[alike]
    total = np.zeros((len(vertex), 3))
    for axis in range(3):
        total[:, axis] = np.bincount(corner, weighted[other, axis], len(vertex))
    return unit(total, normal[np.arange(len(vertex)) // 3]).reshape(-1, 3, 3)


def interpolated_normals(
    corners: NDArray[np.float64], face: NDArray[np.int64], barycentric: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 3) float64 unit normals inside faces (n,), from those of their corners (f, 3, 3)."""
    return unit(np.einsum("nc,ncx->nx", barycentric, corners[face]), corners[face, 0])


def unit(vectors: NDArray[np.float64], otherwise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (n, 3) at unit length; ``otherwise`` (n, 3) where they vanish."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), otherwise)
