"""What a user may ask of the source, of the atlas as an image, and of chance: see unwrap.py, whose rules hold here."""

from dataclasses import dataclass
from typing import Literal

from ..pagesize import PageSize, Size
from .words import Flag, Names, demand, demand_known

SIZES = (16, 16384)
ROTATIONS = ("off", "90", "any")
STACKS = ("off", "identical", "mirrored")
LARGEST_SEED = 2**32 - 1


@dataclass(frozen=True, kw_only=True)
class Seeded:
    """Everything random follows from one number."""

    seed: int = 0
    """The start of all random numbers: the same seed on the same machine gives the same bytes."""

    def __post_init__(self) -> None:
        found = f"seed is {self.seed}, expected 0 to {LARGEST_SEED}"
        demand(0 <= self.seed <= LARGEST_SEED, f"{found}; pass for instance --seed 0")


@dataclass(frozen=True, kw_only=True)
class SourceOptions:
    """What is read of a file."""

    select: Names = ()
    """Nodes and meshes of a glTF scene to work on, by name; all else comes back as it is.  By default all of it."""
    crease_angle: float = 30.0
    """Degrees between two faces, 0 to 180, above which the edge between them is sharp, where a file has no normals.
    Facets of STL files and smoothing groups of OBJ files decide without it."""

    def __post_init__(self) -> None:
        found = f"crease-angle is {self.crease_angle}, expected 0 to 180 degrees"
        demand(0.0 <= self.crease_angle <= 180.0, f"{found}; pass for instance --crease-angle 30")


@dataclass(frozen=True, kw_only=True)
class AtlasOptions(SourceOptions):
    """The atlas as an image."""

    size: Size = 2048
    """Texels of the atlas and its textures: the side of a square, 16 to 16384, or WIDTHxHEIGHT, as 2048x1024."""
    padding: int | None = None
    """Texels that are kept free around each chart; by default what the target asks for, else the
    longer side / 256, at least 2, or less where charts are so many or so thin that it would take half of the page."""
    texel_density: float | None = None
    """Texels per unit of the source, equal over all files with the same number; by default as many as fit."""
    rotation: Literal["off", "90", "any"] = "any"
    """How charts may be turned: not at all, by quarter turns, or first upright and then by quarter turns."""
    stack: Literal["off", "identical", "mirrored"] = "off"
    """Charts of one shape to lay over each other, to share their texels: none, identical ones, or mirror images too."""
    whole_texels: Flag = False
    """Let the edges of rectangular charts lie between texels; they give up a part of a texel for it."""

    def __post_init__(self) -> None:
        SourceOptions.__post_init__(self)
        demand_known("rotation", self.rotation, ROTATIONS)
        demand_known("stack", self.stack, STACKS)
        (low, high), most = SIZES, min(self.page) // 8
        fits = low <= min(self.page) and self.page.side <= high
        demand(fits, f"size is {self.size} texels, expected {low} to {high}; pass --size 2048")
        dense = self.texel_density is None or self.texel_density > 0
        demand(dense, f"texel-density is {self.texel_density}, expected above 0; pass for instance --texel-density 512")
        demand(0 <= self.margin <= most, f"padding is {self.margin} texels, expected 0 to {most}; leave --padding out")

    @property
    def margin(self) -> int:
        """The padding in texels, where charts are not so many that it spares them some."""
        return max(2, self.page.side // 256) if self.padding is None else self.padding

    @property
    def page(self) -> PageSize:
        """Width and height in texels."""
        return PageSize.of(self.size)
