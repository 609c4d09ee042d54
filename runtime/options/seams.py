"""What a user may ask of seams and of the number of charts: see unwrap.py, whose rules hold here too.

Annotations are evaluated here, as there.
"""

from dataclasses import dataclass
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
DEAREST, LEAST_STRETCH, MOST_STRETCH = 10.0, 1.0001, 2.0


@dataclass(frozen=True, kw_only=True)
class SeamOptions:
    """How many charts, and what their seams may cost."""

    charts: int | Literal["auto"] = 8
    """The most charts that each connected part of the surface may get; auto for as many as pay."""
    seam_price: float = 0.003
    """Mean stretch above 1 that a seam as long as √area has to save: higher for fewer and shorter seams and more
    stretch, lower for the reverse."""
    max_stretch: float | None = None
    """Mean stretch (symmetric Dirichlet, 1 is none) that each connected part may have, for the shortest seams that
    keep it, for instance 1.025; by default the seam price decides alone."""
    seams: Literal["short", "hidden", "crease"] = "short"
    """Where seams go: short ones anywhere, hidden ones where the surface sees less of the sky (needs flexpara[bake]),
    or along creases, though they are longer for it."""
    protect: Path | None = None
    """A .npy file of points (n, 3), in the units of the mesh, near which seams cost ten times as much."""
    hard_edges: Literal["free", "split"] = "free"
    """Whether every hard edge (split normals, smoothing groups, or the crease angle) becomes a seam: split, as normal
    maps for games want it, or free."""
    keep_seams: Names = ()
    """Borders that stay seams: uv (those of the mesh's own uv), hard (hard edges), material.  New ones are added."""
    keep_islands: Flag = False
    """Keep the islands of the mesh's own uv as they are cut: only distortion inside them is lowered."""
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
        bounded = self.max_stretch is None or LEAST_STRETCH <= self.max_stretch <= MOST_STRETCH
        found = f"max-stretch is {self.max_stretch}, expected {LEAST_STRETCH:g} to {MOST_STRETCH:g}"
        demand(bounded, f"{found}; pass for instance --max-stretch 1.025")
        demand_known("hard-edges", self.hard_edges, HARD)
        demand_known("seams", self.seams, SEAMS)
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
