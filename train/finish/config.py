"""The numbers of slits, and of taking overlap apart, in frozen dataclasses saved with each result."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...runtime.geometry.cutgraph import SeamPrices


@dataclass(frozen=True)
class CotangentConfig:
    """The cotangent weights that curvature is spread by, kept where a solve is sound."""

    least_weight: float = 1e-3
    """Least weight of an edge, so that obtuse triangles leave the solve positive definite."""
    steepest: float = 1e4
    """Greatest cotangent of a corner: that of a needle is cut off here."""


@dataclass(frozen=True)
class FlapConfig:
    """Faces that lie over the rest of their chart, and go to one beside it."""

    most: float = 0.02
    """Share of a flattening that may."""
    edges: int = 4
    """Edges at which they are tried to be put on, one at a time, where they do not fit at all of them."""
    clear: float = 1e-6
    """Distance between their points and others, as a share of the chart's extent: nearer ones could cross by a
    rounding."""


@dataclass(frozen=True)
class ScaffoldConfig:
    """Holding a chart apart by triangles around it."""

    rounds: int = 0
    """Scaffolds, each made anew, at most; 0 for contacts in their place."""
    iterations: int = 2
    """SLIM iterations with each."""
    share: float = 0.01
    """What all of a scaffold's triangles count, as a share of the chart's excess energy …"""
    least: float = 0.02
    """… or of so much of its area, where that is more."""
    still: float = 0.01
    """A round that lowers the energy by less than this share is one of two that end it."""
    patience: float = 5.0
    """How many more drops like the last one a round is trusted with."""
    points: int = 24
    """Points of the ring around the chart."""
    away: float = 1.5
    """Radius of the ring, as a multiple of the chart's."""
    turns: int = 20
    """Edges turned to triangulate, as a multiple of the border's vertices, after which that is given up."""
    gap: float = 0.02
    """How far the two sides of a fresh cut are moved apart, as a share of the way into their faces."""


@dataclass(frozen=True)
class ContactConfig:
    """Taking overlap inside a chart apart."""

    rounds: int = 10
    """Rounds of pinning, SLIM and the exact test."""
    iterations: int = 2
    """SLIM iterations a round."""
    block: int = 3
    """SLIM iterations between two looks at the energy."""
    unfolding: int = 12
    """Rigid steps in which a first flattening has to lose its flips."""
    polish: int = 10
    """SLIM iterations that a finished chart gets at the end."""
    polished_faces: int = 20000
    """Faces above which a chart gets none: an iteration takes seconds there, and gains little."""
    cotangents: CotangentConfig = field(default_factory=CotangentConfig)
    """Of the first flattening, and of what curvature foretells."""
    blocks: int = 10
    """Blocks at most."""
    still: float = 0.1
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
    scaffold: ScaffoldConfig = field(default_factory=ScaffoldConfig)
    """What holds a chart apart where seams are to be as short as a bound on stretch allows."""


@dataclass(frozen=True)
class SlitConfig:
    """Slits inside charts.  Lengths are shares of √(surface area)."""

    price: float = 0.003
    """Mean excess energy (symmetric Dirichlet − 1, share of the surface's area) that a slit of length 1 has to save."""
    radius: float = 0.03
    """Neighbourhood over which stress is averaged."""
    rings: int = 60
    """Rings of vertices in that neighbourhood at most."""
    shortest: float = 0.1
    """Slits shorter than this are judged as if they had this length."""
    near: float = 0.03
    """No slit aims at a vertex closer to the border than this."""
    ways: int = 1
    """Ways to the same vertex that are tried."""
    astray: float = 3.0
    """Distance from its end to the nearest vertex, in steps of its own points, from which a slit lies elsewhere."""
    reach: float = 12.0
    """How far from a slit, in steps of its own points, the way that follows it on another mesh is sought."""
    apart: float = 0.6
    """How far from the first way's start the second must start, as a share of its length."""
    failures: int = 3
    """Slits that may fail to pay before a chart is left as it is."""
    most: int = 12
    """Slits a chart may get."""
    foreseen: int = 24
    """Slits a chart may get before it is flattened, where its curvature asks for them."""
    sure: float = 4.0
    """Foretold energy that such a slit has to save, as a multiple of what it costs."""
    contact: ContactConfig = field(default_factory=ContactConfig)
    """How a slit that folds over itself is held apart."""
    seams: SeamPrices = field(default_factory=SeamPrices)
    """What the ways that slits take cost."""


@dataclass(frozen=True)
class EnergyConfig:
    """What finished charts are laid out by."""

    kind: str = "isometric"
    """isometric as the search, conformal or arap."""
    steps: tuple[int, ...] = (40, 12, 3)
    """SLIM iterations by another energy than the search's; the next where a chart would lie over itself."""


@dataclass(frozen=True)
class ProjectConfig:
    """Charts by projection, where there is no time for a search."""

    least: float = 0.3
    """Cosine of the angle up to which a face may turn from the direction that it is seen from …"""
    barely: float = 0.05
    """… and in a crumb."""
    crumb: int = 40
    """Connected faces of one direction below which they are a crumb."""
    rounds: int = 8
    """Rings of faces that a face takes its direction from."""
    votes: int = 4
    """Rounds in which faces follow most of their neighbours."""
    blocks: int = 64
    """Pieces of work that charts are shared out in."""
