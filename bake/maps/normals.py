"""Normal maps: the source's normals in object space, and in the frame of the tangents that are written.

h w texels, row 0 = top · t texels.  Normals are unit; the source's are its vertex normals interpolated, turned by the
normal textures of its materials where it has any.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from .material import has_normal_texture, textured_normals
from .tangents import vertex_frames

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ..bakemap import Compute, NormalFormat
    from ..raster.gbuffer import GBuffer

    NormalSource = Callable[[GBuffer, Atlas, Asset, NDArray[np.int64]], NDArray[np.float32]]

FLAT = (0.0, 0.0, 1.0)


def object_normal_map() -> Compute:
    """Source normal.  Object space, unit vectors, [−1, 1]; signed, EXR half by default (3 channels)."""
    normals = detail_normals()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        height, width = gbuffer.shape
        result = np.zeros((height * width, 3), np.float32)
        for texels in gbuffer.chunks():
            result[texels] = normals(gbuffer, atlas, asset, texels)
        return result.reshape(height, width, 3)

    return compute


def tangent_normal_map(normal_format: NormalFormat) -> Compute:
    """Source normal in the frame of the tangents that are written to the file.

    Tangent space, unit vectors, [−1, 1] with z > 0 facing out, (0, 0, 1) = flat; green up (+Y, opengl: glTF, Unity,
    Godot, Blender) or down (−Y, directx: Unreal); signed, PNG 8 bits dithered by default (3 channels).
    The frame is interpolated, not normalised, and inverted exactly, as MikkTSpace asks.  So where the atlas' normals
    are the source's own and no material has a normal texture, the map is flat, and nothing is computed.
    """
    normals = detail_normals()
    frames = lru_cache(maxsize=1)(vertex_frames)

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        height, width = gbuffer.shape
        if has_source_normals(atlas, asset):
            return np.broadcast_to(np.array(FLAT, np.float32), (height, width, 3))
        result = np.zeros((height * width, 3), np.float32)
        for texels in gbuffer.chunks():
            frame = gbuffer.interpolate(frames(atlas), atlas.faces, texels)
            result[texels] = to_tangent_space(normals(gbuffer, atlas, asset, texels), frame)
        if normal_format == "directx":
            result[:, 1] *= -1.0
        return result.reshape(height, width, 3)

    return compute


def in_tangent_space(vectors: Compute, normal_format: NormalFormat) -> Compute:
    """A map of object-space vectors (h, w, 3) as one in the frame of the tangents that are written; green by format."""
    frames = lru_cache(maxsize=1)(vertex_frames)

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


def detail_normals() -> NormalSource:
    """Function of (gbuffer, atlas, asset, texels) → (t, 3) float32 unit object-space normals, textures included."""
    textured = textured_normals()

    def normals(gbuffer: GBuffer, atlas: Atlas, asset: Asset, texels: NDArray[np.int64]) -> NDArray[np.float32]:
        chosen = textured if has_normal_texture(asset) else source_normals
        return chosen(gbuffer, atlas, asset, texels)

    return normals


def has_source_normals(atlas: Atlas, asset: Asset) -> bool:
    """Whether the atlas' vertex normals are the source's (to 1e-6), or all there is; no normal texture adds to them."""
    if has_normal_texture(asset):
        return False
    if asset.normals is None:
        return True
    return bool(np.allclose(atlas.normals, asset.normals[atlas.source_vertex], rtol=0, atol=1e-6))


def source_normals(gbuffer: GBuffer, atlas: Atlas, asset: Asset, texels: NDArray[np.int64]) -> NDArray[np.float32]:
    """(t, 3) float32 unit: the source's own vertex normals interpolated, the atlas' where the source has none."""
    if asset.normals is None:
        return gbuffer.normal.reshape(-1, 3)[texels]
    normal = gbuffer.interpolate(asset.normals, atlas.source_vertex[atlas.faces], texels)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.where(length > 1e-12, normal / np.maximum(length, 1e-12), gbuffer.normal.reshape(-1, 3)[texels])


def to_tangent_space(normal: NDArray[np.float32], frame: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t, 3) float32 unit: object-space normals in the frames (t, 7) of normal N, tangent T and w; (0, 0, 1) if N ∥ T.

    With B = w N × T the rows of the inverse of (T B N) are, up to a common positive factor,
    T (N·N) − N (N·T),  w N × T,  N (T·T) − T (N·T).
    """
    axis, tangent = frame[:, :3], frame[:, 3:6]
    along, out, mixed = _dot(normal, tangent), _dot(normal, axis), _dot(axis, tangent)
    handedness = np.where(frame[:, 6] < 0.0, -1.0, 1.0).astype(np.float32)
    local = np.zeros_like(normal)
    local[:, 0] = along * _dot(axis, axis) - out * mixed
    local[:, 1] = handedness * _triple(normal, axis, tangent)
    local[:, 2] = out * _dot(tangent, tangent) - along * mixed
    length = np.sqrt(_dot(local, local))
    local[length <= 1e-12] = FLAT
    length[length <= 1e-12] = 1.0
    local /= length[:, None]
    return local


def _dot(a: NDArray[np.float32], b: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t,) inner products of rows."""
    return np.einsum("ti,ti->t", a, b)


def _triple(a: NDArray[np.float32], b: NDArray[np.float32], c: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t,) determinants a · (b × c) of rows."""
    x, y, z = (b[:, i] * c[:, j] - b[:, j] * c[:, i] for i, j in ((1, 2), (2, 0), (0, 1)))
    return np.asarray(a[:, 0] * x + a[:, 1] * y + a[:, 2] * z, np.float32)
