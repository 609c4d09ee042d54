"""The source's colour on the new uv: its texture looked up through the old uv, its vertex colours, its factors.

t texels · n file vertices · h w source texels.  The two atlases lie on the same faces, so no search is needed: the
G-buffer names face and place, the old uv follow by interpolation.  Filtering is bilinear in linear light, wrapping
repeats (the glTF default).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..runtime.mesh import Material
from .color import byte_to_linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Asset, Atlas
    from .gbuffer import GBuffer


def source_color(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """(h, w, 4) float32 linear RGBA: factor × (texture, else vertex colour, else white); 0 where nothing is."""
    height, width = gbuffer.shape
    result = np.zeros((height * width, 4), np.float32)
    corners = atlas.source_vertex[atlas.faces]
    materials = asset.materials or (Material(),)
    face_material = asset.face_material if asset.face_material is not None else np.zeros(len(corners), np.int64)
    colors = None if asset.colors is None else linear_colors(asset.colors)
    for texels in gbuffer.chunks():
        material_of = face_material[gbuffer.face.reshape(-1)[texels]]
        for index in np.unique(material_of):
            chosen = texels[material_of == index]
            material = materials[int(index)]
            factor = np.asarray(material.base_color_factor, np.float32)
            if material.base_color is not None and asset.uv is not None:
                uv = gbuffer.interpolate(asset.uv - np.floor(asset.uv.min(axis=0)), corners, chosen)
                result[chosen] = factor * sample_bilinear(material.base_color, uv)
            elif colors is not None:
                result[chosen] = factor * gbuffer.interpolate(colors, corners, chosen)
            else:
                result[chosen] = factor
    return result.reshape(height, width, 4)


def linear_colors(colors: NDArray[np.uint8]) -> NDArray[np.float32]:
    """(…, 4) uint8 sRGB with straight alpha → float32 linear RGBA in [0, 1]."""
    linear = byte_to_linear()[colors]
    linear[..., 3] = colors[..., 3] / np.float32(255.0)
    return linear


def sample_bilinear(image: NDArray[np.uint8], uv: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t, 4) float32 linear RGBA of a (h, w, 4) uint8 sRGB image, row 0 = top, at uv (t, 2), v up, repeated."""
    height, width = image.shape[:2]
    x = np.mod(uv[:, 0].astype(np.float64), 1.0) * width - 0.5
    y = np.mod(1.0 - uv[:, 1].astype(np.float64), 1.0) * height - 0.5
    left, top = np.floor(x).astype(np.int64), np.floor(y).astype(np.int64)
    across, down = (x - left).astype(np.float32)[:, None], (y - top).astype(np.float32)[:, None]
    right, bottom = (left + 1) % width, (top + 1) % height
    left, top = left % width, top % height
    upper = _texel(image, top, left) * (1.0 - across) + _texel(image, top, right) * across
    lower = _texel(image, bottom, left) * (1.0 - across) + _texel(image, bottom, right) * across
    return upper * (1.0 - down) + lower * down


def _texel(image: NDArray[np.uint8], row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.float32]:
    """(t, 4) float32 linear RGBA of single texels."""
    return linear_colors(image[row, column])
