"""Maps baked from high-poly meshes: the same functions, of the G-buffer of the high-poly surface.

h w texels.  What describes the low-poly mesh itself (its charts, uv, faces, distortion) is not transferred.
Tangent-space vectors are those of the high-poly surface in the low-poly's frames, the tangents written to the file.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from ...runtime.material import source_maps
from ..bakemap import BakeMap
from ..maps.catalogue import HEIGHT, find_map
from ..maps.normals import in_tangent_space, object_normal_map
from ..maps.occlusion import bent_normal_object_map
from ..maps.rays import RaySettings
from .highpoly import Projector

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.unwrap import Outputs
    from ..bakemap import Compute, NormalFormat
    from ..maps.rays import Progress
    from ..raster.gbuffer import GBuffer
    from .cage import CageSettings
    from .highpoly import HighSurface

OWN = ("chart", "uv-checker", "face-id", "distortion")
"""Maps that describe the low-poly mesh."""


class HighSource:
    """High-poly meshes to bake from.

    It keeps the surface found for the last G-buffer, which all maps of a window share, and counts what was missed.
    """

    def __init__(
        self, highs: Sequence[Asset], settings: CageSettings | None = None, *, progress: Progress | None = None
    ) -> None:
        """Prepare.  highs, settings: see `Projector.of`.  progress: called as progress(done, total), in texels."""
        if not highs:
            raise InputError("no high-poly mesh: expected one or more; pass --high high.obj")
        self._reports: dict[tuple[int, int], dict[str, float]] = {}
        self._highs, self._settings, self._progress = tuple(highs), settings, progress
        self._projector = lru_cache(maxsize=1)(self._make_projector)
        self._found = lru_cache(maxsize=1)(self._find)

    def surface(self, gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> HighSurface:
        """The high-poly surface under a G-buffer of the low-poly atlas.  Raises as `Projector.of`."""
        return self._found(gbuffer, atlas, asset)

    def outputs(self, outputs: Outputs) -> Outputs:
        """The same with "auto" replaced by the maps that the high-poly meshes have, their normals first."""
        return outputs.with_auto(("normal", *(name for high in self._highs for name in source_maps(high))))

    def find_map(
        self, name: str, *, normal_format: NormalFormat = "opengl", rays: RaySettings | None = None
    ) -> BakeMap:
        """The map of that name as baked from the high-poly meshes; that of the low-poly mesh where it describes it.

        Arguments and errors as `catalogue.find_map`; height is known here too.
        """
        if name == HEIGHT:
            return BakeMap(HEIGHT, "ray", "source units", "any", "linear", "exr", 32, self._height, (0.0, 0.0, 0.0))
        entry = find_map(name, normal_format=normal_format, rays=rays)
        if name in OWN:
            return entry
        vectors = {
            "normal": object_normal_map(),
            "bent-normal": bent_normal_object_map(rays or RaySettings()),
        }
        if entry.name in vectors:
            return replace(entry, compute=in_tangent_space(self._of_high(vectors[entry.name]), normal_format))
        return replace(entry, compute=self._of_high(entry.compute))

    def report(self) -> dict[str, float]:
        """Texels, those missed and their share, and the extreme heights, over all windows baked so far."""
        reports = list(self._reports.values())
        texels = sum(entry["texels"] for entry in reports)
        missed = sum(entry["missed"] for entry in reports)
        return {
            "texels": texels,
            "missed": missed,
            "missed_share": missed / max(texels, 1),
            "highest": max((entry["highest"] for entry in reports), default=0.0),
            "lowest": min((entry["lowest"] for entry in reports), default=0.0),
        }

    def _make_projector(self, atlas: Atlas, asset: Asset) -> Projector:
        """Scenes of the high-poly meshes, made once for all windows."""
        return Projector.of(atlas, asset, self._highs, self._settings)

    def _find(self, gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> HighSurface:
        """The surface under a window, and its report."""
        found = self._projector(atlas, asset).surface(gbuffer, self._progress)
        self._reports[gbuffer.row, gbuffer.column] = found.report()
        return found

    def _of_high(self, compute: Compute) -> Compute:
        """The same function, of the high-poly surface."""

        def transferred(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
            high = self.surface(gbuffer, atlas, asset)
            return compute(high.gbuffer, high.atlas, high.asset)

        return transferred

    def _height(self, gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        """(h, w, 1) float32 source units, from the low-poly surface outwards."""
        return self.surface(gbuffer, atlas, asset).height[..., None]
