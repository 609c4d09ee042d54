"""Colours of the source: those of its vertices, and the base colour of its materials.   h w texels, linear light."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from .material import base_color_map
from .resample import linear_colors

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..bakemap import Compute
    from ..raster.gbuffer import GBuffer


def vertex_color_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Interpolated vertex colour.

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels, 4 where alpha varies from 1).

    Raises: InputError when the mesh has no vertex colours.
    """
    if asset.colors is None:
        raise InputError(f"{asset.stem} has no vertex colours to bake; choose other maps than vertex-color")
    height, width = gbuffer.shape
    result = np.zeros((height * width, 4), np.float32)
    colors = linear_colors(asset.colors)
    corners = atlas.source_vertex[atlas.faces]
    for texels in gbuffer.chunks():
        result[texels] = gbuffer.interpolate(colors, corners, texels)
    return without_opaque_alpha(result.reshape(height, width, 4), gbuffer)


def opaque_color_map() -> Compute:
    """The source's base colour, see `material.base_color_map`, without alpha if it is 1 all over (3 or 4 channels)."""
    color = base_color_map()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        return without_opaque_alpha(color(gbuffer, atlas, asset), gbuffer)

    return compute


def without_opaque_alpha(color: NDArray[np.float32], gbuffer: GBuffer) -> NDArray[np.float32]:
    """(h, w, 4) → (h, w, 3) when alpha is 1 wherever a surface lies (to 1/510), else unchanged."""
    alpha = color.reshape(-1, 4)[gbuffer.texels, 3]
    return color if (alpha < 1.0 - 1.0 / 510.0).any() else np.ascontiguousarray(color[..., :3])
