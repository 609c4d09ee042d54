"""What of a mesh with uv the report shows: its arrays, and what is true of each face.

n vertices, split along seams · f faces · s seam segments · k charts.  Positions in source units, uv v up.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.distortion import singular_values
from ...runtime.geometry.metrics import face_distortion, uv_charts
from ...runtime.geometry.overlap import orientation_sign, overlapping_pairs
from ...runtime.geometry.topology import edge_table
from ...runtime.geometry.triangles import jacobians, signed_areas, triangle_areas
from ...runtime.mesh import Surface
from ...runtime.pack.exact.seamvertices import atlas_normals
from ..colors.heat import distortion_scale

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas

FLIPPED, OVERLAPPING = 1, 2
"""Bits of `Shape.flags`."""


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh with uv.

    positions: (n, 3) float64.  faces: (f, 3) int64.  uv: (n, 2) float64.  normals: (n, 3) float32 unit.
    surface: the same faces over welded vertices.  extent: (2,) of the page, its longer side 1.
    """

    positions: NDArray[np.float64]
    faces: NDArray[np.int64]
    uv: NDArray[np.float64]
    normals: NDArray[np.float32]
    surface: Surface
    extent: NDArray[np.float64] = field(default_factory=lambda: np.ones(2))

    @classmethod
    def of_atlas(cls, atlas: Atlas, asset: Asset) -> Shape:
        """An atlas as it is written."""
        return cls(
            atlas.positions, atlas.faces, atlas.uv.astype(np.float64), atlas.normals, asset.surface, atlas.page.extent
        )

    @classmethod
    def of_asset(cls, asset: Asset, uv: NDArray[np.float64]) -> Shape:
        """A mesh with uv (n, 2) of its file vertices."""
        normals = atlas_normals(asset, np.arange(len(asset.positions)))
        return cls(asset.positions, asset.faces, uv, normals, asset.surface)

    @property
    def corner_uv(self) -> NDArray[np.float64]:
        """(f, 3, 2) float64."""
        return self.uv[self.faces]

    @property
    def even_uv(self) -> NDArray[np.float64]:
        """(f, 3, 2) float64 in sides of the page."""
        return self.corner_uv * self.extent


@dataclass(frozen=True, eq=False)
class FaceFacts:
    """What the report says of faces when someone points at them.

    chart: (f,) int64 in [0, k).  stretch: (f, 2) float64, σ₁ ≥ σ₂ of surface → uv at equal total area.
    heat: (f,) in [−1, 1] at `top`: see `heat`.  flags: (f,) uint8 of FLIPPED and OVERLAPPING.
    energy: (f,) float64 symmetric Dirichlet.  seams: (s, 2) int64 vertices; each seam once for each of its sides.
    """

    chart: NDArray[np.int64]
    stretch: NDArray[np.float64]
    energy: NDArray[np.float64]
    larger: NDArray[np.bool_]
    flags: NDArray[np.uint8]
    seams: NDArray[np.int64]

    @property
    def top(self) -> float:
        """Upper end of the colour scale of distortion."""
        return distortion_scale(self.energy)

    def heat(self, top: float) -> NDArray[np.float64]:
        """(f,) in [−1, 1]: 0 = isometric, ±1 = an energy of `top` or more; positive where uv is larger than its share.

        The value of `heat.signed_distortion`.
        """
        excess = np.clip((self.energy - 1.0) / (top - 1.0), 0.0, 1.0)
        return np.where(self.larger, excess, -excess)


def face_facts(shape: Shape) -> FaceFacts:
    """What is true of each face.  Raises: InputError as `metrics.measure`."""
    corner_uv, even_uv, surface = shape.corner_uv, shape.even_uv, shape.surface
    energy = face_distortion(surface, even_uv)
    area, flat = triangle_areas(surface.triangles), signed_areas(even_uv)
    scale = np.sqrt(area.sum() / np.abs(flat).sum())
    solid = area > 0.0
    stretch = np.ones((len(area), 2))
    stretch[solid] = singular_values(jacobians(surface.triangles[solid], even_uv[solid] * scale)).T
    chart, seam = uv_charts(surface.faces, corner_uv)
    table = edge_table(surface.faces)
    corners = np.stack([shape.faces, np.roll(shape.faces, -1, axis=1)], axis=2)
    return FaceFacts(
        chart,
        stretch,
        energy,
        np.abs(flat) * area.sum() >= area * np.abs(flat).sum(),
        _flags(corner_uv, chart),
        corners[seam[table.face_edges]],
    )


def _flags(corner_uv: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.uint8]:
    """(f,) FLIPPED where a face is turned over against its chart, OVERLAPPING where its interior meets another's."""
    flags = np.zeros(len(corner_uv), np.uint8)
    total = np.bincount(chart, signed_areas(corner_uv))
    sign = orientation_sign(corner_uv[:, 0], corner_uv[:, 1], corner_uv[:, 2])
    flags[sign * np.where(total < 0.0, -1, 1)[chart] < 0] = FLIPPED
    flags[np.unique(overlapping_pairs(corner_uv))] |= OVERLAPPING
    return flags
