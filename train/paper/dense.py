"""The affine layer of the paper's networks, alone or many side by side.   n points · p copies · c channels."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn


class Dense(nn.Module):
    """One affine layer, or p of them side by side: (…, n, c_in) → (…, n, c_out).

    With ``copies`` = p the weight is (p, c_in, c_out) and the input (n, c_in) or (p, n, c_in).
    Initialised uniformly in ±√(3 gain / c_in): variance-preserving for SiLU at gain 2.
    """

    def __init__(
        self, inputs: int, outputs: int, *, copies: int | None = None, gain: float = 2.0, generator: torch.Generator
    ) -> None:
        super().__init__()
        shape = (inputs, outputs) if copies is None else (copies, inputs, outputs)
        bound = math.sqrt(3.0 * gain / inputs)
        self.weight = nn.Parameter((torch.rand(shape, generator=generator) * 2.0 - 1.0) * bound)
        self.bias = nn.Parameter(torch.zeros((1, outputs) if copies is None else (copies, 1, outputs)))

    def forward(self, x: Tensor) -> Tensor:
        """Affine map of the last axis."""
        return x @ self.weight + self.bias
