"""Every number that decides where charts go, in small frozen dataclasses that are saved with each result.

Shares are of the side of the atlas.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

Rotation: TypeAlias = Literal["off", "90", "any"]
"""How charts may be turned: not at all, by quarter turns, or first upright and then by quarter turns."""
Stack: TypeAlias = Literal["off", "identical", "mirrored"]
"""Which congruent charts are laid over each other: none, those of one shape, those of a shape and its mirror image."""


@dataclass(frozen=True)
class PlaceConfig:
    """The first layout: charts dropped on a skyline, and the search over orders and widths."""

    columns: float = 12.0
    """Columns of the skyline, times √(number of charts) …"""
    least: int = 128
    """… but at least so many …"""
    most: int = 1536
    """… and at most."""
    fill: float = 0.6
    """Share of the square that charts are first thought to fill."""
    sizings: int = 12
    """How often their size is corrected until their first layout just fits."""
    alike: float = 0.05
    """By how much it may then be smaller than the square, share of the side."""
    long: float = 1.0
    """Length of a chart, in sides of a square of the area of all charts, from which diagonals are tried for it."""
    tightness: float = 1.0
    """What a buried column counts against a top that is higher by as much."""
    tries: int = 400
    """Orders that are tried at most …"""
    dropped: int = 4000
    """… and charts that are dropped in all of them together."""
    shuffle: float = 0.3
    """By how much (natural logarithm) sizes are falsified for a new order, typically."""


@dataclass(frozen=True)
class NestConfig:
    """A layout of charts as bitmaps, beside the first one; the better of the two is taken when both have grown."""

    most: int = 300
    """Charts up to which it is tried."""
    side: int = 256
    """Cells along the page."""
    more: float = 1.04
    """How many times that many a layout may need."""
    fill: float = 0.58
    """Share of the square that charts are first thought to fill."""
    sizings: int = 6
    """How often their size is corrected."""
    slants: int = 1
    """Angles within a quarter turn at which charts are tried."""
    tries: int = 24
    """Orders that are tried at most …"""
    dropped: int = 1200
    """… and charts that are laid in all of them together."""
    shuffle: float = 0.3
    """By how much (natural logarithm) sizes are falsified for a new order, typically."""


@dataclass(frozen=True)
class SeparationConfig:
    """A layout of bitmaps on smaller and smaller pages, where charts that overlap are moved until none does."""

    start: NestConfig = field(default_factory=lambda: NestConfig(side=128))
    """The layout that is begun with."""
    most: int = 40
    """Charts up to which it is tried."""
    slants: int = 8
    """Angles within a quarter turn at which charts are tried …"""
    large: float = 0.08
    """… that have at least this share of the area of all …"""
    few: int = 2
    """… and the others."""
    work: float = 1.5e8
    """Cells of tables that are read in all; a table that is made counts five times."""
    slower: float = 0.1
    """Share of that which is done where nothing was compiled."""
    turns: int = 5
    """Turns by chance at which a chart is tried when it is moved, beside its own and the two next to it."""
    patience: int = 15
    """Rounds over all charts without less overlap after which a page is given up."""
    step: int = 2
    """Cells by which the page's side shrinks, until it was given up once; then one."""
    kept: int = 3
    """Layouts kept, the last ones found."""
    heavier: float = 1.2
    """Factor on the weight of a pair that overlaps, after each round …"""
    steeper: float = 0.8
    """… and how much more of it for the deepest overlap …"""
    lighter: float = 0.95
    """… and of a pair that does not."""
    memory: int = 1 << 26
    """Cells of tables from which on they are forgotten and made again, after a round."""

    @property
    def numbers(self) -> tuple[float, ...]:
        """All of them, in the order in which the kernel takes them."""
        shares = self.heavier, self.steeper, self.lighter
        return self.work, self.turns, self.patience, self.step, self.kept, *shares, self.memory


@dataclass(frozen=True)
class ForeseenConfig:
    """What charts will cover of a page, foreseen without packing them."""

    columns: int = 96
    """Columns of the skyline on which they are dropped."""
    fill: float = 0.55
    """Share of that page that they would cover at the size they are dropped at."""
    padding: float = 1.0 / 256.0
    """Padding around each, share."""
    tries: int = 16
    """Orders and widths that are tried."""
    shuffle: float = 0.3
    """By how much (natural logarithm) sizes are falsified for a new order, typically."""


