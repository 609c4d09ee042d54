"""Every number of fitting the deployed networks, saved with each result.   Lengths in the unit ball unless said."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class SampleConfig:
    """Where the networks are told what is right."""

    per_face: int = 400
    """Samples for each face of the surface, evenly by area …"""
    least: int = 20_000
    """… but at least this many …"""
    even: int = 150_000
    """… and at most this many in all."""
    fewest: int = 32
    """Samples that each chart gets at least, however small it is."""
    along: int = 4000
    """Samples beside seams for each unit of their length …"""
    beside: int = 120_000
    """… but at most this many in all."""
    reach: float = 0.01
    """Greatest distance of these from their seam, as a share of the side of a mean chart, √(area / charts)."""


@dataclass(frozen=True)
class GrowConfig:
    """Sizes and limits of a gated network.

    Chosen on eight meshes and three scenes of parts: benchmarks/LOG.md.
    """

    pilot: int = 8
    """The pilot sees one of so many samples."""
    coarsest: int = 64
    """Cells of the grid of the pilot, and where that needs no gates."""
    cells_each: int = 12
    """Cells for each time that a node of the pilot was halved …"""
    cells: int = 40_000
    """… but at most this many …"""
    per_cell: int = 24
    """… and so few that a cell with samples has this many on the mean."""
    longest: int = 512
    """Most cells along an axis."""
    ridge: float = 1e-3
    """Ridge of an expert, as a share of the mean square distance of its samples from their mean."""
    fewest: int = 6
    """A node of no more samples, all of one chart, is not halved."""
    most: int = 40_000
    """Most experts: 2 to 3 MB."""
    deepest: int = 24
    """Most gates on the way to an expert."""
    known: int = 4
    """Planes of seams that are tried as a gate of each node."""
    gain: float = 0.9
    """A node stays whole where the best gate leaves more than this share of its squared error."""
    parameters: float = 2.0
    """What an affine map on a surface counts for, in samples, where two charts meet."""
    gate_ridge: float = 1e-4
    """Ridge of the affine maps that gates are compared by, as a share of the node's squared extent."""
    apart: float = 30.0
    """How far apart the outputs of charts are moved while gates are sought, as a multiple of the outputs' extent."""
    torn: float = 8.0
    """An expert that misses its samples by so many tolerances (rms) holds two sides of a slit, and takes one."""
    steepest: float = 4.0
    """So does one that is so many times as steep as the surface at its samples: across a crease some is needed."""
    slack: float = 1.5
    """Radius within which an expert is sure, as a multiple of the distance of its farthest sample …"""
    near: float = 0.125
    """… but at least this share of a cell."""


@dataclass(frozen=True)
class FitConfig:
    """The networks that answer for surface points."""

    samples: SampleConfig = field(default_factory=SampleConfig)
    """What they are fitted to."""
    grow: GrowConfig = field(default_factory=GrowConfig)
    """Their sizes."""
    tolerance: float = 3.5e-4
    """Error in uv from which on an expert is halved, as a share of √(total uv area): 0.3 texels at 1024²."""


@dataclass(frozen=True)
class WrapConfig:
    """Their inverse: surface points for uv."""

    samples: SampleConfig = field(default_factory=lambda: SampleConfig(even=100_000, beside=80_000, reach=5e-4))
    """What it is fitted to: the chart is given, so it takes fewer than the networks.  Those beside seams lie close to
    them: of a chart that only touches a cell with a tip, something must be seen there."""
    grow: GrowConfig = field(default_factory=lambda: GrowConfig(cells=10_000))
    """Its sizes; the grid lies in the atlas."""
    tolerance: float = 1e-3
    """Error in position, as a share of the radius, from which on an expert is halved."""
    normal: float = 0.005
    """How much of such an error a unit of error in the normal counts."""
