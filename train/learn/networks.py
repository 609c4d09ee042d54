"""Networks of FlexPara's multi-chart mode (Zhao et al. 2025, section "Multi-Chart Neural Surface Parameterization").

n points · p patches (the paper's K charts) · xyz in the unit ball · uv in chart coordinates · d width.
All p Unwrap-Nets (and all p Wrap-Nets) are one batch of matrix products: no loop over patches.

A *jet* carries a value and its two directional derivatives, (3, n, c) = (value, ∂/∂t₁, ∂/∂t₂), through a network in
forward mode: two tangents cost about two more forward passes, where reverse mode would need one pass per output and a
second-order graph.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import NamedTuple

import torch
from torch import Tensor, nn

from ..config import NetConfig


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

    def among(self, x: Tensor, copies: Tensor) -> Tensor:
        """The same, by the layers ``copies`` (q,) int64 alone: (…, n, c_in) → (q, n, c_out)."""
        return x @ self.weight[copies] + self.bias[copies]

    def jet(self, x: Tensor) -> Tensor:
        """Value and tangents, (3, …, n, c): only the value gets the bias."""
        value, tangents = torch.split(x @ self.weight, [1, 2])
        return torch.cat([value + self.bias, tangents])


class Perceptron(nn.Module):
    """Dense layers with SiLU between them, none after the last.

    The paper takes LeakyReLU(0.01).  SiLU is smooth, so the gradient of a distortion also says where the map should
    bend; the two were not compared.
    """

    def __init__(self, channels: tuple[int, ...], *, copies: int | None = None, generator: torch.Generator) -> None:
        super().__init__()
        last = len(channels) - 2
        self.layers = nn.ModuleList(
            Dense(a, b, copies=copies, gain=1.0 if i == last else 2.0, generator=generator)
            for i, (a, b) in enumerate(pairwise(channels))
        )

    def forward(self, x: Tensor) -> Tensor:
        """(…, n, channels[0]) → (…, n, channels[-1])."""
        for layer in self.layers[:-1]:
            x = nn.functional.silu(layer(x))
        return self.layers[-1](x)

    def among(self, x: Tensor, copies: Tensor) -> Tensor:
        """The same, by the copies (q,) int64 alone: (n, channels[0]) → (q, n, channels[-1])."""
        *inner, last = (layer for layer in self.layers if isinstance(layer, Dense))
        for layer in inner:
            x = nn.functional.silu(layer.among(x, copies))
        return last.among(x, copies)

    def jet(self, x: Tensor) -> Tensor:
        """The same on jets (3, …, n, c)."""
        *inner, last = (layer for layer in self.layers if isinstance(layer, Dense))
        for layer in inner:
            x = silu_jet(layer.jet(x))
        return last.jet(x)


def silu_jet(x: Tensor) -> Tensor:
    """SiLU of a jet: value → silu(value), tangent → silu'(value) · tangent."""
    value, tangents = torch.split(x, [1, 2])  # its backward is a cat; that of two slices fills two zero tensors
    sigmoid = torch.sigmoid(value)
    slope = sigmoid * (1.0 + value * (1.0 - sigmoid))
    return torch.cat([value * sigmoid, slope * tangents])


class Cycle(NamedTuple):
    """What the 3D → 2D → 3D cycle yields for n points and p patches.

    logits (n, p).  uv (p, n, 2), jacobian (2, p, n, 2): its derivatives along two surface tangents.  xyz (p, n, 3) and
    normal (p, n, 3): what the Wrap-Nets make of uv (normals not normalised).
    """

    logits: Tensor
    uv: Tensor
    jacobian: Tensor
    xyz: Tensor
    normal: Tensor


class MultiChartNetworks(nn.Module):
    """Embedding, Assign-Net, p Unwrap-Nets and p Wrap-Nets, trained jointly."""

    def __init__(self, patches: int, config: NetConfig, *, generator: torch.Generator) -> None:
        super().__init__()
        width = config.width
        self.embedding = Perceptron((3, width, width), generator=generator)
        self.assign = Perceptron((width, width, patches), generator=generator)
        self.unwrap = Perceptron((width, width, width, 2), copies=patches, generator=generator)
        self.wrap = Perceptron((2, width, width, width, 6), copies=patches, generator=generator)

    def scores(self, xyz: Tensor) -> Tensor:
        """Logits of the Assign-Net: (n, 3) → (n, p)."""
        return self.assign(nn.functional.silu(self.embedding(xyz)))

    def forward(self, xyz: Tensor, tangents: Tensor) -> Cycle:
        """The cycle at points xyz (n, 3) with unit tangents (2, n, 3)."""
        feature = silu_jet(self.embedding.jet(torch.cat([xyz[None], tangents])))
        uv, tangents = torch.split(self.unwrap.jet(feature[:, None]), [1, 2])
        position, normal = torch.split(self.wrap(uv[0]), 3, dim=-1)
        return Cycle(self.assign(feature.unbind()[0]), uv[0], tangents, position, normal)
