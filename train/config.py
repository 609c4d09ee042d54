"""Every number of training and finishing, in small frozen dataclasses that are saved with each result.

Lengths are in the unit ball unless a docstring says otherwise; weights are dimensionless.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from .deploy.config import FitConfig, WrapConfig


@dataclass(frozen=True)
class NetConfig:
    """Sizes of the networks.  The paper uses width 512 throughout; 64 is a choice for CPUs, not compared."""

    width: int = 64
    """Channels of the hidden layers of embedding, Assign-, Unwrap- and Wrap-Nets."""


@dataclass(frozen=True)
class StartConfig:
    """The geometric start: clusters of surface samples, and networks fitted to them (design: measured prototype)."""

    samples: int = 8000
    """Surface samples that are clustered."""
    normal_weight: float = 0.5
    """Weight of the unit normal against the position in the clustering distance."""
    rounds: int = 12
    """Lloyd iterations."""
    fit_steps: int = 100
    """Steps of fitting the networks to cluster labels and plane projections."""
    fit_rate: float = 5e-3
    """Peak learning rate of that fit."""
    fit_normal_weight: float = 0.1
    """Weight of the squared gap of normals in that fit, beside those of uv and position."""


@dataclass(frozen=True)
class JointConfig:
    """Joint training: the paper's score-weighted losses."""

    steps: int = 100
    """Optimizer steps."""
    batch: int = 512
    """Surface samples a step."""
    peak_rate: float = 4e-3
    """Peak learning rate of the one-cycle schedule (Adam)."""
    distortion_weight: float = 1.0
    """Weight of the ARAP energy of the 3D → 2D map."""
    cycle_weight: float = 10.0
    """Weight of |P − P_cycle|₁ (paper: α_c = 10)."""
    normal_weight: float = 1.0
    """Weight of the cosine distance of normals."""


@dataclass(frozen=True)
class LabelConfig:
    """From chart probabilities to face labels."""

    smoothing: float = 0.02
    """Length that a seam may save before a face leaves its most probable chart, per unit of −log probability."""
    crease_discount: float = 0.8
    """How much cheaper a seam is along a sharp crease, in [0, 1)."""
    islet_area: float = 0.008
    """Pieces below this share of the surface join a neighbour."""


@dataclass(frozen=True)
class ContactConfig:
    """Taking overlap inside a chart apart."""

    rounds: int = 10
    """Rounds of pinning, SLIM and the exact test."""
    iterations: int = 2
    """SLIM iterations a round."""
    block: int = 5
    """SLIM iterations between two looks at the energy."""
    blocks: int = 10
    """Blocks at most."""
    still: float = 0.04
    """A block that lowers the energy by less than this share ends the run."""
    patience: float = 3.0
    """How many more drops like the last one a block is trusted with."""
    step: int = 3
    """SLIM iterations between two tests where contacts are needed."""
    steps: int = 5
    """Such steps at most."""
    margin: float = 0.01
    """How far outside the other border a buried vertex is drawn, as a share of √(chart area)."""
    weight: float = 10.0
    """Weight of the pins against the distortion energy."""
    most: float = 0.5
    """Share of the boundary that may be buried before the case is given up."""


@dataclass(frozen=True)
class ReliefConfig:
    """Slits inside charts.  Lengths are shares of √(surface area)."""

    price: float = 0.003
    """Mean excess energy (symmetric Dirichlet − 1, share of the surface's area) that a slit of length 1 has to save."""
    radius: float = 0.03
    """Neighbourhood over which stress is averaged."""
    shortest: float = 0.1
    """Slits shorter than this are judged as if they had this length."""
    near: float = 0.03
    """No slit aims at a vertex closer to the border than this."""
    ways: int = 1
    """Ways to the same vertex that are tried."""
    apart: float = 0.6
    """How far from the first way's start the second must start, as a share of its length."""
    failures: int = 3
    """Slits that may fail to pay before a chart is left as it is."""
    most: int = 12
    """Slits a chart may get."""
    contact: ContactConfig = field(default_factory=ContactConfig)
    """How a slit that folds over itself is held apart."""
    crease_discount: float = 0.8
    """How much cheaper a slit is along a sharp crease, in [0, 1)."""


@dataclass(frozen=True)
class FinishConfig:
    """From labels to valid charts."""

    labels: LabelConfig = field(default_factory=LabelConfig)
    relief: ReliefConfig = field(default_factory=ReliefConfig)
    surrogate_faces: int = 2500
    """Faces of the simplified surface on which charts are split and merged."""
    rounds: int = 8
    """Times the worst chart may be split."""
    stubborn: int = 3
    """Charts that no split improves, before the search ends."""
    halvings: int = 8
    """Times faces that can't be flattened are halved before xatlas gets them."""
    necks: int = 2
    """Borders tried for each split and seed."""
    shared: float = 0.1
    """Share of the smaller border that two pieces must share to be worth a merge."""
    bump: float = 0.03
    """Share of the surface under which a piece is a bump: a merge with it is weighed with slits."""
    dear: float = 0.02
    """Excess energy over which a finished piece is slit once more, with contacts."""


@dataclass(frozen=True)
class TrainConfig:
    """Everything that decides a result, together with the surface."""

    charts: int = 8
    """K: the most charts a connected surface may get."""
    seed: int = 0
    """Seed of all generators."""
    net: NetConfig = field(default_factory=NetConfig)
    start: StartConfig = field(default_factory=StartConfig)
    joint: JointConfig = field(default_factory=JointConfig)
    finish: FinishConfig = field(default_factory=FinishConfig)
    fit: FitConfig = field(default_factory=FitConfig)
    wrap: WrapConfig = field(default_factory=WrapConfig)
