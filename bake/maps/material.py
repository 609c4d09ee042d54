"""The source's material on the new uv: each texture resampled through the old uv, factors folded in, per material.

h w texels, row 0 = top · t texels · f faces · n vertices.  Words and meaning of the textures are those of glTF 2.0.
What a file holds as factors alone becomes a constant; faces take the textures of their own material.
"""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.material import Material, used_materials
from ...runtime.process.cores import core_count
from .resample import FootprintSampler, SourceTexture, linear_colors, texel_axes
from .tangents import mikk_tangents

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.material import Slot
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.pagesize import PageSize
    from ..bakemap import Compute
    from ..raster.gbuffer import GBuffer
    from .resample import Decoding

DECODING: dict[Slot, Decoding] = {
    "base-color": "color",
    "emissive": "color",
    "normal": "signed",
    "metallic-roughness": "data",
    "occlusion": "data",
}
CHANNELS: dict[Slot, tuple[int, ...]] = {
    "base-color": (0, 1, 2, 3),
    "emissive": (0, 1, 2),
    "normal": (0, 1, 2),
    "metallic-roughness": (1, 2),
    "occlusion": (0,),
}
BARE = Material(alpha_mode="BLEND")
"""Of a surface without materials: the alpha of its vertex colours counts."""

Shade = Callable[[Material, "NDArray[np.float32] | None", "NDArray[np.int64]"], "NDArray[np.float32]"]


class SourceSlot:
    """One slot of all materials of an asset, made ready once: decoded textures, old uv and footprints per face."""

    def __init__(self, atlas: Atlas, asset: Asset, slot: Slot, page: PageSize) -> None:
        """Prepare.  page: size of the image that is baked."""
        self.materials = asset.materials or (BARE,)
        none = np.zeros(len(atlas.faces), np.int64)
        self.face_material = asset.face_material if asset.face_material is not None else none
        pictures = [None if asset.uv is None else entry.pictures.get(slot) for entry in self.materials]
        old = np.zeros((len(atlas.faces), 3, 2)) if asset.uv is None else asset.uv[atlas.source_vertex[atlas.faces]]
        self.old_uv = old
        axes = texel_axes(atlas.corner_uv, old, page)
        self.samplers = [
            None if picture is None else FootprintSampler(SourceTexture(picture, DECODING[slot], CHANNELS[slot]), axes)
            for picture in pictures
        ]
        for index, sampler in enumerate(self.samplers):
            if sampler is not None:
                sampler.make_levels(np.flatnonzero(self.face_material == index))

    def shaded(self, gbuffer: GBuffer, channels: int, shade: Shade) -> NDArray[np.float32]:
        """(h, w, channels) float32: shade(material, texture values or None, texels) of every covered texel."""
        height, width = gbuffer.shape
        result = np.zeros((height * width, channels), np.float32)

        def fill(texels: NDArray[np.int64]) -> None:
            face = gbuffer.face.reshape(-1)[texels].astype(np.int64)
            material_of = self.face_material[face]
            for index in np.unique(material_of):
                chosen = material_of == index
                values = self.values(gbuffer, texels[chosen], int(index))
                result[texels[chosen]] = shade(self.materials[int(index)], values, texels[chosen])

        with ThreadPoolExecutor(core_count()) as pool:
            list(pool.map(fill, gbuffer.chunks()))  # list: waits, and raises what was raised
        return result.reshape(height, width, channels)

    def values(self, gbuffer: GBuffer, texels: NDArray[np.int64], index: int) -> NDArray[np.float32] | None:
        """(t, 4) float32 of a material's texture at texels whose faces have it; None where it has no texture."""
        sampler = self.samplers[index]
        if sampler is None:
            return None
        face = gbuffer.face.reshape(-1)[texels].astype(np.int64)
        weight, corner = gbuffer.weights(texels).astype(np.float64), self.old_uv[face]
        across, along = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
        return sampler.sample(corner[:, 0] + weight[:, 1:2] * across + weight[:, 2:] * along, face)


