"""Joint training of Assign-, Unwrap- and Wrap-Nets (paper: chart-wise score-weighted loss functions).

n samples a step · p patches · unit ball.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from ...runtime.geometry.normals import tangent_frames
from ..sampling import Samples
from .losses import arap_energy, cosine_gap, position_gap, weighted_mean
from .networks import Cycle, MultiChartNetworks
from .optimizer import OneCycleAdam
from .start import cluster, plane_projection

if TYPE_CHECKING:
    from collections.abc import Callable

    from ..config import JointConfig, TrainConfig


def joint_loss(cycle: Cycle, xyz: Tensor, normal: Tensor, config: JointConfig) -> Tensor:
    """Scalar: distortion + cycle + normal, each weighted by the chart probability.  xyz, normal (n, 3)."""
    score = torch.softmax(cycle.logits, dim=-1).T
    total = config.distortion_weight * arap_energy(cycle.jacobian)
    total = total + config.cycle_weight * position_gap(cycle.xyz, xyz)
    total = total + config.normal_weight * cosine_gap(cycle.normal, normal)
    return weighted_mean(total, score)


class SampleBank:
    """Surface samples as float32 tensors; batches are drawn with a torch generator."""

    def __init__(self, samples: Samples, generator: torch.Generator) -> None:
        self.xyz = torch.from_numpy(samples.xyz.astype(np.float32))
        self.normal = torch.from_numpy(samples.normal.astype(np.float32))
        self.tangents = torch.from_numpy(tangent_frames(samples.normal).astype(np.float32))
        self.generator = generator

    def draw(self, count: int) -> Tensor:
        """Indices (count,) with replacement."""
        return torch.randint(len(self.xyz), (count,), generator=self.generator)


def fit_start(networks: MultiChartNetworks, bank: SampleBank, label: Tensor, uv: Tensor, config: TrainConfig) -> None:
    """Teach the networks the start, in place: label (n,) int64 by cross-entropy, uv (p, n, 2) and the way back.

    Each point counts on its own patch only.
    """
    steps, weight = config.start.fit_steps, config.start.fit_normal_weight
    optimizer = OneCycleAdam(networks, steps, config.start.fit_rate)
    for _ in range(steps):
        pick = bank.draw(config.joint.batch)
        feature = nn.functional.silu(networks.embedding(bank.xyz[pick]))
        own = nn.functional.one_hot(label[pick], uv.shape[0]).T.to(uv.dtype)
        flat = networks.unwrap(feature)
        wrapped = networks.wrap(uv[:, pick])
        gap = ((flat - uv[:, pick]) ** 2).sum(-1) + ((wrapped[..., :3] - bank.xyz[pick]) ** 2).sum(-1)
        gap = gap + weight * ((wrapped[..., 3:] - bank.normal[pick]) ** 2).sum(-1)
        loss = weighted_mean(gap, own) + nn.functional.cross_entropy(networks.assign(feature), label[pick])
        optimizer.step(loss)


def train_jointly(
    samples: Samples, config: TrainConfig, seed: int, report: Callable[[int, float], None]
) -> MultiChartNetworks:
    """Networks of ``config.charts`` patches, from the geometric start.

    ``report(step, loss)`` is called every 20 steps and after the last.
    """
    rng, generator = np.random.default_rng(seed), torch.Generator().manual_seed(seed)
    networks = MultiChartNetworks(config.charts, config.net, generator=generator)
    bank = SampleBank(samples, generator)
    label = cluster(samples.xyz, samples.normal, config.charts, config.start, rng)
    uv = plane_projection(samples.xyz, samples.normal, label, config.charts)
    fit_start(networks, bank, torch.from_numpy(label), torch.from_numpy(uv.astype(np.float32)), config)
    optimizer = OneCycleAdam(networks, config.joint.steps, config.joint.peak_rate)
    for step in range(config.joint.steps):
        pick = bank.draw(config.joint.batch)
        cycle = networks(bank.xyz[pick], bank.tangents[:, pick])
        loss = joint_loss(cycle, bank.xyz[pick], bank.normal[pick], config.joint)
        optimizer.step(loss)
        if step % 20 == 0 or step == config.joint.steps - 1:
            report(step, loss.item())
    return networks
