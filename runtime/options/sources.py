"""What maps may be taken from beside the mesh itself: see unwrap.py, whose rules hold here too."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter

from .words import Flag, Paths, demand


@dataclass(frozen=True, kw_only=True)
class MapSources:
    """High-poly meshes and fields."""

    high: Paths = ()
    """A high-poly mesh that the maps are taken from; may be given several times."""
    cage: str = "0.02"
    """How far the rays reach for it: a share of the bounding box's diagonal, or a cage mesh with the low-poly's
    faces."""
    match_names: Flag = False
    """Let each part of the low-poly mesh see only the high-poly parts that have its name."""
    fields: Annotated[Paths, Parameter(name="--field")] = ()
    """An ONNX file from points to channels, which becomes a map; may be given several times."""

    def __post_init__(self) -> None:
        alone = not self.high and (self.cage, self.match_names) != (MapSources.cage, MapSources.match_names)
        demand(not alone, "cage or match-names without high, expected a high-poly mesh; add --high, or leave them out")

    @property
    def reach(self) -> float | None:
        """The cage as a number; None where it is a mesh."""
        try:
            return float(self.cage)
        except ValueError:
            return None

    def facts(self) -> dict[str, Any]:
        """All options as JSON, files by their names."""
        plain = asdict(self)
        cage = self.cage if self.reach is not None else Path(self.cage).name
        return plain | {"cage": cage} | {name: [path.name for path in plain[name]] for name in ("high", "fields")}
