"""Per-element losses of the multi-chart mode.   n points · p patches · jets (3, …) = (value, ∂/∂t₁, ∂/∂t₂).

Unreduced: ``weighted_mean`` is the only reduction, so a chart probability, a mask or 1 weights every loss the same way.
"""

from __future__ import annotations

import torch
from torch import Tensor


def arap_energy(jacobian: Tensor, *, eps: float = 1e-12) -> Tensor:
    """‖J − R‖² to the closest rotation R, = (σ₁ − 1)² + (σ₂ − 1)² with σ₂ < 0 for a flip.   (2, …, 2) → (…).

    ``jacobian[i]`` is the derivative of uv along unit tangent i.  max_R tr(RᵀJ) = √((a + d)² + (b − c)²), so no SVD is
    needed; eps keeps the gradient finite where that root vanishes (J zero or a reflection).
    """
    (a, c), (b, d) = jacobian[0].unbind(-1), jacobian[1].unbind(-1)
    trace = torch.sqrt((a + d) ** 2 + (b - c) ** 2 + eps)
    return a * a + b * b + c * c + d * d + 2.0 - 2.0 * trace


def position_gap(xyz: Tensor, target: Tensor) -> Tensor:
    """|P − P_cycle|₁ per point (paper, cycle consistency loss): (…, n, 3), (n, 3) → (…, n)."""
    return (xyz - target).abs().sum(dim=-1)


def cosine_gap(vector: Tensor, unit: Tensor, *, eps: float = 1e-8) -> Tensor:
    """1 − cos∠(vector, unit): (…, n, 3), (n, 3) → (…, n), in [0, 2]; finite gradient at vector = 0."""
    norm = torch.sqrt((vector * vector).sum(dim=-1) + eps)
    return 1.0 - (vector * unit).sum(dim=-1) / norm


def weighted_mean(value: Tensor, weight: Tensor) -> Tensor:
    """Σ weight · value / n over (p, n): the mean over points of the expectation over patches."""
    return (value * weight).sum() / value.shape[-1]
