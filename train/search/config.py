"""The numbers of the search for charts, in frozen dataclasses saved with each result.   f faces · a part has area 1."""

from __future__ import annotations

from dataclasses import dataclass, field

from ...runtime.geometry.cutgraph import SeamPrices


@dataclass(frozen=True)
class LabelConfig:
    """From chart probabilities to face labels."""

    smoothing: float = 0.02
    """Length that a seam may save before a face leaves its most probable chart, per unit of −log probability."""
    seams: SeamPrices = field(default_factory=SeamPrices)
    """What the borders of labels cost."""
    islet_area: float = 0.008
    """Pieces below this share of the surface join a neighbour."""


@dataclass(frozen=True)
class StartConfig:
    """First labels of a search: k-means of a part's faces by position and normal, at area 1."""

    counts: tuple[float, ...] = (1.0, 0.0, 2.0)
    """Clusters of each start, as a multiple of the charts asked for; 0 is the part as a whole."""
    counts_small: tuple[float, ...] = (0.0,)
    """The same for a part of small share; it gets the others too, where this leaves it stretched."""
    counts_holed: tuple[float, ...] = (1.0,)
    """The same for a part of many handles."""
    behind: float = 1.05
    """Objective of a search begun, as a multiple of the best one's, beyond which it is not finished."""
    crowded: int = 40
    """Pieces of a start that are valid by themselves above which no further start is searched."""
    given: int = 200
    """Charts of an atlas to improve above which its own are no start: a search from so many takes its time."""
    handles: int = 8
    """Handles above which a part has many."""
    worth: float = 0.05
    """Share of the whole surface below which a part is of small share."""
    main: float = 0.3
    """Share of the whole surface from which a part gets all starts."""
    counts_middle: tuple[float, ...] = (1.0, 0.0)
    """Clusters of each start of a part between the two."""
    least_faces: int = 8
    """Faces a cluster has on average at least."""
    position_weight: float = 1.8
    """Weight of the position against the normal in the clustering distance."""
    normal_weight: float = 0.5
    """Weight of the unit normal."""
    rounds: int = 12
    """Lloyd iterations."""
    certainty: float = 10.0
    """−log probability of a label per squared distance beyond the nearest cluster's."""


@dataclass(frozen=True)
class SplitConfig:
    """Where a chart may be cut in two: along isolines of the distance from a seed."""

    levels: int = 22
    """Isolines looked at."""
    outermost: float = 0.08
    """Share of the faces before the first of them, and after the last."""
    necks: int = 2
    """Isolines tried for each seed: those short for what they cut off."""
    energy_left: float = 0.9
    """Share of a chart's energy below which its parts must stay, where it is cut in two whatever the limit."""


@dataclass(frozen=True)
class CrumbConfig:
    """Pieces too small to be charts of their own."""

    share: float = 0.004
    """Share of a part's area below which a piece joins one beside it …"""
    price: float = 0.0002
    """… where that costs no more of the objective than this: what a small chart costs in padding and in work."""
