"""Distortion of single faces, from the Jacobian of the map from a triangle on the surface to its uv triangle.

f faces; jacobian (f, 2, 2) float64 of `triangles.jacobians`, surface and uv already in comparable units.  σ₁ ≥ σ₂ ≥ 0
are its singular values; 1, 1 = isometric.  One value per face: weighting and reduction are the caller's.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

TRIM = 100.0
"""Most that one face can contribute to a symmetric Dirichlet mean."""
MOST_EXCESS = 10.0
"""Most excess energy of one face that counts where charts are compared, so that no sliver decides."""


def singular_values(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """(2, f) float64 singular values σ₁ ≥ σ₂ ≥ 0 of jacobian (f, 2, 2)."""
    (a, b), (c, d) = jacobian.transpose(1, 2, 0)
    total, difference = np.hypot(a + d, c - b), np.hypot(a - d, c + b)
    return np.stack([total + difference, np.abs(total - difference)]) / 2.0


def symmetric_dirichlet(large: NDArray[np.float64], small: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) symmetric Dirichlet energy (σ₁² + σ₂² + σ₁⁻² + σ₂⁻²) / 4 of σ₁ and σ₂, (f,) each; 1 = isometric."""
    large, small = np.maximum(large, 1e-12), np.maximum(small, 1e-12)
    return (large**2 + small**2 + large**-2 + small**-2) / 4.0


def oriented_energy(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) symmetric Dirichlet energy of jacobian (f, 2, 2), from ‖J‖² and |J|; ∞ for a flip or a collapse."""
    frobenius = (jacobian**2).sum(axis=(1, 2))
    determinant = np.linalg.det(jacobian)
    with np.errstate(divide="ignore", invalid="ignore"):
        energy = frobenius * (1.0 + determinant**-2) / 4.0
    return np.where(determinant > 0.0, energy, np.inf)


def excess(energy: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) what an energy (f,) has above isometry, at most `MOST_EXCESS` per face, and by no rounding less than 0."""
    return np.clip(energy - 1.0, 0.0, MOST_EXCESS)
