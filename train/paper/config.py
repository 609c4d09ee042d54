"""Every number of preset ``paper`` (Zhao et al. 2025, arXiv 2504.19210), in frozen dataclasses saved with each result.

Lengths are in the unit ball (`runtime.mesh.Frame`); weights are dimensionless.  "paper" = stated there ("Implementation
Details" unless said otherwise); "decided" = the paper is silent, and the docstring says why.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Literal

from ...runtime.errors import InputError
from ...runtime.options.unwrap import PAPER_RANGES

Mode = Literal["global", "multi-chart"]
PAPER_HIDDEN = 512
"""Channels of the paper's hidden layers, which the rates are meant for."""


@dataclass(frozen=True)
class PaperNets:
    """Sizes of the networks."""

    hidden: int = PAPER_HIDDEN
    """Channels of hidden layers (paper); 64 to 128 does for tests on a CPU."""
    embedding: int = 64
    """h: channels of the latent code inside Deform-, Wrap- and Cut-Net (paper)."""
    slope: float = 0.01
    """Negative slope of LeakyReLU (paper)."""


@dataclass(frozen=True)
class GlobalWeights:
    """Weights of the global losses (paper)."""

    unwrap: float = 0.01
    """α_u: repulsion of neighbours in uv."""
    wrap: float = 1.0
    """α_w: Chamfer distance."""
    cycle: float = 0.01
    """α_c: points, uv and normals."""
    differential: float = 0.01
    """α_diff: |λ₁ − λ₂| of both wrappings."""
    triangle: float = 0.001
    """α_tri: corner angles."""


@dataclass(frozen=True)
class MultiChartWeights:
    """Weights of the multi-chart losses (paper), and of what its ablations add."""

    unwrap: float = 0.01
    """α_u: repulsion of neighbours in uv."""
    cycle: float = 10.0
    """α_c: points and normals."""
    triangle: float = 1.0
    """α_tri: lengths of edges."""
    wrap: float = 1.0
    """Chamfer distance of the bi-directional ablation (decided: α_w of the global mode)."""
    differential: float = 0.01
    """|λ₁ − λ₂| of the DDL ablation (decided: α_diff of the global mode)."""


@dataclass(frozen=True)
class Ablation:
    """Which parts are present (paper, "Ablation Study").  Defaults: the paper's full framework."""

    triangle: bool = True
    """Global: the triangle distortion loss."""
    differential: bool = True
    """Global: the differential distortion loss."""
    upper: bool = True
    """Global: the 2D → 3D → 2D branch (Deform-Net, wrapping loss, uv cycle, φ̂)."""
    lower: bool = True
    """Global: the 3D → 2D → 3D branch and all that touches Q: unwrapping loss, point and normal cycle, φ, triangles."""
    chart_bidirectional: bool = False
    """Multi-chart: a 2D → 3D → 2D branch, which the full framework leaves out."""
    chart_differential: bool = False
    """Multi-chart: the differential distortion loss, which the full framework leaves out."""