def prepared() -> Callable[[Atlas, Asset, Slot, PageSize], SourceSlot]:
    """SourceSlot, remembered for the last one asked for: an image baked in windows prepares its textures once."""
    return lru_cache(maxsize=1)(SourceSlot)


def base_color_map() -> Compute:
    """Base colour: factor × texture, × vertex colour as glTF asks; vertex colour alone where there is no texture.

    No space, linear RGBA in [0, 1], straight alpha; srgb, PNG 8 bits by default.  Alpha is 1 where the material is
    opaque; with a cut-off it is scaled so that the cut lies at ½.
    """
    ready = prepared()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        colors = None if asset.colors is None else linear_colors(asset.colors)
        corners = atlas.source_vertex[atlas.faces]
        blended = any(entry.alpha_mode == "BLEND" for entry in used_materials(asset))

        def shade(
            material: Material, values: NDArray[np.float32] | None, texels: NDArray[np.int64]
        ) -> NDArray[np.float32]:
            result = np.ones((len(texels), 4), np.float32) if values is None else values
            if colors is not None and (values is None or material.tinted):
                result = result * gbuffer.interpolate(colors, corners, texels)
            result = result * np.asarray(material.base_color_factor, np.float32)
            return with_alpha_mode(result, material, hard=blended)

        return ready(atlas, asset, "base-color", gbuffer.page).shaded(gbuffer, 4, shade)

    return compute


def with_alpha_mode(color: NDArray[np.float32], material: Material, *, hard: bool) -> NDArray[np.float32]:
    """(t, 4) RGBA as its material reads it: alpha 1 if opaque, its cut at ½ if masked (hard: cut), else as it is."""
    if material.alpha_mode == "BLEND":
        return color
    if material.alpha_mode == "OPAQUE":
        color[:, 3] = 1.0
    elif hard:
        color[:, 3] = color[:, 3] >= material.alpha_cutoff
    elif material.alpha_cutoff > 0.0:
        color[:, 3] = np.clip(color[:, 3] * (0.5 / material.alpha_cutoff), 0.0, 1.0)
    return color


def metallic_roughness_map() -> Compute:
    """Red 1, green roughness, blue metalness: factor × texture of each material.

    No space, [0, 1]; unit, PNG 8 bits by default (3 channels).  Red is what an ORM reader takes for open sky.
    """
    ready = prepared()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        def shade(
            material: Material, values: NDArray[np.float32] | None, texels: NDArray[np.int64]
        ) -> NDArray[np.float32]:
            metallic, roughness = material.finish
            result = np.ones((len(texels), 3), np.float32)
            result[:, 1] = roughness * (1.0 if values is None else values[:, 1])
            result[:, 2] = metallic * (1.0 if values is None else values[:, 2])
            return result

        return ready(atlas, asset, "metallic-roughness", gbuffer.page).shaded(gbuffer, 3, shade)

    return compute


def occlusion_map() -> Compute:
    """The source's own occlusion texture, its strength folded in; 1 where a material has none.

    No space, [0, 1], 1 = open; unit, PNG 8 bits by default (1 channel).
    """
    ready = prepared()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        def shade(
            material: Material, values: NDArray[np.float32] | None, texels: NDArray[np.int64]
        ) -> NDArray[np.float32]:
            if values is None:
                return np.ones((len(texels), 1), np.float32)
            return 1.0 + np.float32(material.occlusion_strength) * (values[:, :1] - 1.0)

        return ready(atlas, asset, "occlusion", gbuffer.page).shaded(gbuffer, 1, shade)

    return compute


def orm_map() -> Compute:
    """Red the source's occlusion, green roughness, blue metalness, as glTF, Unreal and Godot pack them.

    No space, [0, 1]; unit, PNG 8 bits by default (3 channels).
    """
    finish, occlusion = metallic_roughness_map(), occlusion_map()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        packed = finish(gbuffer, atlas, asset)
        packed[..., 0] = occlusion(gbuffer, atlas, asset)[..., 0]
        return packed

    return compute


