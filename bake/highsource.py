"""The high-poly meshes that options name, read and ready for baking."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ..runtime.extras import requires

if TYPE_CHECKING:
    from ..runtime.mesh import Asset
    from ..runtime.options.sources import MapSources
    from ..runtime.options.unwrap import Outputs
    from .highpoly.highmaps import HighSource


def mesh_maps(outputs: Outputs, asset: Asset, high: HighSource | None) -> Outputs:
    """The same for one mesh, "auto" replaced by the maps it stands for.  Raises: as `Outputs.for_asset`."""
    return outputs.for_asset(asset) if high is None else high.outputs(outputs)


def high_source(sources: MapSources, crease_angle: float) -> HighSource | None:
    """The high-poly meshes and how far rays reach for them; None where there are none.

    crease_angle: degrees, for those without normals.
    Raises: MissingFileError, InputError, MeshError for a mesh or cage that is none.
    """
    if not sources.high:
        return None
    with requires("bake"):
        from .highpoly.cage import CageSettings
        from .highpoly.highmaps import HighSource
    from ..runtime.io.asset.shading import shaded
    from ..runtime.io.meshfile import load_asset

    if sources.reach is None:
        cage = CageSettings(cage=load_asset(Path(sources.cage)), match_names=sources.match_names)
    else:
        cage = CageSettings(sources.reach, match_names=sources.match_names)
    return HighSource([shaded(load_asset(path, instances=True), crease_angle) for path in sources.high], cage)