@dataclass(frozen=True)
class PaperConfig:
    """Everything that decides a result, together with the input and the machine."""

    mode: Mode = "global"
    """One chart for all, or ``charts`` of them."""
    charts: int = 8
    """K of the multi-chart mode (paper: n = 8 in its comparisons)."""
    seed: int = 0
    """Seed of the initial weights and of the batches."""
    steps: int = 10_000
    """Optimizer steps (decided: what the authors' earlier method, Flatten Anything, runs by default)."""
    points: int = 4900
    """N: surface points a step at most, and the lattice has ⌊√N⌋² nodes (decided: the paper takes all V vertices, which
    a large mesh doesn't allow; a larger input is sampled anew each step)."""
    rate: float = 1e-3
    """Initial learning rate of AdamW at 512 channels (decided: as Flatten Anything, which the paper extends)."""
    final_rate: float = 1e-5
    """The same at the end of the half cosine (decided: likewise).

    Global networks of h channels take 512/h times both (decided: the rule of μP, Yang & Hu 2021), so that narrow ones
    learn as fast.  In the multi-chart mode that lets one chart win before the others have learned anything, and no
    factor at all is slow, so there it is the root of 512/h.
    """
    score_spread: float = 4.0
    """Multi-chart: standard deviation of each chart's logit over the points at the start, its mean being 0 (decided).

    With nearly equal scores all charts learn the same map of the whole surface, and one or two win.
    """
    decay: float = 1e-8
    """Weight decay (decided: likewise)."""
    mean_kept: float = 0.9
    """β₁ of AdamW: share of the mean gradient that a step keeps, in [0, 1) (decided: as published)."""
    square_kept: float = 0.999
    """β₂ of AdamW: the same for the mean square (decided: as published)."""
    least_root: float = 1e-8
    """ε of AdamW: added to the root of the mean square (decided: as published)."""
    neighbours: int = 8
    """J_u: neighbours in uv that repel a point (decided: likewise)."""
    cut_neighbours: int = 3
    """J_cut: neighbours in space for the extraction of seams (paper)."""
    cut_share: float = 0.02
    """τ as a share of the uv box (paper)."""
    epsilon: float = 0.2
    """ε in units of L(Q)/√N (paper); N counts all points of the input, also where a step sees only some (decided)."""
    edge_neighbours: int = 6
    """Neighbours in space that a point cloud's points are joined with (decided: a triangle mesh has six a vertex)."""
    dtype: Literal["float32", "bfloat16"] = "float32"
    """Of products between hidden layers; coordinates, Jacobians and losses stay float32."""
    device: Literal["auto", "cpu", "cuda"] = "auto"
    """auto: CUDA where there is one."""
    compile: bool = False
    """On CUDA: torch.compile the networks (decided: off until it was seen to pay).  Never on the CPU."""
    nets: PaperNets = field(default_factory=PaperNets)
    global_weights: GlobalWeights = field(default_factory=GlobalWeights)
    chart_weights: MultiChartWeights = field(default_factory=MultiChartWeights)
    ablation: Ablation = field(default_factory=Ablation)

    @property
    def rate_factor(self) -> float:
        """What both rates are multiplied with, see final_rate."""
        return (PAPER_HIDDEN / self.nets.hidden) ** (1.0 if self.mode == "global" else 0.5)

    def __post_init__(self) -> None:
        """Refuse values that can't work.

        Raises:
            InputError: names the field.
        """
        _known("mode", self.mode, ("global", "multi-chart"))
        _known("dtype", self.dtype, ("float32", "bfloat16"))
        _known("device", self.device, ("auto", "cpu", "cuda"))
        _within("charts", self.charts, 1, 256)
        _within("seed", self.seed, 0, 2**63 - 1)
        _within("steps", self.steps, *PAPER_RANGES["steps"])
        _within("points", self.points, *PAPER_RANGES["points"])
        for name in ("neighbours", "edge_neighbours", "cut_neighbours"):
            _within(name, getattr(self, name), 1, 1000)
        _within("nets.hidden", self.nets.hidden, *PAPER_RANGES["width"])
        _within("nets.embedding", self.nets.embedding, 1, 8192)
        for name in ("rate", "final_rate", "decay", "least_root", "epsilon", "cut_share", "score_spread"):
            _finite(name, getattr(self, name))
        for name in ("mean_kept", "square_kept"):
            _share(name, getattr(self, name))
        for owner in ("nets", "global_weights", "chart_weights"):
            for name, value in asdict(getattr(self, owner)).items():
                _finite(f"{owner}.{name}", value)
        if self.mode == "global" and not (self.ablation.upper or self.ablation.lower):
            raise InputError("upper and lower are both off, expected at least one branch; switch one on")


def _known(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise InputError(f"{name} is {value!r}, expected one of {', '.join(choices)}; choose one of them")


def _within(name: str, value: int, least: int, most: int) -> None:
    if not least <= value <= most:
        raise InputError(f"{name} is {value}, expected {least} to {most}; choose another")


def _finite(name: str, value: float) -> None:
    if not (math.isfinite(value) and value >= 0.0):
        raise InputError(f"{name} is {value}, expected a finite number ≥ 0; choose another")


def _share(name: str, value: float) -> None:
    if not 0.0 <= value < 1.0:
        raise InputError(f"{name} is {value}, expected 0 or more and less than 1; choose another")
