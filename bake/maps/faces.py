"""Maps that name or measure faces: their number, chart, material and distortion.

h w texels, row 0 = top · f faces.  Values are constant on a face, so nothing is interpolated.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.metrics import face_distortion
from ..colors.color import chart_colors
from ..colors.heat import distortion_scale, heat_colors, signed_distortion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..bakemap import Compute
    from ..raster.gbuffer import GBuffer


def face_id_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Number of the face, that of the file where cleaning dropped none; −1 where nothing is.

    No space, whole numbers, exact up to 2²⁴; linear, EXR float by default (1 channel).
    """
    del atlas, asset
    return gbuffer.face.astype(np.float32)[..., None]


def material_id_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """A flat colour per material of the source, distinct for neighbouring numbers: a mask to select by.

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels).
    """
    material = np.zeros(len(atlas.faces), np.int64) if asset.face_material is None else asset.face_material
    colors = chart_colors(int(material.max(initial=0)) + 1)
    return np.take(colors[material], gbuffer.face, axis=0, mode="clip")


def chart_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Colour of the chart, distinct for neighbouring numbers.

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels).
    """
    del asset
    colors = chart_colors(int(atlas.face_chart.max(initial=0)) + 1)
    return np.take(colors[atlas.face_chart], gbuffer.face, axis=0, mode="clip")


def distortion_map() -> Compute:
    """Heat map of the symmetric Dirichlet energy per face: white = isometric, blue = too small in uv, red = too large.

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels).  The deepest colour stands for the first
    of heat.SCALES that 98 % of the faces do not exceed, as in the preview's legend.
    """

    @lru_cache(maxsize=1)
    def face_colors(atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        stretch = face_distortion(asset.surface, atlas.even_uv)
        return heat_colors(signed_distortion(atlas, stretch, distortion_scale(stretch)))

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        return np.take(face_colors(atlas, asset), gbuffer.face, axis=0, mode="clip")

    return compute
