"""The numbers of carrying charts back from the proxy, in frozen dataclasses saved with each result."""

from __future__ import annotations

from dataclasses import dataclass, field, replace


@dataclass(frozen=True)
class CarryConfig:
    """From the proxy back to the surface."""

    neighbours: int = 3
    """Nearest faces of the proxy that vote for a face's label."""
    normal_weight: float = 0.1
    """Weight of the unit normal against the position, at area 1, in that distance."""
    band: int = 4
    """Rings of faces beside a border that may change sides."""
    worse: float = 2.0
    """Excess energy of a carried chart, as a multiple of the proxy's, up to which it is taken at once."""
    slack: float = 0.005
    """Mean excess energy added to that."""
    islet: float = 0.001
    """Share of a part below which a fragment of a label joins a neighbour."""
    winding: tuple[float, ...] = (1.4, 2.0, 4.0)
    """Length of a seam, as a multiple of its ends' distance, above which it is led along in parts; the next, which
    leaves it more freedom, where it can't be led like that, or pieces lie over themselves then."""
    candidates: int = 4
    """Vertices near a junction of the proxy of which one is to be its place."""
    rigid_steps: int = 4
    """Steps of as-rigid-as-possible flattening from the proxy's rotations."""
    hurried_rounds: int = 8
    """Rounds in which labels follow their neighbours, where there is no time to weigh borders."""


@dataclass(frozen=True)
class HurriedConfig:
    """What holds once it is late: charts lose what folds instead of being laid out anew."""

    weighed: int = 3_000_000
    """Faces times charts up to which the borders of labels are weighed all the same: a second or so."""
    steps: int = 2
    """Rigid steps after the first solve."""
    contacts: int = 0
    """Steps more, in which what overlaps is held."""
    most_wrong: float = 0.3
    """Share of a chart's faces that may be flipped, or overlap along its border …"""
    most_off: float = 0.4
    """… as long as no larger share is cut off with them."""


@dataclass(frozen=True)
class FineConfig:
    """A part of many faces: thinned to a middle mesh for all but the last step, which carries its charts back."""

    faces: int = 20000
    """Faces of the middle mesh of a surface in one part; a part gets as many as √(its share of the area) says …"""
    fewest: int = 6000
    """… but at least these."""
    scraps: int = 4
    """A chart that loses so many scraps, or more, is flattened anew …"""
    anew: int = 40_000
    """… where it has no more faces than this."""
    largest: int = 150_000
    """Faces above which a chart that is valid is not flattened anew for its stretch either: it would take minutes."""
    above: float = 1.5
    """Parts of more than so many times as many are thinned."""
    early: int = 3
    """The quick thinning ends at so many times the faces wanted; the careful one does the rest."""
    closed: int = 6
    """Specks that the quick thinning may close: 1 for a hole, 2 for a handle."""
    haste: float = 3.0
    """How fast the threshold of the quick thinning rises: 7 is its library's default, 0 the most careful."""
    jitter: float = 0.03
    """Standard deviation of its vertices' moves, as a share of the shortest edge at each."""
    steps: int = 4
    """Rigid steps after the first solve, which keeps the middle chart's own stretch."""
    steepest: float = 2.0
    """Stretch of a face of the middle mesh that is taken over; a sliver's may be anything."""
    candidates: int = 8
    """Near faces of the middle mesh that are looked at beside a slit."""
    torn: float = 1.5
    """How much farther apart in uv than in space two of them are where a slit runs between them."""
    rings: int = 3
    """Rings of faces around a flipped one that turn as those beside them."""
    most_wrong: float = 5e-3
    """Share of a chart's faces that may be flipped, or overlap along its border, and are cut off …"""
    around: int = 1
    """… with so many rings around what is flipped …"""
    most_off: float = 0.02
    """… as long as no larger share goes with them."""
    scrap: int = 200
    """Faces of what was cut off at most, that it is tried to put on to a chart beside it."""
    contacts: int = 2
    """Steps more, in which what came to overlap is held where it was …"""
    hold: float = 1e3
    """… by this weight against the distortion energy."""
    tolerance: float = 1e-3
    """Residual, as a share of the right side, at which a solve ends."""
    solver_steps: int = 200
    """The most steps of conjugate gradients of a solve."""
    hurried: HurriedConfig = field(default_factory=HurriedConfig)
    """What holds instead, once it is late."""

    def in_a_hurry(self) -> FineConfig:
        """These numbers, once it is late."""
        own = {name: value for name, value in vars(self.hurried).items() if name != "weighed"}
        return replace(self, **own)


@dataclass(frozen=True)
class HasteConfig:
    """What a time budget has to leave for all that follows the search; seconds of one core."""

    seconds: float = 1.0
    """Of any surface …"""
    seconds_per_face: float = 6e-5
    """… and for each of its faces: they are thinned, carried back, laid out, proven and packed."""
    strict: bool = False
    """Whether the budget counts more than good charts: layouts end in time too, and what has none is projected."""
    last: float = 0.3
    """What has to be left of any surface when the last layout ends …"""
    proving: float = 8e-6
    """… for each face, which is proven, packed and handed back …"""
    projecting: float = 7e-6
    """… and for each that has none by then and is charted without a search, by all cores."""
    thinning: float = 1.4e-5
    """What is foreseen for each face of a part that is thinned …"""
    laying: float = 0.8e-5
    """… for laying out the half of its faces, by all cores …"""
    handle: float = 0.04
    """… and for each of its handles, which a search has to cut, by all cores."""
    another: float = 0.5
    """What each core but the first adds to what is done by all."""

    def at_pace(self, factor: float) -> HasteConfig:
        """The same on a machine that takes so many times as long."""
        slower = {name: factor * seconds for name, seconds in vars(self).items() if name not in ("strict", "another")}
        return replace(self, **slower)


@dataclass(frozen=True)
class ArcConfig:
    """Seams between two junctions, made straight along the edges of the surface."""

    passes: tuple[tuple[float, int], ...] = ((1.5, 8), (1.5, 8), (2.0, 16), (3.0, 60))
    """Of each pass: how far from its place an arc may go, in edges of its own mean length, and its most edges."""
    turning: float = 0.3
    """Price of a turn by a right angle, as a share of what the two edges beside it cost on average."""
    corner: float = 0.3
    """Length that a seam's turn by a right angle counts as in the objective, as a share of the edges beside it."""
    least: int = 3
    """Edges of an arc that is looked at."""
    rounds: int = 6
    """Times that arcs are put back where a piece would be worse, before all of them are."""
    failures: int = 3
    """Times that a piece may be invalid before all arcs beside it are put back."""
    worth: float = 1e-4
    """Objective that arcs which cost more than they save lose together, below which they stay."""
    steps: int = 2
    """Steps of SLIM in which a piece that would overlap is held apart by contacts."""
    most_faces: int = 30000
    """Faces of a surface on which seams are left as they are."""
