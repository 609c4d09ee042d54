"""The loss of one step of the multi-chart mode (paper, ℓ_local): score-weighted, all charts as one batch.

n points · p charts · e edges · m lattice nodes.
Sums over points are means, as in the global mode.  The isometric loss stays the paper's sum over all edges of all
triangles, estimated from the edges at hand: (‖p‖ − ‖q‖)² shrinks with the square of the edges as their number grows,
so the sum, unlike a mean, weighs the same at any resolution.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from .gaps import cosine_gap, position_gap, weighted_mean
from .losses import box_side, edge_gap, edge_score, eigenvalue_gap, nearest_gap, repulsion, weighted_total
from .neighbours import Neighbourhood, chart_neighbours

if TYPE_CHECKING:
    from .batches import Batch
    from .config import PaperConfig
    from .networks import MultiChartPaperNetworks


def chart_epsilon(uv: Tensor, score: Tensor, total: int, config: PaperConfig) -> Tensor:
    """ε of each chart (p,), = 0.2 L(Q⁽ᵏ⁾)/√N_k over the N_k of all points whose most probable chart it is (decided).

    The paper's box and N would take in points that other charts answer for, which lie anywhere.  uv (p, n, 2),
    score (p, n), N_k = ``total`` times the chart's share of the n.  A chart without two points has ε = 0: nothing to
    keep apart.
    """
    own = torch.nn.functional.one_hot(score.argmax(dim=0), len(score)).T.bool()
    count = own.sum(dim=1)
    middle = (uv.detach() * own[..., None]).sum(dim=1, keepdim=True) / count.clamp(min=1).view(-1, 1, 1)
    side = box_side(torch.where(own[..., None], uv.detach(), middle))
    return config.epsilon * side / (count.clamp(min=1) * (total / score.shape[1])).sqrt()


def chart_terms(networks: MultiChartPaperNetworks, batch: Batch, config: PaperConfig) -> dict[str, Tensor]:
    """The terms that the input and the ablation leave, by name, each reduced to a scalar, not yet weighted."""
    dtype = getattr(torch, config.dtype) if batch.xyz.dtype == torch.float32 else batch.xyz.dtype
    logits, uv = networks.flatten(batch.xyz, dtype)
    score = torch.softmax(logits.T, dim=0)
    if config.ablation.chart_differential:
        jet = networks.fold_jet(uv, dtype)
        cycle, slopes = jet[0], jet[1:, ..., :3]
    else:
        cycle, slopes = networks.fold(uv, dtype), None
    near = chart_neighbours(uv, config.neighbours)
    repelled = repulsion(uv, near, chart_epsilon(uv, score, len(batch.all_xyz), config), score)
    total = position_gap(cycle[..., :3], batch.xyz)
    if batch.normal is not None:
        total = total + cosine_gap(cycle[..., 3:], batch.normal)
    stretched = weighted_mean(edge_gap(uv, batch.edges, batch.lengths), edge_score(score, batch.edges))
    terms = {
        "unwrap": weighted_mean(repelled.sum(dim=-1), repelled.new_ones(())),
        "cycle": weighted_mean(total, score),
        "triangle": batch.edge_total * stretched,
    }
    if slopes is not None:
        terms["differential"] = weighted_mean(eigenvalue_gap(slopes), score)
    return terms | (upper_terms(networks, batch, dtype) if config.ablation.chart_bidirectional else {})


def upper_terms(networks: MultiChartPaperNetworks, batch: Batch, dtype: torch.dtype) -> dict[str, Tensor]:
    """The 2D → 3D → 2D branch of the ablation: a Chamfer distance to all charts' points together, and the uv cycle.

    Decided: a node counts on its chart by the score its own wrapped point gets there, so unused charts stay out.
    """
    hat_uv = networks.deform(batch.lattice, dtype)
    hat_xyz = networks.fold(hat_uv, dtype)[..., :3]
    logits, hat_cycle = networks.flatten(hat_xyz, dtype)
    chart = torch.arange(len(hat_uv), device=logits.device).view(-1, 1, 1).expand(*logits.shape[:2], 1)
    score = torch.softmax(logits, dim=-1).gather(-1, chart)[..., 0]
    flat = hat_xyz.reshape(-1, 3)
    there = nearest_gap(flat, batch.all_xyz, batch.near.nearest(flat, 1)[:, 0]).view(score.shape)
    back = nearest_gap(batch.xyz, flat, Neighbourhood(flat).nearest(batch.xyz, 1)[:, 0])
    return {
        "wrap": weighted_mean(there, score) + weighted_mean(back, back.new_ones(())),
        "upper_cycle": weighted_mean(position_gap(hat_uv, hat_cycle), score),
    }


def chart_loss(networks: MultiChartPaperNetworks, batch: Batch, config: PaperConfig) -> Tensor:
    """ℓ_local of one step, a scalar."""
    weights = asdict(config.chart_weights)
    return weighted_total(chart_terms(networks, batch, config), weights | {"upper_cycle": weights["cycle"]})
