"""What `flexpara pack` may be asked: see unwrap.py, whose rules hold here too."""

from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from .atlas import AtlasOptions, Seeded
from .sources import MapSources
from .unwrap import FORMATS, MOST_PAGES, MapOptions, Outputs
from .words import Flag, Names, Paths, demand

if TYPE_CHECKING:
    from ..mesh import Asset

OWN = "own"
"""Format of a file as it was given."""
DENSITIES = ("equal", "kept")


@dataclass(frozen=True, kw_only=True)
class PackOptions(Seeded, AtlasOptions):
    """How the islands that a mesh has are packed.

    Raises: InputError for a value outside what its field allows.
    """

    density: Literal["equal", "kept"] = "equal"
    """Texels per unit of the source: equal on all islands, or kept as they are beside each other."""
    pages: int = 1
    """Pages that the islands are shared out to, 1 to 1000, at one texel density: where one would be too coarse."""
    udim: Flag = False
    """Lay each page into a square of uv of its own, as UDIM tiles 1001, 1002, …, with textures STEM_MAP.1001.png and so
    on.  Without it each page has a material and textures of its own in one glb or gltf file."""

    def __post_init__(self) -> None:
        AtlasOptions.__post_init__(self)
        Seeded.__post_init__(self)
        found = f"density is {self.density!r}, expected equal or kept"
        demand(self.density in DENSITIES, f"{found}; pass for instance --density kept")
        both = self.density == "kept" and self.texel_density is not None
        found = f"pages is {self.pages}, expected 1 to {MOST_PAGES}"
        demand(1 <= self.pages <= MOST_PAGES, f"{found}; pass for instance --pages 4")
        stacked = self.pages > 1 and self.stack != "off"
        demand(not stacked, "stack with several pages, expected one of the two; leave the other out")
        demand(not both, "density kept with a texel-density, expected one of the two; leave the other out")

    def ending(self, suffix: str) -> str:
        """Ending of a mesh's own format: of files with one material, glb where each page gets one."""
        several = self.pages > 1 and not self.udim and suffix.lower() not in (".glb", ".gltf")
        return ".glb" if several else suffix


@dataclass(frozen=True, kw_only=True)
class PackOutputs(Outputs):
    """What `flexpara pack` writes."""

    formats: Annotated[Names, Parameter(name="--format")] = (OWN,)
    """Mesh files to write: some of glb, gltf (with a .bin beside it), obj, ply, usda and npz; by default the format of
    each mesh, and glb where that can't be written."""
    inverse: Annotated[Flag, Parameter(show=False)] = False
    high: Annotated[Paths, Parameter(show=False)] = ()
    cage: Annotated[str, Parameter(show=False)] = MapSources.cage
    match_names: Annotated[Flag, Parameter(show=False)] = False

    def __post_init__(self) -> None:
        demand(not self.inverse, "inverse with pack, which fits no networks, expected unwrap; leave it out")
        demand(not self.high, "high with pack, which moves textures, expected none; flexpara bake onto what it writes")
        if self.formats == (OWN,):
            MapOptions.__post_init__(self)
            MapSources.__post_init__(self)
        else:
            Outputs.__post_init__(self)

    def for_mesh(self, asset: "Asset", suffix: str) -> Outputs:
        """The same as an unwrap has it, for one mesh from a file of that ending: as `Outputs.for_asset`."""
        kind = suffix.lower().removeprefix(".")
        kinds = (kind if kind in FORMATS else "glb",) if self.formats == (OWN,) else self.formats
        plain = {field.name: getattr(self, field.name) for field in fields(Outputs)}
        return Outputs(**{**plain, "formats": kinds}).for_asset(asset)
