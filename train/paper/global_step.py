"""The loss of one step of the global mode (paper, ℓ_global).

n points P · m lattice nodes G · Q = uv of P · a hat marks what the lattice becomes.
The paper writes sums over points; they are taken as means, so that the paper's weights mean the same for any number of
points.  The sum over the J_u neighbours of a point stays a sum, as does that over the three corners of a triangle.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, NamedTuple

import torch
from torch import Tensor

from .gaps import cosine_gap, position_gap, weighted_mean
from .losses import angle_gap, box_side, eigenvalue_gap, nearest_gap, repulsion, weighted_total
from .neighbours import Neighbourhood, own_neighbours

if TYPE_CHECKING:
    from .batches import Batch
    from .config import PaperConfig
    from .networks import GlobalNetworks


class Branches(NamedTuple):
    """What both branches yield; None where an ablation leaves a branch or its Jacobian out.

    uv (n, 2) = Q.  cycle (n, 6) = [P_cycle; N_cycle].  jacobian (2, n, 3) = B.
    hat_uv (m, 2) = Q̂.  hat_xyz (m, 3) = P̂.  hat_jacobian (2, m, 3) = B̂.  hat_cycle (m, 2) = Q̂_cycle.
    """

    uv: Tensor | None
    cycle: Tensor | None
    jacobian: Tensor | None
    hat_uv: Tensor | None
    hat_xyz: Tensor | None
    hat_jacobian: Tensor | None
    hat_cycle: Tensor | None


def run_branches(networks: GlobalNetworks, xyz: Tensor, lattice: Tensor, config: PaperConfig) -> Branches:
    """Both cycles; the Wrap-Net answers for Q and Q̂ at once."""
    dtype = getattr(torch, config.dtype) if xyz.dtype == torch.float32 else xyz.dtype
    part = config.ablation
    uv = networks.flatten(xyz, dtype) if part.lower else None
    hat_uv = networks.deform(lattice, dtype) if part.upper else None
    both = torch.cat([flat for flat in (uv, hat_uv) if flat is not None])
    sizes = [0 if uv is None else len(uv), 0 if hat_uv is None else len(hat_uv)]
    if part.differential:
        jet = networks.fold_jet(both, dtype)
        cycle, hat = jet[0].split(sizes)
        slopes, hat_slopes = jet[1:, :, :3].split(sizes, dim=1)
    else:
        cycle, hat = networks.fold(both, dtype).split(sizes)
        slopes = hat_slopes = None
    return Branches(
        uv,
        cycle if part.lower else None,
        slopes if part.lower else None,
        hat_uv,
        hat[:, :3] if part.upper else None,
        hat_slopes if part.upper else None,
        networks.flatten(hat[:, :3], dtype) if part.upper else None,
    )


def global_terms(networks: GlobalNetworks, batch: Batch, config: PaperConfig) -> dict[str, Tensor]:
    """The terms that the input and the ablation leave, by name, each reduced to a scalar, not yet weighted."""
    made = run_branches(networks, batch.xyz, batch.lattice, config)
    terms: dict[str, Tensor] = {"cycle": batch.xyz.new_zeros(())}
    if made.uv is not None and made.cycle is not None:
        near = own_neighbours(made.uv, config.neighbours)
        epsilon = config.epsilon * box_side(made.uv) / len(batch.all_xyz) ** 0.5
        terms["unwrap"] = _mean(repulsion(made.uv, near, epsilon).sum(dim=-1))
        terms["cycle"] = terms["cycle"] + _mean(position_gap(made.cycle[:, :3], batch.xyz))
        if batch.normal is not None:
            terms["cycle"] = terms["cycle"] + _mean(cosine_gap(made.cycle[:, 3:], batch.normal))
        if config.ablation.triangle and batch.triangles is not None and batch.angles is not None:
            corners = made.uv.index_select(0, batch.triangles.reshape(-1)).view(-1, 3, 2)
            terms["triangle"] = _mean(angle_gap(corners, batch.angles))
    if made.hat_uv is not None and made.hat_xyz is not None and made.hat_cycle is not None:
        terms["wrap"] = chamfer(made.hat_xyz, batch)
        terms["cycle"] = terms["cycle"] + _mean(position_gap(made.hat_uv, made.hat_cycle))
    gaps = [_mean(eigenvalue_gap(slopes)) for slopes in (made.jacobian, made.hat_jacobian) if slopes is not None]
    if gaps:
        terms["differential"] = torch.stack(gaps).sum()
    return terms


def global_loss(networks: GlobalNetworks, batch: Batch, config: PaperConfig) -> Tensor:
    """ℓ_global of one step, a scalar."""
    return weighted_total(global_terms(networks, batch, config), asdict(config.global_weights))


def chamfer(xyz: Tensor, batch: Batch) -> Tensor:
    """CD(P̂; P): mean squared distance to the nearest point, there and back, summed.

    There: from P̂ to all points of the input; back: from the points of the batch.  Decided: squared, the usual form;
    the paper doesn't say.
    """
    there = nearest_gap(xyz, batch.all_xyz, batch.near.nearest(xyz, 1)[:, 0])
    back = nearest_gap(batch.xyz, xyz, Neighbourhood(xyz).nearest(batch.xyz, 1)[:, 0])
    return _mean(there) + _mean(back)


def _mean(value: Tensor) -> Tensor:
    """Weight 1 for all."""
    return weighted_mean(value, value.new_ones(()))
