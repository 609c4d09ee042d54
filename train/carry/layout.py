"""A flattening carried from one mesh to another of the same shape, as a field of rotations.   f faces · area 1.

Each face turns as the nearest face of the other mesh does, one sparse solve lays the faces out together, and a few
rigid steps settle what the other mesh did not show.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...runtime.process.cores import core_count
from ..finish.arap import RigidSteps, nearest_rotations
from ..finish.flatten import jacobians

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import CarryConfig
    from ..finish.slits import Flat

MANY = 50_000
"""Faces from which on several threads look for what is near; what they find is the same."""


def features(surface: Surface, config: CarryConfig) -> NDArray[np.float64]:
    """(f, 6) centroid and weighted normal of each face."""
    return np.concatenate([surface.triangles.mean(axis=1), config.normal_weight * surface.face_normals()], axis=1)


def face_frames(surface: Surface) -> NDArray[np.float64]:
    """(f, 3, 3) rows: along the first edge, across it, and the normal."""
    corner = surface.triangles
    along = corner[:, 1] - corner[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    normal = surface.face_normals()
    across = np.cross(normal, along).astype(np.float64)
    return np.stack([along, across, normal], axis=1)


def carried_uv(disk: Surface, source: Flat, config: CarryConfig) -> NDArray[np.float64]:
    """Uv (v, 2) of a piece of the surface, laid out as the proxy's piece is; it may hold flips."""
    turn = nearest_rotations(carried_jacobians(disk, source, nearest_faces(disk, source.surface, config)))
    return RigidSteps(disk).run(turn, config.rigid_steps)


def nearest_faces(disk: Surface, proxy: Surface, config: CarryConfig) -> NDArray[np.int64]:
    """(f,) the face of the proxy that lies nearest to each face, by position and normal."""
    return near_faces(disk, proxy, config, 1)[:, 0]


def near_faces(surface: Surface, proxy: Surface, config: CarryConfig, count: int) -> NDArray[np.int64]:
    """(f, count) the faces of the proxy that lie nearest to each face, the nearest first."""
    workers = core_count() if len(surface.faces) >= MANY else 1
    found = KDTree(features(proxy, config)).query(features(surface, config), k=count, workers=workers)[1]
    return np.asarray(found, dtype=np.int64).reshape(len(surface.faces), count)


def carried_jacobians(disk: Surface, source: Flat, nearest: NDArray[np.int64]) -> NDArray[np.float64]:
    """(f, 2, 2) the derivative in the plane of each face, as its nearest face (f,) of the proxy has it in its own."""
    frame, theirs = face_frames(disk), face_frames(source.surface)[nearest]
    turned = turned_into(frame[:, :2], frame[:, 2], theirs[:, 2])
    between = np.einsum("fic,fjc->fji", turned, theirs[:, :2])
    return jacobians(source.surface, source.uv)[nearest] @ nearest_rotations(between)


def turned_into(
    vectors: NDArray[np.float64], normal: NDArray[np.float64], other: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vectors (f, n, 3) turned by the least rotation that brings normal (f, 3) onto other (f, 3)."""
    axis = np.cross(normal, other)[:, None]
    cosine = np.einsum("fc,fc->f", normal, other)[:, None, None]
    once = np.cross(axis, vectors)
    return vectors + once + np.cross(axis, once) / np.maximum(1.0 + cosine, 1e-3)
