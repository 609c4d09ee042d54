"""The deployed map in torch: what an exported file has to compute, said once and plainly.

n points · p patches · k charts.  points: source units.  xyz: unit ball.  uv: [0, 1]², v up.
This is the truth that the parity proof compares with; the exported graph (torchfile.py) is built another way.
"""

from __future__ import annotations

import copy
from typing import TYPE_CHECKING, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from ..graph.frames import fold_frame
from ..graph.parity import Truth

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.sessions.bundle import BundleMetadata


class PatchNetworks(Protocol):
    """Any nn.Module of this signature can be deployed, as long as it is made of the operations lowering.py lists."""

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        """Points xyz (n, 3) float32 in the unit ball → logits (n, p), uv (n, p, 2) in chart coordinates."""
        ...


def chart_membership(metadata: BundleMetadata) -> NDArray[np.float32]:
    """(p, k) float32: 1 where the patch belongs to the chart; patch probabilities @ it = chart probabilities."""
    return np.eye(metadata.chart_count, dtype=np.float32)[np.asarray(metadata.patch_chart, dtype=np.int64)]


class UnwrapGraph(nn.Module):
    """points (n, 3) float32 in source units → uv (n, 2) float32, chart (n,) int64, score (n,) float32.

    The patch of the largest logit answers; score is the softmax probability of its chart, summed over its patches.
    uv is clamped to [0, 1], so that a point far off the surface still gets a texel of the atlas.
    """

    centre: Tensor
    centre_rest: Tensor
    scale: Tensor
    placement: Tensor
    patch_chart: Tensor
    membership: Tensor

    def __init__(self, model: nn.Module, metadata: BundleMetadata) -> None:
        super().__init__()
        self.model = model
        folded = fold_frame(metadata)
        self.register_buffer("centre", torch.from_numpy(folded.centre))
        self.register_buffer("centre_rest", torch.from_numpy(folded.centre_rest))
        self.register_buffer("scale", torch.from_numpy(folded.scale))
        self.register_buffer("placement", torch.from_numpy(metadata.placement_array().astype(np.float32)))
        self.register_buffer("patch_chart", torch.tensor(metadata.patch_chart, dtype=torch.int64))
        self.register_buffer("membership", torch.from_numpy(chart_membership(metadata)))

    def logits_and_uv(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """The networks' answer at points (n, 3) in source units: logits (n, p), uv (n, p, 2) in chart coordinates."""
        return self.model((points - self.centre - self.centre_rest) / self.scale)

    def forward(self, points: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """See the class."""
        return self.choose(*self.logits_and_uv(points))

    def choose(self, logits: Tensor, patch_uv: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Logits (n, p) and uv of every patch (n, p, 2) → uv in the atlas, chart, score."""
        patch = logits.argmax(dim=1)
        chart = self.patch_chart[patch]
        score = (torch.softmax(logits, dim=1) @ self.membership).gather(1, chart[:, None])[:, 0]
        flat = torch.take_along_dim(patch_uv, patch[:, None, None], dim=1)[:, 0]
        place = self.placement[chart]
        uv = (place[:, :, :2] @ flat[:, :, None])[:, :, 0] + place[:, :, 2]
        return uv.clamp(0.0, 1.0), chart, score


def truth_of(graph: UnwrapGraph, tie: float) -> Callable[[NDArray[np.float32]], Truth]:
    """The graph as parity.py asks for it; two logits closer than tie × (1 + max |logit|) are a tie."""

    @torch.no_grad()
    def answer(points: NDArray[np.float32]) -> Truth:
        logits, patch_uv = graph.logits_and_uv(torch.from_numpy(points))
        uv, chart, score = (tensor.numpy() for tensor in graph.choose(logits, patch_uv))
        return Truth(uv, chart, score, logits.argmax(dim=1).numpy(), ~_ties(logits.numpy(), tie))

    return answer


def frozen_copy(model: nn.Module) -> nn.Module:
    """A float32 copy on the CPU, in evaluation mode, without gradients."""
    return copy.deepcopy(model).to("cpu", torch.float32).eval().requires_grad_(False)


def _ties(logits: NDArray[np.float32], tie: float) -> NDArray[np.bool_]:
    """(n,) True where the two largest logits of (n, p) are too close to say which patch wins."""
    if logits.shape[1] == 1:
        return np.zeros(len(logits), dtype=np.bool_)
    ordered = np.sort(logits, axis=1)
    return ordered[:, -1] - ordered[:, -2] <= tie * (1.0 + np.abs(logits).max(axis=1))