@dataclass(frozen=True)
class RowConfig:
    """Charts in rows of their boxes, where there is no time for another layout."""

    angles: int = 12
    """Angles within a quarter turn of which the one with the least box is taken."""
    halvings: int = 40
    """How often the range of their scale is halved."""
    smallest: float = 1e-4
    """Scale, as a share of the one that fills the page, at which they have to fit."""
    slack: float = 48.0
    """What is kept free beyond the padding, so that repairs on the lattice ask for no second layout; lattice units."""


@dataclass(frozen=True)
class GrowthConfig:
    """Linear programs that move and turn placed charts and let them grow until they jam."""

    few: int = 128
    """Up to so many charts are moved; more only grow where they lie."""
    rounds: int = 4
    """How often the pairs of facing segments are found anew."""
    steps: int = 4
    """Linear programs a round."""
    trust: float = 1.0 / 100.0
    """Farthest that a chart moves in the first step, share …"""
    crowd: float = 24.0
    """… less, by the root of their number over this one, where there are more charts."""
    calmer: float = 0.75
    """Factor on it from step to step."""
    smaller: float = 0.1
    """Factor on it after a round in which charts came too close to each other, which is undone."""
    reach: float = 1.0 / 8.0
    """Segments this much farther apart than the closest ones still count as facing each other, share."""
    sample: float = 1.0 / 256.0
    """Distance of the samples by which facing segments are found, share."""
    turn: float = 0.03
    """Most by which a chart is turned in a step, radians."""
    straight: float = 0.75
    """Share of an outline along the axes from which a chart is not turned …"""
    askew: float = 0.5
    """… and degrees by which that part may differ from them."""
    repairs: int = 40
    """How often the exact distances may still find a pair too close in the end."""


@dataclass(frozen=True)
class LatticeConfig:
    """The repair of triangles that rounding would turn over; lengths in lattice units, 2⁻²⁴ of the side."""

    height: float = 2.0
    """Least height of a triangle there: from √2 on, rounding can't turn it over."""
    aim: float = 0.1
    """Share of that height by which a triangle is raised beyond it, so that it doesn't come back for the last digit."""
    deepest: float = 64.0
    """How far faces may overlap, or a triangle be turned over, to be repaired: more is a fault of the chart."""
    relaxation: float = 1.8
    """Factor on the steps of the repair: over-relaxation, below 2."""
    sweeps: int = 500
    """Steps of the repair a round."""
    rounds: int = 8
    """How often it starts from what the exact tests still find."""
    retries: int = 3
    """How often charts are given more room where the repair moved a vertex farther than the room they had."""


@dataclass(frozen=True)
class DensityConfig:
    """The search for the part of the atlas that charts fill at a texel density asked for."""

    more: float = 1.01
    """How much more than the density asked for is aimed at: charts can be shrunk to it, not enlarged."""
    tries: int = 12
    """Sides of that part that are tried at most."""


@dataclass(frozen=True)
class IslandConfig:
    """What counts as an island of a mesh that has uv."""

    flat: float = 1e-9
    """Area of an island, beside that of as many faces on the average, up to which it has none."""


@dataclass(frozen=True)
class StackConfig:
    """What counts as congruent."""

    tolerance: float = 1e-3
    """How far the outlines of two charts may lie apart, share of the distance from a chart's centre to its border."""


@dataclass(frozen=True)
class PackConfig:
    """All of them, and what was asked for."""

    rotation: Rotation = "any"
    stack: Stack = "off"
    whole_texels: bool = False
    """Whether the edges of charts that are rectangles lie between texels."""
    hurried: bool = False
    """Whether charts lie in rows of their boxes, found at once, instead of close together."""
    rows: RowConfig = field(default_factory=RowConfig)
    place: PlaceConfig = field(default_factory=PlaceConfig)
    nest: NestConfig = field(default_factory=NestConfig)
    separation: SeparationConfig = field(default_factory=SeparationConfig)
    growth: GrowthConfig = field(default_factory=GrowthConfig)
    lattice: LatticeConfig = field(default_factory=LatticeConfig)
    density: DensityConfig = field(default_factory=DensityConfig)
    islands: IslandConfig = field(default_factory=IslandConfig)
    stacks: StackConfig = field(default_factory=StackConfig)
    finalists: int = 2
    """Layouts that grow until they jam; of more, those that have grown most after one round."""
    recuts: int = 4
    """How often charts that float32 can't hold are drawn larger or cut again, and all are packed anew."""
    least_edge: float = 1.6e-5
    """Median edge of such a chart, in sides of the page, up to which it is drawn larger instead: 256 steps of float32
    near 1, a thirtieth of a texel of 2048."""
