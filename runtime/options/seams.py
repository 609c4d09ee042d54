"""What a user may ask of seams and of the number of charts: see unwrap.py, whose rules hold here too.

Annotations are evaluated here, as there.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Literal

from .words import Flag, Names, demand, demand_known

AUTO = "auto"
MANY = 10_000
"""The most charts of a connected part where as many as pay are asked for."""
KEPT = ("uv", "hard", "material")
"""Borders of a mesh that can stay."""
HARD = ("free", "split")
SEAMS = ("short", "hidden", "crease")
SYMMETRIES = ("none", "auto", "x", "y", "z")
ENERGIES = ("isometric", "conformal", "arap")
DENSITIES = (0.1, 10.0)
"""Least and greatest density of what is important."""
DEAREST, LEAST_STRETCH, MOST_STRETCH = 10.0, 1.0001, 2.0


@dataclass(frozen=True, kw_only=True)
class SeamOptions:
    """How many charts, and what their seams may cost."""

    charts: int | Literal["auto"] = 8
    """The most charts that each connected part of the surface may get; auto for as many as pay."""
    seam_price: float = 0.003
    """Mean stretch above 1 that a seam as long as √area has to save: higher for fewer and shorter seams and more
    stretch, lower for the reverse."""
    page_price: float = 0.01
    """Mean stretch above 1 that a page left empty would have to save: what share of it charts leave empty costs so much
    of this. Higher for charts that fill the page, 0 for seams and stretch alone."""
    max_stretch: float | None = None
    """Mean stretch (symmetric Dirichlet, 1 is none) that each connected part may have, for the shortest seams that
    keep it, whatever they waste of the page, for instance 1.025; by default the prices decide alone."""
    seams: Literal["short", "hidden", "crease"] = "short"
    """Where seams go: short ones anywhere, hidden ones where the surface sees less of the sky (needs flexpara[bake]),
    or along creases, though they are longer for it."""
    symmetry: Literal["none", "auto", "x", "y", "z"] = "none"
    """Mirrored charts, where a part is its own mirror image across x, y or z: auto looks for the plane, and takes them
    where they cost no more than others by the objective."""
    energy: Literal["isometric", "conformal", "arap"] = "isometric"
    """What finished charts are laid out by: little distortion of any kind, true angles at whatever size, or faces as
    rigid as possible.  The search and the report go by the first."""
    protect: Path | None = None
    """Where seams cost up to ten times as much: a vertex attribute (_NAME of glTF, a property of PLY, or red, green,
    blue, alpha of vertex colours), a picture over the mesh's uv, white for most, or a .npy file of points (n, 3)."""
    importance: Path | None = None
    """Where charts get more texels, named as for protect: each by the mean of its importance, 0 to 1."""
    importance_density: float = 2.0
    """Texels per length of a chart of importance 1, as a multiple of those at importance 0: 0.1 to 10."""
    hard_edges: Literal["free", "split"] = "free"
    """Whether every hard edge (split normals, smoothing groups, or the crease angle) becomes a seam: split, as normal
    maps for games want it, or free."""
    keep_seams: Names = ()
    """Borders that stay seams: uv (those of the mesh's own uv), hard (hard edges), material.  New ones are added."""
    keep_islands: Flag = False
    """Keep the islands of the mesh's own uv as they are cut: only distortion inside them is lowered."""
    start: Path | None = None
    """A mesh file of the same triangles with uv, an atlas to improve: its charts are one of the search's starts, and
    what comes out is no worse by the objective."""
    cut: Path | None = None
    """A text file of cuts to make: six numbers a line, two points; the shortest way along edges between the vertices
    nearest to them becomes a seam."""

    def __post_init__(self) -> None:
        number = isinstance(self.charts, int) and not isinstance(self.charts, bool)
        fits = self.charts == AUTO or (number and self.most_charts >= 1)
        demand(fits, f"charts is {self.charts!r}, expected 1 or more, or auto; pass for instance --charts 8")
        priced = 0.0 < self.seam_price <= DEAREST
        found = f"seam-price is {self.seam_price}, expected above 0, up to {DEAREST:g}"
        demand(priced, f"{found}; pass for instance --seam-price 0.003")
        fits = 0.0 <= self.page_price <= DEAREST
        found = f"page-price is {self.page_price}, expected 0 to {DEAREST:g}"
        demand(fits, f"{found}; pass for instance --page-price 0.01")
        bounded = self.max_stretch is None or LEAST_STRETCH <= self.max_stretch <= MOST_STRETCH
        found = f"max-stretch is {self.max_stretch}, expected {LEAST_STRETCH:g} to {MOST_STRETCH:g}"
        demand(bounded, f"{found}; pass for instance --max-stretch 1.025")
        alone = self.start is None or not self.keep_islands
        demand(alone, "start with keep-islands, expected one of them: both are an atlas to begin from; leave one out")
        demand_known("hard-edges", self.hard_edges, HARD)
        demand_known("seams", self.seams, SEAMS)
        demand_known("symmetry", self.symmetry, SYMMETRIES)
        demand_known("energy", self.energy, ENERGIES)
        least, most = DENSITIES
        found = f"importance-density is {self.importance_density}, expected {least:g} to {most:g}"
        demand(least <= self.importance_density <= most, f"{found}; pass for instance --importance-density 2")
        plain = self.energy == ENERGIES[0] or self.max_stretch is None
        demand(plain, f"energy {self.energy} with max-stretch, which bounds the isometric one; leave one of them out")
        for name in self.keep_seams:
            demand(name in KEPT, f"keep-seams is {name!r}, expected some of {', '.join(KEPT)}; leave --keep-seams out")

    @property
    def kept(self) -> tuple[str, ...]:
        """Kinds of borders that stay seams, each once."""
        hard = ("hard",) if self.hard_edges == "split" else ()
        return tuple(dict.fromkeys((*self.keep_seams, *hard)))

    @property
    def most_charts(self) -> int:
        """The most charts of a connected part, as a number."""
        return self.charts if isinstance(self.charts, int) else MANY


def fast_alone() -> tuple[str, ...]:
    """Options that preset paper, which learns its seams, has no use for."""
    return tuple(field.name for field in fields(SeamOptions) if field.name != "charts")
