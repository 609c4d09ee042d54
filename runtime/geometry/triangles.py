"""Formulas of single triangles: areas, normals, angles, edges, and the affine map from one triangle to another.

f triangles; triangles (f, 3, 3) float64 in space or (f, 3, 2) in the plane, any units; uv (f, 3, 2), v up.  Angles in
radians.  One value per triangle (or corner, or edge): weighting and reduction are the caller's.  Edge i runs from
corner i to corner (i + 1) % 3.  Everything is rounded as float64 is; exact signs are in `overlap`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def cross_2d(first: NDArray[Any], second: NDArray[Any]) -> NDArray[Any]:
    """(…) z of the cross products of vectors first and second, (…, 2) each, any dtype: x₁ y₂ − y₁ x₂."""
    return first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]


def signed_areas(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) float64 signed areas of uv (f, 3, 2); positive = counter-clockwise."""
    return 0.5 * cross_2d(uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0])


def triangle_cross(triangles: NDArray[Any]) -> NDArray[Any]:
    """(…, 3) edge cross products of triangles (…, 3, 3): along the right-handed normal, twice the area long."""
    return np.stack(_cross(triangles), axis=-1)


def _cross(triangles: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any], NDArray[Any]]:
    """The three coordinates (…) of that, in half the time that np.cross takes for small arrays."""
    ax, ay, az = (triangles[..., 1, axis] - triangles[..., 0, axis] for axis in range(3))
    bx, by, bz = (triangles[..., 2, axis] - triangles[..., 0, axis] for axis in range(3))
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def triangle_areas(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…) areas of triangles (…, 3, 3), in their unit squared."""
    x, y, z = _cross(triangles)
    return 0.5 * np.sqrt(x * x + y * y + z * z)


def triangle_normals(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…, 3) unit normals of triangles (…, 3, 3), right-handed; zero for one without area."""
    cross = triangle_cross(triangles)
    return cross / np.maximum(np.linalg.norm(cross, axis=-1, keepdims=True), np.finfo(np.float64).tiny)


def corner_angles(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 3) angles of triangles (f, 3, 2 or 3), radians."""
    ahead = np.roll(triangles, -1, axis=1) - triangles
    back = np.roll(triangles, 1, axis=1) - triangles
    dot = (ahead * back).sum(axis=2)
    if triangles.shape[2] == 2:
        return np.arctan2(np.abs(cross_2d(ahead[:, 0], back[:, 0]))[:, None], dot)
    return np.arctan2(np.linalg.norm(np.cross(ahead[:, 0], back[:, 0]), axis=1)[:, None], dot)


def edge_lengths(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 3) edge lengths of triangles (f, 3, 2 or 3)."""
    return np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)


def jacobians(triangles: NDArray[np.float64], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Derivatives of the affine maps from triangles to uv, in an orthonormal basis of each triangle.

    The first axis runs along edge 0, the second to its left.  A triangle without area gets zeros.

    Args:
        triangles: (f, 3, 3) float64.
        uv: (f, 3, 2) float64.

    Returns:
        (f, 2, 2) float64: column i is the derivative along axis i.  Determinant > 0 where the orientation is kept.
    """
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    length, doubled = np.linalg.norm(first, axis=1), np.linalg.norm(np.cross(first, second), axis=1)
    width = np.where(length > 0.0, length, 1.0)
    height = np.where(doubled > 0.0, doubled, 1.0) / width
    foot = (first * second).sum(axis=1) / width
    along = (uv[:, 1] - uv[:, 0]) / width[:, None]
    across = (uv[:, 2] - uv[:, 0] - along * foot[:, None]) / height[:, None]
    return np.where((doubled > 0.0)[:, None, None], np.stack([along, across], axis=2), 0.0)
