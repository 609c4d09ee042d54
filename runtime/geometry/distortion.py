"""Distortion of single faces: what the affine map from a triangle to its uv triangle does.

f faces; triangles (f, 3, 3) float64 on the surface, uv (f, 3, 2) float64, both already in comparable units.  Angles in
radians.  One value per face (or corner, or edge): weighting and reduction are the caller's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

TRIM = 100.0
"""Most that one face can contribute to a symmetric Dirichlet mean."""


def singular_values(triangles: NDArray[np.float64], uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, f) float64 σ₁ ≥ σ₂ ≥ 0 of the affine maps triangles (f, 3, 3) → uv (f, 3, 2); 0 for faces without area."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    length, doubled = np.linalg.norm(first, axis=1), np.linalg.norm(np.cross(first, second), axis=1)
    width = np.where(length > 0.0, length, 1.0)
    height = np.where(doubled > 0.0, doubled, 1.0) / width
    foot = (first * second).sum(axis=1) / width
    column_x = (uv[:, 1] - uv[:, 0]) / width[:, None]
    column_y = (uv[:, 2] - uv[:, 0] - column_x * foot[:, None]) / height[:, None]
    a, b, c, d = column_x[:, 0], column_y[:, 0], column_x[:, 1], column_y[:, 1]
    total, difference = np.hypot(a + d, c - b), np.hypot(a - d, c + b)
    sigma = np.stack([total + difference, np.abs(total - difference)]) / 2.0
    return np.where(doubled > 0.0, sigma, 0.0)


def symmetric_dirichlet(large: NDArray[np.float64], small: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) symmetric Dirichlet energy (σ₁² + σ₂² + σ₁⁻² + σ₂⁻²) / 4; 1 = isometric, trimmed at TRIM."""
    large, small = np.maximum(large, 1e-12), np.maximum(small, 1e-12)
    return np.minimum((large**2 + small**2 + large**-2 + small**-2) / 4.0, TRIM)


def corner_angles(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 3) angles of triangles (f, 3, d), radians."""
    ahead = np.roll(triangles, -1, axis=1) - triangles
    back = np.roll(triangles, 1, axis=1) - triangles
    dot = (ahead * back).sum(axis=2)
    return np.arctan2(_doubled_area(ahead[:, 0], back[:, 0])[:, None], dot)


def edge_lengths(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 3) edge lengths of triangles (f, 3, d)."""
    return np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)


def _doubled_area(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) area of the parallelograms of edge vectors first and second, (f, 2) or (f, 3)."""
    if first.shape[1] == 2:
        return np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0])
    return np.linalg.norm(np.cross(first, second), axis=1)
