"""Steps per second of preset paper against a literal transcription of the paper's step, at the paper's sizes.

    python -m benchmarks.paper_step [--points 4900] [--charts 8] [--repeat 5] [--threads 2]

The literal step is written as the paper's equations read: one network a chart in a Python loop, Jacobians by three
reverse passes with create_graph, nearest neighbours from whole distance matrices, float32, torch.optim.AdamW.
All sides take the same points and step in turn; a time is the median of its steps after one that warms up.
"""

from __future__ import annotations

import argparse
import os
import platform
import statistics
import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor, nn

from flexpara.runtime.mesh import Frame
from flexpara.runtime.samples import make_sample
from flexpara.train.paper.batches import BatchSource, PaperInput
from flexpara.train.paper.config import PaperConfig
from flexpara.train.paper.global_step import global_loss
from flexpara.train.paper.multichart_step import chart_loss
from flexpara.train.paper.networks import GlobalNetworks
from flexpara.train.paper.training import Training, choose_device

if TYPE_CHECKING:
    from collections.abc import Callable

    from flexpara.train.paper.config import Mode


def stacked(*channels: int) -> nn.Sequential:
    """An MLP with LeakyReLU between its layers."""
    layers: list[nn.Module] = []
    for i in range(len(channels) - 1):
        layers += [nn.Linear(channels[i], channels[i + 1]), nn.LeakyReLU(0.01)]
    return nn.Sequential(*layers[:-1])


class LiteralGlobal(nn.Module):
    """Deform-, Wrap-, Cut- and Unwrap-Net."""

    def __init__(self) -> None:
        super().__init__()
        self.d1, self.d2 = stacked(2, 512, 512, 512, 64), stacked(66, 512, 512, 512, 2)
        self.w1, self.w2 = stacked(2, 512, 512, 512, 64), stacked(66, 512, 512, 512, 6)
        self.c1, self.c2 = stacked(3, 512, 512, 64), stacked(67, 512, 512, 3)
        self.u = stacked(3, 512, 512, 2)

    def unwrap(self, xyz: Tensor) -> Tensor:
        """P → Q."""
        return self.u(self.c2(torch.cat([self.c1(xyz), xyz], dim=1)) + xyz)

    def wrap(self, uv: Tensor) -> tuple[Tensor, Tensor]:
        """Q → P, N."""
        made = self.w2(torch.cat([self.w1(uv), uv], dim=1))
        return made[:, :3], made[:, 3:]


def literal_gap(xyz: Tensor, uv: Tensor) -> Tensor:
    """Mean |λ₁ − λ₂| by reverse mode, once for each coordinate."""
    rows = [torch.autograd.grad(xyz[:, c].sum(), uv, create_graph=True)[0] for c in range(3)]
    jacobian = torch.stack(rows, dim=1)
    metric = jacobian.transpose(1, 2) @ jacobian
    e, f, g = metric[:, 0, 0], metric[:, 0, 1], metric[:, 1, 1]
    root = torch.sqrt(4 * f * f + (e - g) ** 2 + 1e-12)
    return (0.5 * (e + g + root) - 0.5 * (e + g - root)).abs().mean()


def literal_repulsion(uv: Tensor, neighbours: int, score: Tensor | None = None) -> Tensor:
    """Unwrapping loss over the whole distance matrix."""
    near = torch.cdist(uv, uv).topk(neighbours + 1, largest=False).indices[:, 1:]
    side = (uv.amax(0) - uv.amin(0)).max().detach()
    difference = uv[:, None] - uv[near]
    difference = difference if score is None else difference * score[:, None, None]
    distance = ((difference**2).sum(-1) + 1e-12).sqrt()
    return torch.relu(0.2 * side / len(uv) ** 0.5 - distance).sum(1).mean()


def literal_angles(corner: Tensor) -> Tensor:
    """Angles of triangles (t, 3, d), one corner after the other."""
    angles = []
    for i in range(3):
        a, b = corner[:, (i + 1) % 3] - corner[:, i], corner[:, (i + 2) % 3] - corner[:, i]
        angles.append(torch.acos(torch.cosine_similarity(a, b).clamp(-1 + 1e-6, 1 - 1e-6)))
    return torch.stack(angles, dim=1)


def literal_global_step(samples: PaperInput, points: Tensor, config: PaperConfig) -> Callable[[], None]:
    """One step of the global mode."""
    networks = LiteralGlobal()
    optimizer = torch.optim.AdamW(networks.parameters(), lr=config.rate, weight_decay=config.decay)
    line = torch.linspace(-1.0, 1.0, int(len(points) ** 0.5))
    lattice = torch.cartesian_prod(line, line)
    normal = torch.from_numpy(samples.normals).float()
    faces = torch.from_numpy(samples.faces)
    weights = config.global_weights

    def step() -> None:
        uv = networks.unwrap(points)
        cycle, cycle_normal = networks.wrap(uv)
        hat = networks.d2(torch.cat([networks.d1(lattice), lattice], dim=1)) + lattice
        hat_xyz, _ = networks.wrap(hat)
        hat_cycle = networks.unwrap(hat_xyz)
        distance = torch.cdist(hat_xyz, points)
        wrap = distance.min(1).values.square().mean() + distance.min(0).values.square().mean()
        loss = weights.unwrap * literal_repulsion(uv, config.neighbours) + weights.wrap * wrap
        gap = (points - cycle).abs().sum(1).mean() + (hat - hat_cycle).abs().sum(1).mean()
        gap = gap + (1 - torch.cosine_similarity(normal, cycle_normal)).mean()
        loss = loss + weights.cycle * gap
        loss = loss + weights.differential * (literal_gap(cycle, uv) + literal_gap(hat_xyz, hat))
        triangle = (literal_angles(points[faces]) - literal_angles(uv[faces])).abs().sum(1).mean()
        loss = loss + weights.triangle * triangle
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    return step


