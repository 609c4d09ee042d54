"""The paper's losses, one value per element.   n points · p charts · t triangles · e edges · j neighbours.

Reduction is that of `gaps.weighted_mean`, and the weights of the terms are put to them in `weighted_total`,
each in one place.  Points and normals of the cycle use `gaps.position_gap` and `cosine_gap`.  Roots that vanish
at the optimum are rounded off by a stated ε², so every gradient is finite there.
"""

from __future__ import annotations

import torch
from torch import Tensor

TINY = 1e-12
"""Length² (unit ball, uv) or eigenvalue² that rounds off roots."""


def box_side(uv: Tensor) -> Tensor:
    """L(Q): side of the square bounding box, (…, n, 2) → (…).  A measured constant: no gradient flows through it.

    With a gradient, ε = 0.2 L(Q)/√N would shrink all of uv instead of pushing neighbours apart.
    """
    flat = uv.detach()
    return (flat.amax(dim=-2) - flat.amin(dim=-2)).amax(dim=-1)


def repulsion(uv: Tensor, neighbours: Tensor, epsilon: Tensor, score: Tensor | None = None) -> Tensor:
    """max(0, ε − ‖(qᵢ − qᵢⱼ) sᵢ‖₂) of each point and neighbour (paper, unwrapping loss): → (…, n, j).

    Args:
        uv: (…, n, 2).
        neighbours: (…, n, j) int64 into n.
        epsilon: (…), > 0.
        score: (…, n) chart probabilities inside the norm, as the multi-chart equation has them; None = 1.  Where
            it is 0 the value is the constant ε.
    """
    flat = uv.reshape(-1, uv.shape[-2], 2)
    start = torch.arange(flat.shape[0], device=uv.device).view(-1, 1, 1) * uv.shape[-2]
    index = neighbours.reshape(flat.shape[0], uv.shape[-2], -1) + start
    other = flat.reshape(-1, 2).index_select(0, index.reshape(-1)).view(*neighbours.shape, 2)
    difference = uv.unsqueeze(-2) - other
    if score is not None:
        difference = difference * score[..., None, None]
    distance = torch.sqrt((difference * difference).sum(dim=-1) + TINY)
    return torch.relu(epsilon[..., None, None] - distance)


def nearest_gap(xyz: Tensor, other: Tensor, nearest: Tensor) -> Tensor:
    """‖p − nearest(p)‖₂² of each point, one side of the Chamfer distance: (n, 3), (m, 3), (n,) int64 → (n,)."""
    difference = xyz - other.index_select(0, nearest)
    return (difference * difference).sum(dim=-1)


def eigenvalue_gap(jacobian: Tensor) -> Tensor:
    """|λ₁ − λ₂| of BᵀB (paper, differential distortion loss): (2, …, 3) → (…).

    ``jacobian[i]`` is the derivative of xyz by uv coordinate i.  With E, F, G of the first fundamental form it is
    √((E − G)² + 4F²): zero exactly where the map is conformal.  Squared length per squared uv length.
    """
    by_u, by_v = jacobian.unbind()
    e, f, g = (by_u * by_u).sum(-1), (by_u * by_v).sum(-1), (by_v * by_v).sum(-1)
    return torch.sqrt((e - g) ** 2 + 4.0 * f * f + TINY)


def corner_angles(triangles: Tensor) -> Tensor:
    """Angles at the corners, (…, t, 3, d) with d = 2 or 3 → (…, t, 3), radians in [0, π].

    atan2 of twice the area and the dot product; the area is rounded off by TINY · (longest edge)², so that a collapsed
    triangle has a finite gradient at any scale.
    """
    first = triangles.roll(-1, dims=-2) - triangles
    second = triangles.roll(1, dims=-2) - triangles
    dot = (first * second).sum(-1)
    squares = (first * first).sum(-1)
    longest = squares.detach().amax(dim=-1, keepdim=True) + TINY
    one, two = first[..., 0, :], second[..., 0, :]
    crossed = (one * one).sum(-1) * (two * two).sum(-1) - (one * two).sum(-1) ** 2
    if triangles.shape[-1] == 2:  # without the cancellation
        crossed = (one[..., 0] * two[..., 1] - one[..., 1] * two[..., 0]) ** 2
    area = torch.sqrt(torch.relu(crossed)[..., None] + TINY * longest * longest)
    return torch.atan2(area.expand_as(dot), dot)


def angle_gap(uv: Tensor, angles: Tensor) -> Tensor:
    """Σᵢ |θᵢ − βᵢ| of each triangle (paper, triangle distortion loss): uv (…, t, 3, 2), angles (t, 3) → (…, t)."""
    return (corner_angles(uv) - angles).abs().sum(dim=-1)


def edge_gap(uv: Tensor, edges: Tensor, lengths: Tensor) -> Tensor:
    """(‖pᵢ − pⱼ‖ − ‖qᵢ − qⱼ‖)² of each edge (paper, multi-chart distortion): (…, n, 2), (e, 2), (e,) → (…, e)."""
    start, end = (uv.index_select(-2, ends) for ends in edges.unbind(dim=1))
    difference = start - end
    return (lengths - torch.sqrt((difference * difference).sum(dim=-1) + TINY)) ** 2


def edge_score(score: Tensor, edges: Tensor) -> Tensor:
    """Mean score of the ends of each edge (paper): (…, n), (e, 2) → (…, e)."""
    start, end = edges.unbind(dim=1)
    return 0.5 * (score.index_select(-1, start) + score.index_select(-1, end))


def weighted_total(terms: dict[str, Tensor], weights: dict[str, float]) -> Tensor:
    """Σ weight · term over reduced terms, by their names.  Raises: KeyError for a term without a weight (a defect)."""
    return torch.stack([weights[name] * value for name, value in terms.items()]).sum()
