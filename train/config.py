"""Every number of training and finishing, in small frozen dataclasses that are saved with each result.

Lengths are in the unit ball unless a docstring says otherwise; weights are dimensionless.
"""

from __future__ import annotations

from dataclasses import dataclass, field

from ..runtime.geometry.places import PlaceConfig
from ..runtime.pack.config import ForeseenConfig
from .carry.config import ArcConfig, CarryConfig, FineConfig, HasteConfig
from .deploy.config import FitConfig, WrapConfig
from .finish.config import EnergyConfig, FlapConfig, ProjectConfig, SlitConfig
from .seams.config import ClosingConfig
from .search.config import CrumbConfig, LabelConfig, SplitConfig, StartConfig
from .swift.config import SwiftConfig


@dataclass(frozen=True)
class PlanarConfig:
    """Flat regions, and unfolding them without stretch."""

    angle: float = 1e-4
    """Angle between normals, in radians, up to which two faces lie in one plane."""
    rounding: float = 8.0
    """The same as a multiple of what float32 coordinates can turn the normal of a face by."""
    largest_angle: float = 0.5
    """The most that rounding excuses, in radians."""
    deviation: float = 1e-5
    """Distance from its plane, as a share of the surface's extent, beyond which a region is curved."""
    meeting: float = 1e-6
    """Distance, as a share of the surface's extent, up to which two edges of a layout are one: float32's rounding."""
    shared: float = 0.1
    """Share of the shorter border that two developments must have in common to be joined."""
    aspect: float = 8.0
    """Long side over short side of a development that may be made of more compact ones."""
    span: float = 1.6
    """The same is allowed up to this length, as a multiple of √(area of all parts): such a strip fits on the page."""
    whole_end: float = 0.9
    """Two strips are joined end to end where they meet at so large a share of the wider one's end."""
    long_side: float = 0.4
    """Share of the shorter border from which two are joined along a long side: then a strip may come of it."""
    fill: float = 0.51
    """Share of the least rectangle around it that a development must cover: less wastes the texture."""
    bent_straight: float = 0.02
    """Mean excess energy up to which a ribbon is bent straight."""
    most: int = 2000
    """Flat regions of a part that unfolding is tried with."""
    digits: int = 6
    """Decimal digits to which shares of a border are compared: what is equal but for rounding counts as equal."""
    most_charts: int = 48
    """Developments of a part above which it is not made of facets: small faces of a curved surface are flat too."""
    few: int = 3
    """So many developments of a whole part, or less, are taken as they are."""
    facets: int = 24
    """A part of so many flat regions, or less, is made of facets: it is unfolded, if that needs no more charts than
    allowed."""
    flat_share: float = 0.6
    """The same for flat regions per face: a mesh whose faces lie mostly in common planes is made of facets."""
    bent: float = 1e-3
    """Angle defect, in radians, from which a vertex can't lie inside a flat chart."""
    dear: float = 0.02
    """What the seams through all bent vertices cost at least, above which a part not made of facets is not unfolded."""


@dataclass(frozen=True)
class SliverConfig:
    """Triangles thinner than the numbers that hold them."""

    height: float = 1e-7
    """Least height of a triangle, as a share of its part's extent."""
    aspect: float = 1e-3
    """Height per longest side above which a triangle is small, not thin, and is left alone."""
    rounds: int = 5
    """Times the thin ones are looked for."""


@dataclass(frozen=True)
class ShortenConfig:
    """Charts that set the scale of the page, cut where that is cheap."""

    full: float = 0.5
    """Share of a page that charts are expected to cover: one that needs more of a page costs something."""
    worth: float = 0.5
    """What a page e times as large costs, as a multiple of the page's price: by default one half as full counts like a
    seam of 1.2 × √area."""
    smooth: float = 3.0
    """How many times what it costs elsewhere a cut costs where nobody expects one: where the surface is flat …"""
    exact: float = 1e-6
    """… and in a chart of no more excess energy, which unrolls as it is, …"""
    crease: float = 1.05
    """… wherever it is bent by less than so many radians."""
    least: float = 0.0015
    """Gain, as objective, below which a chart stays whole."""
    directions: int = 8
    """Directions in which a straight cut is tried …"""
    places: int = 7
    """… at so many places each …"""
    looks: int = 3
    """… of which so many are moved to where edges are shortest."""
    shift: float = 0.06
    """How far a cut may be moved, as a share of the chart's extent across it."""