def literal_chart_step(samples: PaperInput, points: Tensor, config: PaperConfig) -> Callable[[], None]:
    """One step of the multi-chart mode: a loop over charts."""
    embedding, assign = stacked(3, 512, 512), stacked(512, 512, config.charts)
    unwraps = [stacked(512, 512, 512, 2) for _ in range(config.charts)]
    wraps = [stacked(2, 512, 512, 512, 6) for _ in range(config.charts)]
    every = nn.ModuleList([embedding, assign, *unwraps, *wraps])
    optimizer = torch.optim.AdamW(every.parameters(), lr=config.rate, weight_decay=config.decay)
    normal = torch.from_numpy(samples.normals).float()
    faces = torch.from_numpy(samples.faces)
    weights = config.chart_weights

    def step() -> None:
        feature = nn.functional.leaky_relu(embedding(points), 0.01)
        score = torch.softmax(assign(feature), dim=1)
        loss = torch.zeros(())
        for k in range(config.charts):
            uv = unwraps[k](feature)
            made = wraps[k](uv)
            own = score[:, k]
            gap = ((points - made[:, :3]).abs() * own[:, None]).sum(1).mean()
            gap = gap + ((1 - torch.cosine_similarity(normal, made[:, 3:])) * own).mean()
            edge = torch.zeros(())
            for a, b in ((0, 1), (1, 2), (2, 0)):
                i, j = faces[:, a], faces[:, b]
                solid, flat = (points[i] - points[j]).norm(dim=1), ((uv[i] - uv[j]).square().sum(1) + 1e-12).sqrt()
                edge = edge + ((own[i] + own[j]) / 2 * (solid - flat) ** 2).sum()
            loss = loss + weights.unwrap * literal_repulsion(uv, config.neighbours, own)
            loss = loss + weights.cycle * gap + weights.triangle * edge
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()

    return step


def our_step(samples: PaperInput, config: PaperConfig) -> Callable[[], None]:
    """One step as train_paper takes it."""
    device = choose_device(config)
    source, run = BatchSource(samples, config, device), Training.begin(config, samples, device)
    networks = run.networks

    def step() -> None:
        batch = source.draw(run.generator)
        if isinstance(networks, GlobalNetworks):
            loss = global_loss(networks, batch, config)
        else:
            loss = chart_loss(networks, batch, config)
        run.optimizer.step(loss)

    return step


def seconds_a_step(steps: list[Callable[[], None]], repeat: int) -> list[float]:
    """Medians after one step each that warms up; taken in turn, so that a host that slows down slows all of them."""
    taken: list[list[float]] = [[] for _ in steps]
    for _ in range(repeat + 1):
        for step, seconds in zip(steps, taken, strict=True):
            start = time.perf_counter()
            step()
            if torch.cuda.is_available():
                torch.cuda.synchronize()
            seconds.append(time.perf_counter() - start)
    return [statistics.median(seconds[1:]) for seconds in taken]


def torus_input(points: int) -> PaperInput:
    """A torus of about ``points`` vertices in the unit ball, with its normals and faces."""
    vertices, faces = make_sample("torus", resolution=round((points * 0.7 / 0.3) ** 0.5))
    ball = Frame.of(vertices).apply(vertices)
    ring = np.concatenate(
        [vertices[:, :2] / np.linalg.norm(vertices[:, :2], axis=1, keepdims=True), ball[:, :1] * 0], 1
    )
    normal = (vertices - 0.7 * ring) / 0.3
    return PaperInput(ball, normal, faces)


def cpu_name() -> str:
    """The processor as the system names it."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text(encoding="utf-8").splitlines() if path.is_file() else []
    return next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.processor())


def main() -> None:
    """Measure and print a Markdown table."""
    parser = argparse.ArgumentParser(description="Steps per second of preset paper against a literal transcription.")
    parser.add_argument("--points", type=int, default=4900)
    parser.add_argument("--charts", type=int, default=8)
    parser.add_argument("--repeat", type=int, default=5)
    parser.add_argument("--threads", type=int, default=os.cpu_count() or 1)
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    samples = torus_input(arguments.points)
    points = torch.from_numpy(samples.points).float()
    print(f"{cpu_name()}, {arguments.threads} threads, torch {torch.__version__}, {len(points)} points, width 512\n")
    print("| mode | literal float32 s | ours float32 s | × | ours bfloat16 s | × | bfloat16 steps/s |")
    print("|---|---|---|---|---|---|---|")
    modes: tuple[tuple[Mode, Callable[..., Callable[[], None]]], ...]
    modes = (("global", literal_global_step), ("multi-chart", literal_chart_step))
    for mode, literal in modes:
        config = PaperConfig(mode=mode, charts=arguments.charts, points=len(points))
        ours = [our_step(samples, replace(config, dtype=dtype)) for dtype in ("float32", "bfloat16")]
        slow, *fast = seconds_a_step([literal(samples, points, config), *ours], arguments.repeat)
        cells = [f"{slow:.2f}", *(cell for value in fast for cell in (f"{value:.2f}", f"{slow / value:.1f}"))]
        name = mode if mode == "global" else f"{mode}, K = {arguments.charts}"
        print(f"| {name} | {' | '.join(cells)} | {1 / fast[1]:.2f} |", flush=True)


if __name__ == "__main__":
    main()
