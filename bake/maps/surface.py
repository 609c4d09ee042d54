"""Functions of the surface point as maps: its position, and whatever a caller passes.

t texels of one call · c channels, 1 to 4.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from ...runtime.mesh import Asset, Surface
from ..bakemap import BakeMap

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ...runtime.mesh import Atlas
    from ..raster.gbuffer import GBuffer

SurfaceFunction = Callable[["NDArray[np.float32]", "NDArray[np.float32]", "NDArray[np.int64]"], "ArrayLike"]
"""Positions (t, 3), unit normals (t, 3), face numbers (t,) → (t,) or (t, c)."""


def position_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Surface point.  Object space, source units, any range; linear, EXR float by default (3 channels)."""
    del atlas, asset
    return np.ascontiguousarray(gbuffer.position)


def function_map(name: str, function: SurfaceFunction) -> BakeMap:
    """A map out of a function of positions, normals and face numbers, which is called with many texels at a time.

    Any space and range; linear, EXR float (1 to 4 channels).
    """

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        del atlas, asset
        position, normal = gbuffer.position.reshape(-1, 3), gbuffer.normal.reshape(-1, 3)
        face, result = gbuffer.face.reshape(-1), None
        for texels in gbuffer.chunks():
            values = np.asarray(function(position[texels], normal[texels], face[texels].astype(np.int64)), np.float32)
            if values.ndim not in (1, 2) or len(values) != len(texels):
                expected = f"({len(texels)},) or ({len(texels)}, 1 to 4)"
                raise InputError(f"map {name}: its function returned {values.shape}; expected {expected}")
            values = values.reshape(len(texels), -1)
            result = np.zeros((face.size, values.shape[1]), np.float32) if result is None else result
            result[texels] = values
        return (np.zeros((face.size, 1), np.float32) if result is None else result).reshape(*gbuffer.shape, -1)

    return BakeMap(name, "any", "any", "any", "linear", "exr", 32, compute, (0.0, 0.0, 0.0))


def surface_alone(atlas: Atlas) -> Asset:
    """The atlas' own mesh as an asset without colours and textures, in the atlas' vertices."""
    surface = Surface(atlas.positions, atlas.faces)
    return Asset(
        atlas.positions, atlas.faces, np.arange(len(atlas.positions)), surface, normals=atlas.normals.astype(np.float64)
    )
