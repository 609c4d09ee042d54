"""The maps that need rays, as functions of the G-buffer: ambient occlusion, bent normals, thickness; and height.

h w texels, row 0 = top.  A scene of rays is built once per mesh and kept for the windows of an image.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from .normals import to_tangent_space
from .occlusion import ambient_occlusion, bent_normals, thickness
from .rays import RayScene, RaySettings
from .tangents import vertex_tangents

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..raster.gbuffer import GBuffer
    from .normals import NormalFormat

    Compute = Callable[[GBuffer, Atlas, Asset], NDArray[np.float32]]


def ao_map(settings: RaySettings) -> Compute:
    """Ambient occlusion: the cosine-weighted part of the hemisphere that is open, see `ambient_occlusion`.

    No space, [0, 1], 1 = open; unit, PNG 8 bits dithered by default (1 channel).
    """
    return _with_scene(ambient_occlusion, settings)


def bent_normal_object_map(settings: RaySettings) -> Compute:
    """Mean open direction, see `bent_normals`.  Object space, unit vectors, [−1, 1]; signed, EXR half (3 channels)."""
    return _with_scene(bent_normals, settings)


def bent_normal_map(settings: RaySettings, normal_format: NormalFormat) -> Compute:
    """Mean open direction in the frame of the tangents that are written, as the normal map's.

    Tangent space, unit vectors, [−1, 1]; signed, PNG 8 bits dithered by default (3 channels).
    """
    return in_tangent_space(bent_normal_object_map(settings), normal_format)


def thickness_map(settings: RaySettings) -> Compute:
    """Depth of the body beneath the surface in radii of the mesh's bounding ball, see `thickness`.

    No space, [0, 1]; unit, PNG 8 bits dithered by default (1 channel).
    """
    return _with_scene(thickness, settings)


def height_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Height of the high-poly surface above the low-poly's.  Linear, source units, EXR float by default (1 channel).

    Baked from high-poly meshes only (see highmaps.py).  Raises: InputError here.
    """
    del gbuffer, atlas
    raise InputError(f"{asset.stem}: the height map is baked from a high-poly mesh; pass --high, or leave it out")


def in_tangent_space(vectors: Compute, normal_format: NormalFormat) -> Compute:
    """A map of object-space vectors (h, w, 3) as one in the frame of the tangents that are written; green by format."""
    frames = lru_cache(maxsize=1)(_frames)

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        flat = vectors(gbuffer, atlas, asset).reshape(-1, 3)
        result = np.zeros_like(flat)
        for texels in gbuffer.chunks():
            frame = gbuffer.interpolate(frames(atlas), atlas.faces, texels)
            result[texels] = to_tangent_space(flat[texels], frame)
        if normal_format == "directx":
            result[:, 1] *= -1.0
        return result.reshape(*gbuffer.shape, 3)

    return compute


def _frames(atlas: Atlas) -> NDArray[np.float32]:
    """(n, 7) float32: normal, tangent and w of each atlas vertex."""
    return np.column_stack([atlas.normals, vertex_tangents(atlas)])


def _with_scene(function: Callable[..., NDArray[np.float32]], settings: RaySettings) -> Compute:
    """The function with its settings, and a scene that is kept while the surface stays the same."""
    scene_of = lru_cache(maxsize=1)(RayScene.of)

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        return function(gbuffer, atlas, asset, settings, scene=scene_of(asset.surface))

    return compute
