"""The paper's networks: Deform-, Wrap-, Cut- and Unwrap-Net (global), Embedding, Assign- and K pairs of nets (charts).

n points · m lattice nodes · p charts · xyz in the unit ball · uv unnormalised · jets (3, …) = (value, ∂/∂u, ∂/∂v).
``forward`` is what ships, in plain operations that can be exported.  ``run`` and ``jet`` are the same functions for
training, where products between hidden layers may be bfloat16: coordinates enter and leave in float32, because
eight bits of mantissa would round a point to 1/256 of the model.
Initial weights (decided): uniform in ±√(3/c_in) for hidden layers, in ±1/√c_in for the last layer of a network or code,
and so all biases.  Torch's default, ±1/√c_in for all, starts Cut- and Deform-Net close to the identity and leaves thin
tubes folded for longer; the variance-preserving ±√(6/c_in) crumples a cylinder, which then tears in several places
(measured at width 64: conformality after 700 steps 0.049, 0.045 and 0.127 on a cylinder, for the three).
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import torch
from torch import Tensor, nn
from torch.nn.functional import leaky_relu

from .config import PaperNets
from .dense import Dense

if TYPE_CHECKING:
    from collections.abc import Callable

BLOCK = 10_000
"""Rows of a layer that are computed at once on the CPU: 20 MB of float32 at width 512."""


class Affine(Dense):
    """A Dense layer, or p side by side, that computes in the precision asked for; see the file for its start."""

    def __init__(
        self, inputs: int, outputs: int, *, gain: float, copies: int | None = None, generator: torch.Generator
    ) -> None:
        super().__init__(inputs, outputs, copies=copies, gain=gain, generator=generator)
        bound = 1.0 / math.sqrt(inputs)
        with torch.no_grad():
            self.bias.copy_((torch.rand(self.bias.shape, generator=generator) * 2.0 - 1.0) * bound)

    def run(self, x: Tensor, dtype: torch.dtype) -> Tensor:
        """(…, n, c_in) → (…, n, c_out) in ``dtype``, bias included in the product."""
        if x.dtype == torch.bfloat16 != dtype:
            return ExactProduct.apply(x, self.weight) + self.bias
        x, weight = in_precision(x, self.weight, dtype)
        bias = self.bias.to(dtype)
        if weight.ndim == 2:
            return torch.addmm(bias, x, weight) if x.ndim == 2 else x @ weight + bias
        if x.ndim == 2:  # as one wide product: its gradients need neither p copies of x nor a sum over them
            wide = weight.transpose(0, 1).reshape(x.shape[1], -1)
            every = torch.addmm(bias.reshape(1, -1), x, wide)
            return every.view(len(x), len(weight), -1).transpose(0, 1).contiguous()
        return torch.baddbmm(bias, x.expand(weight.shape[0], -1, -1), weight)

    def run_jet(self, x: Tensor, dtype: torch.dtype) -> Tensor:
        """The same on jets (3, …, n, c): only the value gets the bias."""
        x, weight = in_precision(x, self.weight, dtype)
        bias = self.bias.to(dtype)
        return x @ weight + torch.stack([bias, *(torch.zeros_like(bias),) * 2])


class ExactProduct(torch.autograd.Function):
    """bfloat16 features x (…, n, c_in) times a float32 weight (…, c_in, c_out), in float32: what makes coordinates.

    Gradients go back in the features' own bfloat16, as in the layers before; in float32 they would be slow.  Jets,
    which make Jacobians too, go back in float32.
    """

    @staticmethod
    def forward(ctx: Any, x: Tensor, weight: Tensor) -> Tensor:
        """Product in float32."""
        ctx.save_for_backward(x, weight)
        return x.float() @ weight

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, Tensor]:
        """Of x in bfloat16, of weight in float32."""
        x, weight = ctx.saved_tensors
        gradient = gradients[0].to(x.dtype)
        of_weight = (x.mT @ gradient).float()
        return gradient @ weight.to(x.dtype).mT, of_weight.sum_to_size(weight.shape)


def in_precision(x: Tensor, weight: Tensor, dtype: torch.dtype) -> tuple[Tensor, Tensor]:
    """Bring x and weight to ``dtype``, so that their product has the precision of x.

    float32 coordinates that meet bfloat16 are split into a rounded part and the rest, and so are the weights:
    [x₁, x₂, x₁] [W₁; W₁; W₂] is exact to 2⁻¹⁶, and sums in float32.
    """
    if x.dtype == dtype or dtype != torch.bfloat16:
        return x.to(dtype), weight.to(dtype)
    near, weight_near = x.to(dtype), weight.to(dtype)
    rest, weight_rest = (x - near.float()).to(dtype), (weight - weight_near.float()).to(dtype)
    return torch.cat([near, rest, near], dim=-1), torch.cat([weight_near, weight_near, weight_rest], dim=-2)


class LeakyPerceptron(nn.Module):
    """Affine layers with LeakyReLU between them, none after the last (paper)."""

    def __init__(
        self, channels: tuple[int, ...], slope: float, *, copies: int | None = None, generator: torch.Generator
    ) -> None:
        super().__init__()
        self.slope = slope
        last = len(channels) - 2
        self.layers = nn.ModuleList(
            Affine(a, b, gain=1.0 / 3.0 if i == last else 1.0, copies=copies, generator=generator)
            for i, (a, b) in enumerate(pairwise(channels))
        )

    def forward(self, x: Tensor) -> Tensor:
        """(…, n, channels[0]) → (…, n, channels[-1])."""
        for layer in self.layers[:-1]:
            x = leaky_relu(layer(x), self.slope)
        return self.layers[-1](x)

    def run(self, x: Tensor, dtype: torch.dtype, *, features: bool = False) -> Tensor:
        """As forward, hidden products in ``dtype``; ``features``: the output is no coordinate, so it stays in dtype."""
        *inner, last = self._affine()
        for layer in inner:
            x = leaky_relu(layer.run(x, dtype), self.slope, inplace=True)
        return last.run(x, dtype if features else _exact(dtype))

    def jet(self, x: Tensor, dtype: torch.dtype, *, features: bool = False) -> Tensor:
        """As run, on jets (3, …, n, c)."""
        *inner, last = self._affine()
        for layer in inner:
            x = leaky_jet(layer.run_jet(x, dtype), self.slope)
        return last.run_jet(x, dtype if features else _exact(dtype))

    def _affine(self) -> list[Affine]:
        return [layer for layer in self.layers if isinstance(layer, Affine)]


def _exact(dtype: torch.dtype) -> torch.dtype:
    """What coordinates are made in."""
    return torch.float32 if dtype == torch.bfloat16 else dtype


def leaky_jet(x: Tensor, slope: float) -> Tensor:
    """LeakyReLU of a jet, in place: value and tangents times 1 where the value is positive, else times ``slope``."""
    gain = (x[:1].detach() > 0.0).to(x.dtype).mul_(1.0 - slope).add_(slope)
    return x.mul_(gain)


class CodedPerceptron(nn.Module):
    """ξ″([ξ′(x); x]): a latent code beside the coordinates it was made from (paper: Deform-, Wrap- and Cut-Net)."""

    def __init__(
        self, inputs: int, outputs: int, hidden_layers: int, nets: PaperNets, *, generator: torch.Generator
    ) -> None:
        super().__init__()
        hidden = (nets.hidden,) * hidden_layers
        self.code = LeakyPerceptron((inputs, *hidden, nets.embedding), nets.slope, generator=generator)
        self.decode = LeakyPerceptron((nets.embedding + inputs, *hidden, outputs), nets.slope, generator=generator)

    def forward(self, x: Tensor) -> Tensor:
        """(n, inputs) → (n, outputs)."""
        return self.decode(torch.cat([self.code(x), x], dim=-1))

    def run(self, x: Tensor, dtype: torch.dtype) -> Tensor:
        """As forward; see LeakyPerceptron.run."""
        return self.decode.run(torch.cat([self.code.run(x, dtype, features=True), x], dim=-1), dtype)

    def jet(self, x: Tensor, dtype: torch.dtype) -> Tensor:
        """As run, on jets (3, n, inputs)."""
        return self.decode.jet(torch.cat([self.code.jet(x, dtype, features=True), x], dim=-1), dtype)


def in_blocks(function: Callable[[Tensor], tuple[Tensor, ...]], x: Tensor, rows: int) -> tuple[Tensor, ...]:
    """``function`` of x (…, n, c) in blocks of points, results joined along the points; ``rows`` a point in each layer.

    On the CPU only.  Activations of all points at once are so large that the C library maps and clears fresh pages for
    each of them, which takes a third of a step of eight charts.
    """
    if x.device.type != "cpu":
        return function(x)
    total = x.shape[-2]
    blocks = math.ceil(total * rows / BLOCK)
    missing = -total % blocks
    padded = torch.cat([x, x[..., total - missing :, :]], dim=-2) if missing else x
    done = [function(part) for part in padded.chunk(blocks, dim=-2)]
    return tuple(torch.cat(parts, dim=-2)[..., :total, :] for parts in zip(*done, strict=True))


def plane_jet(uv: Tensor) -> Tensor:
    """A jet of uv (…, n, 2) along its own two directions: (3, …, n, 2)."""
    unit = torch.eye(2, dtype=uv.dtype, device=uv.device)
    axes = unit.view(2, *(1,) * (uv.ndim - 1), 2).expand(2, *uv.shape)
    return torch.cat([uv[None], axes])


class GlobalNetworks(nn.Module):
    """The four networks of the global mode, shared between both branches."""

    def __init__(self, nets: PaperNets, *, generator: torch.Generator) -> None:
        super().__init__()
        self.deform_net = CodedPerceptron(2, 2, 3, nets, generator=generator)
        self.wrap_net = CodedPerceptron(2, 6, 3, nets, generator=generator)
        self.cut_net = CodedPerceptron(3, 3, 2, nets, generator=generator)
        self.unwrap_net = LeakyPerceptron((3, nets.hidden, nets.hidden, 2), nets.slope, generator=generator)
        self.register_buffer("no_logit", torch.zeros((2, 1)), persistent=False)

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        """Cut-Net, then Unwrap-Net: (n, 3) → logits (n, 1), all zero, and uv (n, 1, 2)."""
        uv = self.unwrap_net(self.cut_net(xyz) + xyz)
        return uv @ self.no_logit, uv.unsqueeze(1)

    def flatten(self, xyz: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
        """P → Q, or P̂ → Q̂_cycle: (n, 3) → (n, 2)."""
        return in_blocks(lambda part: (self.unwrap_net.run(self.cut_net.run(part, dtype) + part, dtype),), xyz, 1)[0]

    def deform(self, lattice: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
        """G → Q̂: (m, 2) → (m, 2)."""
        return in_blocks(lambda part: (self.deform_net.run(part, dtype) + part,), lattice, 1)[0]

    def fold(self, uv: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
        """Wrap-Net: uv (n, 2) → position and normal (n, 6), the normal of any length."""
        return in_blocks(lambda part: (self.wrap_net.run(part, dtype),), uv, 1)[0]

    def fold_jet(self, uv: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
        """As fold, with derivatives by u and v: (3, n, 6)."""
        return in_blocks(lambda part: (self.wrap_net.jet(plane_jet(part), dtype),), uv, 3)[0]

    def wrap(self, uv: Tensor, patch: Tensor) -> tuple[Tensor, Tensor]:
        """The inverse map: uv (n, 2) → xyz (n, 3), unit normal (n, 3).  ``patch`` (n,) int64 is 0 everywhere."""
        del patch
        return _position_and_normal(self.wrap_net(uv))


class MultiChartPaperNetworks(nn.Module):
    """Embedding, Assign-Net and p Unwrap- and Wrap-Nets as batched products.

    Decided: LeakyReLU follows the embedding, since two affine layers in a row would be one.  The Wrap-Nets are
    [2, 512, 512, 512, 6], because the paper calls them lighter than the global one and gives no channels.
    ``bidirectional``: p Deform-Nets [2, 512, 512, 512, 2] more, for the ablation.
    """

    def __init__(
        self, charts: int, nets: PaperNets, *, generator: torch.Generator, bidirectional: bool = False
    ) -> None:
        super().__init__()
        hidden, slope = nets.hidden, nets.slope
        thrice = (hidden,) * 3
        self.slope, self.charts = slope, charts
        self.embedding = LeakyPerceptron((3, hidden, hidden), slope, generator=generator)
        self.assign = LeakyPerceptron((hidden, hidden, charts), slope, generator=generator)
        self.unwrap = LeakyPerceptron((*thrice, 2), slope, copies=charts, generator=generator)
        self.wrap_net = LeakyPerceptron((2, *thrice, 6), slope, copies=charts, generator=generator)
        if bidirectional:
            self.deform_net = LeakyPerceptron((2, *thrice, 2), slope, copies=charts, generator=generator)

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        """(n, 3) → logits (n, p) and the uv of every chart (n, p, 2)."""
        feature = leaky_relu(self.embedding(xyz), self.slope)
        return self.assign(feature), self.unwrap(feature).transpose(0, 1)

    @torch.no_grad()
    def spread_scores(self, xyz: Tensor, deviation: float) -> None:
        """Scale and shift the last layer of the Assign-Net: logits of mean 0 and this deviation over xyz (n, 3)."""
        logits, last = self(xyz)[0], self.assign._affine()[-1]
        scale = deviation / logits.std(dim=0).clamp(min=torch.finfo(logits.dtype).eps)
        last.weight.mul_(scale)
        last.bias.copy_((last.bias - logits.mean(dim=0)) * scale)

    def flatten(self, xyz: Tensor, dtype: torch.dtype = torch.float32) -> tuple[Tensor, Tensor]:
        """Logits (n, p) and uv (p, n, 2) of points (n, 3), or (p, n, 3) with points of its own for each chart."""

        def block(part: Tensor) -> tuple[Tensor, Tensor]:
            feature = leaky_relu(self.embedding.run(part, dtype, features=True), self.slope)
            return self.assign.run(feature, dtype), self.unwrap.run(feature, dtype)

        logits, uv = in_blocks(block, xyz, self.charts)
        return logits, uv

    def deform(self, lattice: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
        """G → Q̂ of each chart: (m, 2) → (p, m, 2)."""
        return self.deform_net.run(lattice, dtype) + lattice

    def fold(self, uv: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
        """Wrap-Nets: uv (p, n, 2) → positions and normals (p, n, 6), normals of any length."""
        return in_blocks(lambda part: (self.wrap_net.run(part, dtype),), uv, len(uv))[0]

    def fold_jet(self, uv: Tensor, dtype: torch.dtype = torch.float32) -> Tensor:
        """As fold, with derivatives by u and v: (3, p, n, 6)."""
        return in_blocks(lambda part: (self.wrap_net.jet(plane_jet(part), dtype),), uv, 3 * len(uv))[0]

    def wrap(self, uv: Tensor, patch: Tensor) -> tuple[Tensor, Tensor]:
        """The inverse map: uv (n, 2) of charts ``patch`` (n,) int64 → xyz (n, 3), unit normal (n, 3)."""
        every = self.wrap_net(uv).transpose(0, 1)
        return _position_and_normal(torch.take_along_dim(every, patch[:, None, None], dim=1)[:, 0])


PaperNetworks = GlobalNetworks | MultiChartPaperNetworks


def _position_and_normal(folded: Tensor) -> tuple[Tensor, Tensor]:
    position, normal = torch.split(folded, 3, dim=-1)
    return position, nn.functional.normalize(normal, dim=-1)
