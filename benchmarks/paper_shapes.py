"""Preset paper at reduced width and steps on closed forms: does it flatten, and is there a seam where one is needed?

    python -m benchmarks.paper_shapes [--shapes tube,hemisphere,trefoil] [--seeds 0,1] [--width N] [--steps N] …

Conformality is the paper's mean angle difference (radians) of the network's own map, over the faces off the seam of a
mesh much finer than the one trained on, so that the paper's seam extraction (J_cut = 3, τ = 2 % of the uv box) tells
tears from stretched edges.  One torch thread, which is what networks this small want.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch

from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.paper.batches import PaperInput
from flexpara.train.paper.config import PaperConfig, PaperNets
from flexpara.train.paper.learnedseams import cut_points
from flexpara.train.paper.losses import angle_gap, corner_angles
from flexpara.train.paper.pipeline import vertex_normals
from flexpara.train.paper.training import train_paper

from .paper_step import cpu_name

if TYPE_CHECKING:
    from numpy.typing import NDArray

BAR = 0.1
"""Conformality asked of each shape."""


class Task(NamedTuple):
    """A shape: the resolutions of the meshes trained and judged on, whether it is closed, and the setting it takes."""

    coarse: int
    fine: int
    closed: bool
    config: PaperConfig


def setting(hidden: int, points: int, steps: int) -> PaperConfig:
    """The global mode on the CPU."""
    return PaperConfig(steps=steps, points=points, nets=PaperNets(hidden=hidden), device="cpu")


TASKS = {
    "tube": Task(96, 400, True, setting(64, 300, 700)),
    "hemisphere": Task(96, 400, False, setting(64, 300, 300)),
    "trefoil": Task(96, 200, True, replace(setting(256, 400, 6000), dtype="bfloat16")),
}


class Result(NamedTuple):
    """cut (v,): on the learned seam.  conformality: of faces off the seam, radians.  flipped: their share, minority."""

    cut: NDArray[np.bool_]
    conformality: float
    flipped: float


def shape(name: str, resolution: int) -> Surface:
    """A procedural surface in the unit ball; "hemisphere" is the upper half of the sphere."""
    vertices, faces = make_sample("sphere" if name == "hemisphere" else name, resolution=resolution)
    if name == "hemisphere":
        faces = faces[vertices[faces][:, :, 2].mean(axis=1) > 0.0]
        used, index = np.unique(faces, return_inverse=True)
        vertices, faces = vertices[used], index.reshape(-1, 3)
    return Surface(Frame.of(vertices).apply(vertices), faces)


def flatten(name: str, coarse: int, fine: int, config: PaperConfig) -> Result:
    """Train on a coarse mesh, judge on a fine one."""
    taught = shape(name, coarse)
    samples = PaperInput(taught.vertices, vertex_normals(taught), taught.faces)
    networks = train_paper(samples, config, lambda _step, _loss: None)
    surface = shape(name, fine)
    with torch.no_grad():
        uv = networks(torch.from_numpy(surface.vertices).float())[1][:, 0].double()
    cut = cut_points(surface.vertices, uv.numpy(), config.cut_neighbours, config.cut_share)
    off = ~cut[surface.faces].any(axis=1)
    flat = uv[torch.from_numpy(surface.faces[off])]
    gap = angle_gap(flat, corner_angles(torch.from_numpy(surface.triangles[off]))) / 3.0
    first, second = flat[:, 1] - flat[:, 0], flat[:, 2] - flat[:, 0]
    positive = ((first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) > 0.0).double().mean().item()
    return Result(cut, float(gap.mean()), min(positive, 1.0 - positive))


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--shapes", default=",".join(TASKS), help="comma-separated")
    parser.add_argument("--seeds", default="0", help="comma-separated")
    for name in ("width", "points", "steps"):
        parser.add_argument(f"--{name}", type=int, help="instead of the shape's own")
    return parser.parse_args()


def main() -> None:
    """Train, judge, and print a Markdown table."""
    arguments = parse()
    torch.set_num_threads(1)
    print(f"{cpu_name()}, 1 thread, torch {torch.__version__}, bar {BAR}\n")
    print("| shape | width | points | steps | dtype | seed | conformality | points on the seam | seconds | bar |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for name in arguments.shapes.split(","):
        task = TASKS[name]
        config = replace(
            task.config,
            points=arguments.points or task.config.points,
            steps=arguments.steps or task.config.steps,
            nets=PaperNets(hidden=arguments.width or task.config.nets.hidden),
        )
        for seed in map(int, arguments.seeds.split(",")):
            start = time.perf_counter()
            found = flatten(name, task.coarse, task.fine, replace(config, seed=seed))
            met = found.conformality <= BAR and bool(found.cut.any()) is task.closed
            settings = f"{config.nets.hidden} | {config.points} | {config.steps} | {config.dtype} | {seed}"
            figures = f"{found.conformality:.3f} | {found.cut.mean():.3f} | {time.perf_counter() - start:.0f}"
            print(f"| {name} | {settings} | {figures} | {'met' if met else 'missed'} |", flush=True)


if __name__ == "__main__":
    main()