@dataclass(frozen=True)
class PageConfig:
    """What charts waste of the page, as a part of the objective."""

    price: float = 0.01
    """Mean excess energy that an empty page would cost: half of it, where charts cover half.  0: the page is free."""
    free: bool = False
    """Whether the search leaves the page out, as it does where fewer charts are asked for than it aims at."""
    hull: float = 1.0
    """Share of that price at which the room between a chart and its convex hull counts while a search goes on."""
    tries: int = 16
    """Seams that may be tried to be closed on the proxy where that pays …"""
    tries_fewer: int = 60
    """… and where fewer are asked for, or the page is free."""
    near: float = 1.01
    """Objective of a state, as a multiple of the best one's, up to which it is taken where it has fewer charts."""
    far: float = 1.1
    """Objective of charts carried back, as a multiple of the best ones', beyond which they are not laid out further."""
    foreseen: ForeseenConfig = field(default_factory=ForeseenConfig)
    """How much charts will cover, foreseen."""


@dataclass(frozen=True)
class SymmetryConfig:
    """Mirrored charts."""

    axis: str = "none"
    """Across which axis the plane lies: x, y, z, auto for any that there is, none for charts as they come."""
    exact: float = 1e-4
    """Distance of vertices from mirror images, as a share of the part's extent, for a plane that is found."""
    near: float = 1e-3
    """The same for one that is asked for …"""
    share: float = 0.9
    """… where so many of the vertices have an image: the others are charted as those beside them."""


