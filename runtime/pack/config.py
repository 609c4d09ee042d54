"""Every number that decides where charts go, in small frozen dataclasses that are saved with each result.

Cells are those of the coarse grid on which charts are placed; shares are of the side of the atlas.
"""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class PlaceConfig:
    """Silhouettes on the coarse grid, and the search over their quarter turns."""

    cells: int = 256
    """Cells per side that up to 24 charts are meant to fill; more charts get up to four times as many."""
    fill: float = 0.6
    """Share of those cells that charts and padding are sized to cover."""
    spare: float = 1.4
    """Side of the first square that is tried, over that."""
    shrink: float = 0.7
    """Factor on the charts' size where they don't fit even there …"""
    shrinks: int = 12
    """… and how often."""
    few: int = 48
    """Up to so many charts, places are searched exhaustively and the square to a single cell."""
    coarse: float = 0.02
    """How close the side is found for more charts, share of it."""
    tries: int = 60
    """Sets of quarter turns that are tried at most …"""
    tried_charts: int = 600
    """… and charts that are placed in all of them together, at least once each."""


@dataclass(frozen=True)
class GrowthConfig:
    """Linear programs that move placed charts and let them grow until they jam."""

    rounds: int = 3
    """How often the pairs of facing segments are found anew."""
    steps: int = 4
    """Linear programs a round."""
    trust: float = 1.0 / 128.0
    """Farthest that a chart moves in the first step, share; less where there are more than 24 charts."""
    calmer: float = 0.75
    """Factor on it from step to step."""
    reach: float = 1.0 / 8.0
    """Segments this much farther apart than the closest ones still count as facing each other, share."""
    sample: float = 1.0 / 1024.0
    """Distance of the samples by which facing segments are found, share."""
    repairs: int = 40
    """How often the exact distances may still find a pair too close in the end."""


@dataclass(frozen=True)
class PackConfig:
    """All of them."""

    place: PlaceConfig = field(default_factory=PlaceConfig)
    growth: GrowthConfig = field(default_factory=GrowthConfig)
