"""Per-element losses of the paper's cycles.   n points · p patches.

Unreduced: ``weighted_mean`` is the only reduction, so a chart probability, a mask or 1 weights every loss the same way.
"""

from __future__ import annotations

import torch
from torch import Tensor


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