@dataclass(frozen=True)
class FinishConfig:
    """From labels to valid charts."""

    stretch: float = 0.0
    """Mean excess energy that each part may have for the sake of short seams; 0: the price of slits decides alone."""
    closing: ClosingConfig = field(default_factory=ClosingConfig)
    """How seams are closed."""
    crumbs: CrumbConfig = field(default_factory=CrumbConfig)
    labels: LabelConfig = field(default_factory=LabelConfig)
    slit: SlitConfig = field(default_factory=SlitConfig)
    planar: PlanarConfig = field(default_factory=PlanarConfig)
    """Flat regions, and unfolding them."""
    start: StartConfig = field(default_factory=StartConfig)
    """First labels of the searches."""
    shorten: ShortenConfig = field(default_factory=ShortenConfig)
    """Charts too long for a page."""
    sliver: SliverConfig = field(default_factory=SliverConfig)
    """Triangles thinner than the numbers that hold them."""
    congruence: float = 1e-5
    """Distance, as a share of its size, up to which a part is a copy of another."""
    proxy_faces: int = 2500
    """Faces of the simplified surface on which charts are split and merged."""
    whole_faces: int = 8000
    """Faces up to which a part that unfolds is searched as it is, not simplified; fewer for one of little area."""
    fewest_faces: int = 300
    """The same for a part of little area."""
    faces_per_handle: int = 80
    """Faces of the simplified surface for each handle of the part, where that is more."""
    handles_per_cluster: float = 2.0
    """Handles that a first cluster may have: a part with more starts from more clusters than charts were asked for."""
    carry: CarryConfig = field(default_factory=CarryConfig)
    """From the proxy back to the surface."""
    arcs: ArcConfig = field(default_factory=ArcConfig)
    """Seams made straight."""
    fine: FineConfig = field(default_factory=FineConfig)
    """Parts of many faces."""
    haste: HasteConfig = field(default_factory=HasteConfig)
    """Time budgets."""
    page: PageConfig = field(default_factory=PageConfig)
    """What is wasted of the page."""
    symmetry: SymmetryConfig = field(default_factory=SymmetryConfig)
    """Mirrored charts."""
    energy: EnergyConfig = field(default_factory=EnergyConfig)
    """What finished charts are laid out by."""
    project: ProjectConfig = field(default_factory=ProjectConfig)
    """Charts by projection, where time is out."""
    swift: SwiftConfig = field(default_factory=SwiftConfig)
    """Charts without a search, where there is no time for one."""
    split: SplitConfig = field(default_factory=SplitConfig)
    """Where a chart may be cut in two."""
    crumpled: float = 0.25
    """Mean excess energy of a finished chart above which it is charted anew as a surface of its own."""
    foretold: float = 0.4
    """Energy of a flattening as a share of what curvature foretells, in the median."""
    hopeless: float = 1.5
    """Mean excess energy of a flattening that is not even tested for overlap."""
    bearable: float = 0.5
    """Mean excess energy above which a piece is cut before anything else."""
    flaps: FlapConfig = field(default_factory=FlapConfig)
    """Faces that lie over the rest of their chart."""
    bands: tuple[int, ...] = (2, 1)
    """Rings of faces beside a border that may change sides to make it shorter, in one pass after the other."""
    bands_carried: tuple[int, ...] = (1,)
    """The same for charts that were carried back."""
    stretched: float = 0.05
    """Mean excess energy above which a piece is split, where that pays, before others are merged."""
    doubt: float = 0.003
    """How much better than foretold a merge may turn out: those foretold worse are not tried."""
    looks: int = 4
    """Merges flattened at a time."""
    patience: int = 12
    """Merges flattened in vain before the rest, foretold worse, are believed not to pay."""
    tries: int = 150
    """Merges flattened in a search after which it looks at the most promising alone."""
    most_tries: int = 300
    """Merges flattened in a search after which none is made any more that raises the objective …"""
    most_faces_tried: int = 200_000
    """… and faces of them, which on a large mesh are reached first."""
    few_rounds: int = 2
    """As ``rounds``, for a part of small share."""
    most_excess: float = 0.05
    """Mean excess energy of a part above which it gets more charts than asked for."""
    resort_excess: float = 0.1
    """Mean excess energy of a part above which xatlas is asked too."""
    rounds: int = 8
    """Times the worst chart may be split."""
    vain_splits: int = 3
    """Charts that no split improves, before the search ends."""
    worst_splits: int = 12
    """Charts of most energy that are tried for a split where the stretch is out of bounds."""
    halvings: int = 8
    """Times faces that can't be flattened are halved before xatlas gets them."""
    shared: float = 0.1
    """Share of the smaller border that two pieces must share to be worth a merge."""
    small: float = 0.03
    """Share of the surface under which a piece is small: a merge across a short border is tried too."""
    slit_above: float = 0.003
    """Excess energy over which a finished piece is slit once more, with contacts."""

    @property
    def page_price(self) -> float:
        """What an empty page costs: nothing where the shortest seams are asked for, or few charts."""
        return 0.0 if self.stretch or self.page.free else self.page.price

    @property
    def hull_price(self) -> float:
        """What room as large as the surface costs that charts leave in their convex hulls."""
        return self.page_price * self.page.hull


@dataclass(frozen=True)
class TrainConfig:
    """Everything that decides a result, together with the surface."""

    charts: int = 8
    """K: the most charts a connected surface may get."""
    seed: int = 0
    """Seed of all generators."""
    finish: FinishConfig = field(default_factory=FinishConfig)
    places: PlaceConfig = field(default_factory=PlaceConfig)
    """Prices of seams by place, where hidden ones are asked for or faces protected."""
    importance: float = 2.0
    """Texels per length where a face is important, as a multiple of those elsewhere."""
    fit: FitConfig = field(default_factory=FitConfig)
    wrap: WrapConfig = field(default_factory=WrapConfig)