def emissive_map() -> Compute:
    """Emitted light: factor × texture, over the strongest factor of all materials (`emissive_strength`).

    No space, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels).
    """
    ready = prepared()

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
        scale = 1.0 / emissive_strength(asset)

        def shade(
            material: Material, values: NDArray[np.float32] | None, texels: NDArray[np.int64]
        ) -> NDArray[np.float32]:
            factor = np.asarray(material.emissive, np.float32)
            texture = np.ones((len(texels), 3), np.float32) if values is None else values[:, :3]
            return texture * factor * np.float32(scale)

        return ready(atlas, asset, "emissive", gbuffer.page).shaded(gbuffer, 3, shade)

    return compute


def emissive_strength(asset: Asset) -> float:
    """By what the emissive map must be multiplied: the largest emissive factor, at least 1."""
    return max([1.0, *(max(entry.emissive) for entry in asset.materials)])


def has_normal_texture(asset: Asset) -> bool:
    """Whether some material has a normal texture and the mesh the uv for it."""
    return asset.uv is not None and any("normal" in entry.pictures for entry in asset.materials)


def textured_normals() -> Callable[[GBuffer, Atlas, Asset, NDArray[np.int64]], NDArray[np.float32]]:
    """Function of (gbuffer, atlas, asset, texels) → (t, 3) float32 unit object-space normals of the normal textures.

    Decoded in the MikkTSpace frames of the old uv: N = x T + y w (N × T) + z N of interpolated, not normalised frames.
    Faces whose material has no normal texture keep the interpolated normal.
    """
    ready = prepared()
    frames = lru_cache(maxsize=1)(old_frames)

    def compute(gbuffer: GBuffer, atlas: Atlas, asset: Asset, texels: NDArray[np.int64]) -> NDArray[np.float32]:
        slot = ready(atlas, asset, "normal", gbuffer.page)
        frame = gbuffer.interpolate(frames(atlas, asset), np.arange(3 * len(atlas.faces)).reshape(-1, 3), texels)
        material_of = slot.face_material[gbuffer.face.reshape(-1)[texels]]
        local = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (len(texels), 1))
        for index in np.unique(material_of):
            chosen = material_of == index
            values = slot.values(gbuffer, texels[chosen], int(index))
            if values is not None:
                local[chosen] = values[:, :3]
                local[chosen, :2] *= np.float32(slot.materials[int(index)].normal_scale)
        return from_tangent_space(local, frame)

    return compute


def old_frames(atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """(3 f, 7) float32: normal, tangent and w at each corner of each face, in the old uv."""
    uv = np.zeros((len(asset.positions), 2)) if asset.uv is None else asset.uv
    vertex = atlas.source_vertex
    normals = atlas.normals if asset.normals is None else asset.normals[vertex]
    frame = mikk_tangents(atlas.positions, normals, uv[vertex], atlas.faces)
    corner_normals = np.asarray(normals, np.float32)[atlas.faces].reshape(-1, 3)
    return np.column_stack([corner_normals, frame.reshape(-1, 4)]).astype(np.float32)


def from_tangent_space(local: NDArray[np.float32], frame: NDArray[np.float32]) -> NDArray[np.float32]:
    """(t, 3) float32 unit: tangent-space normals in frames (t, 7) of normal N, tangent T and w; N where they cancel."""
    axis, tangent = frame[:, :3], frame[:, 3:6]
    bitangent = np.cross(axis, tangent) * np.where(frame[:, 6:] < 0.0, -1.0, 1.0).astype(np.float32)
    normal = local[:, :1] * tangent + local[:, 1:2] * bitangent + local[:, 2:] * axis
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    fallback = axis / np.maximum(np.linalg.norm(axis, axis=1, keepdims=True), 1e-12)
    return np.where(length > 1e-12, normal / np.maximum(length, 1e-12), fallback).astype(np.float32)
