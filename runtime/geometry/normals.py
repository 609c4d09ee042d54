"""Normals and tangents of a surface.   v vertices · f faces · n vectors.  Unit vectors, right-handed frames."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .triangles import corner_angles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Surface


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
