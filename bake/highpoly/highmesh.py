"""Several high-poly meshes as one asset, and that asset in the form of an atlas: what a G-buffer of them points into.

f faces of all meshes together · n their vertices.  Positions are in source units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.geometry.triangles import signed_areas, triangle_areas
from ...runtime.io.asset.shading import shaded
from ...runtime.material import Material
from ...runtime.mesh import Asset, Atlas, Surface
from ...runtime.options.atlas import SourceOptions
from ...runtime.pack.exact.seamvertices import atlas_normals

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


def merge_assets(assets: Sequence[Asset]) -> Asset:
    """Several assets as one, faces in order; each with normals (where it has none, as without `--crease-angle`).

    Colours are white and uv 0 where only some have them.
    """
    ready = [shaded(asset, SourceOptions.crease_angle) for asset in assets]
    if len(ready) == 1:
        return ready[0]
    vertices = np.cumsum([0, *(len(asset.positions) for asset in ready)])
    welded = np.cumsum([0, *(len(asset.surface.vertices) for asset in ready)])
    materials = [asset.materials or (Material(),) for asset in ready]
    first = np.cumsum([0, *(len(own) for own in materials)])
    surface = Surface(
        np.concatenate([asset.surface.vertices for asset in ready]),
        np.concatenate([asset.surface.faces + start for asset, start in zip(ready, welded[:-1], strict=True)]),
    )
    return Asset(
        positions=np.concatenate([asset.positions for asset in ready]),
        faces=np.concatenate([asset.faces + start for asset, start in zip(ready, vertices[:-1], strict=True)]),
        weld=np.concatenate([asset.weld + start for asset, start in zip(ready, welded[:-1], strict=True)]),
        surface=surface,
        normals=np.concatenate([asset.normals for asset in ready if asset.normals is not None]),
        colors=_joined([asset.colors for asset in ready], vertices, np.full((1, 4), 255, np.uint8)),
        uv=_joined([asset.uv for asset in ready], vertices, np.zeros((1, 2))),
        materials=tuple(material for own in materials for material in own),
        face_material=np.concatenate(
            [_face_material(asset) + start for asset, start in zip(ready, first, strict=False)]
        ),
        stem=ready[0].stem,
    )


def atlas_of(asset: Asset, density: float) -> Atlas:
    """The asset's own vertices in the form of an atlas, for maps to look up; it can't be drawn.

    Its uv are the asset's, scaled so that a uv unit is as long on the surface as that of another atlas, which has
    `density` uv units per source unit: so the footprint of that atlas' texels in the asset's textures comes out right
    in size.
    """
    uv = np.zeros((len(asset.positions), 2))
    if asset.uv is not None:
        own = uv_per_unit(asset.positions[asset.faces], asset.uv[asset.faces])
        uv = asset.uv * (density / own if own > 0.0 else 1.0)
    return Atlas(
        positions=asset.positions,
        faces=asset.faces,
        uv=uv.astype(np.float32),
        normals=atlas_normals(asset, np.arange(len(asset.positions))),
        face_chart=np.zeros(len(asset.faces), np.int64),
        source_vertex=np.arange(len(asset.positions)),
        size=1,
        padding=0,
    )


def uv_per_unit(triangles: NDArray[np.float64], corner_uv: NDArray[np.float64]) -> float:
    """Length in uv of a source unit, on average over faces (f, 3, 3) with uv (f, 3, 2); 0 without uv area."""
    area, uv_area = triangle_areas(triangles).sum(), np.abs(signed_areas(corner_uv)).sum()
    return float(np.sqrt(uv_area / max(area, np.finfo(np.float64).tiny)))


def _face_material(asset: Asset) -> NDArray[np.int64]:
    """(f,) material of each face."""
    return asset.face_material if asset.face_material is not None else np.zeros(len(asset.faces), np.int64)


def _joined(
    parts: Sequence[NDArray[Any] | None], starts: NDArray[np.int64], instead: NDArray[Any]
) -> NDArray[Any] | None:
    """Per-vertex arrays in a row, one row of `instead` repeated for those that are absent; None when all are."""
    if all(part is None for part in parts):
        return None
    counts = np.diff(starts)
    rows = [np.repeat(instead, n, axis=0) if part is None else part for part, n in zip(parts, counts, strict=True)]
    return np.concatenate(rows)
