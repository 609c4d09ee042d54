"""The material of a GLB file: baked maps become its textures, what is the same all over stays a factor.

| maps | glTF |
|---|---|
| the first of `BASE_COLOR_MAPS` | base colour |
| normal | normal texture, green up whatever it was baked for |
| orm, else metallic-roughness | metallic-roughness |
| ao, else occlusion, else orm | occlusion |
| emissive | emissive, with KHR_materials_emissive_strength above 1 |
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.geometry.topology import edge_table
from ...runtime.material import Material, used_materials
from ..maps.material import emissive_strength
from .glbbuffer import Buffer, gl
from .images import encode_png
from .targets import with_green

if TYPE_CHECKING:
    from collections.abc import Mapping

    from ...runtime.material import AlphaMode
    from ...runtime.mesh import Asset
    from ..texture import Texture

BASE_COLOR_MAPS = ("base-color", "vertex-color", "uv-checker", "chart")
"""The first of these that was baked becomes the base colour."""
STRENGTH = "KHR_materials_emissive_strength"


class Images:
    """Maps embedded as 8-bit PNG, each once, with one sampler for all: trilinear, clamped to the edge."""

    def __init__(self, document: gl.GLTF2, buffer: Buffer, textures: Mapping[str, Texture]) -> None:
        self.document, self.buffer, self.textures = document, buffer, textures
        self.known: dict[str, int] = {}

    def first(self, *names: str) -> str | None:
        """The first of the maps that was baked."""
        return next((name for name in names if name in self.textures), None)

    def embed(self, name: str) -> int:
        """The number of the map's glTF texture."""
        if name not in self.known:
            texture = with_green(self.textures[name], "opengl") if name == "normal" else self.textures[name]
            self.known[name] = self._add(name, encode_png(texture, bits=8))
        return self.known[name]

    def _add(self, name: str, png: bytes) -> int:
        document = self.document
        if not document.samplers:
            sampler = gl.Sampler(magFilter=gl.LINEAR, minFilter=gl.LINEAR_MIPMAP_LINEAR)
            sampler.wrapS = sampler.wrapT = gl.CLAMP_TO_EDGE
            document.samplers = [sampler]
        document.images.append(gl.Image(name=name, mimeType="image/png", bufferView=self.buffer.view(png)))
        document.textures.append(gl.Texture(name=name, sampler=0, source=len(document.images) - 1))
        return len(document.textures) - 1


def add_material(document: gl.GLTF2, buffer: Buffer, asset: Asset, textures: Mapping[str, Texture]) -> gl.Material:
    """Material 0 with its images, textures and sampler; document and buffer grow.

    Raises: EncodingError for textures PNG cannot hold.
    """
    images, used = Images(document, buffer, textures), used_materials(asset)
    single = used[0] if len(used) == 1 else None
    opened = bool((edge_table(asset.surface.faces).edge_count == 1).any())
    seen_behind = any(entry.double_sided for entry in used)
    material = gl.Material(
        name=single.name if single is not None else asset.stem,
        pbrMetallicRoughness=_surface(images, used, single),
        doubleSided=opened or seen_behind,
        alphaCutoff=None,
    )
    _add_alpha(material, images, used)
    if "normal" in textures:
        material.normalTexture = gl.NormalMaterialTexture(index=images.embed("normal"))
    shadow = images.first("ao", "occlusion", "orm")
    if shadow is not None:
        material.occlusionTexture = gl.OcclusionTextureInfo(index=images.embed(shadow))
    _add_emission(document, material, images, asset, used)
    document.materials = [material]
    return material


def _surface(images: Images, used: list[Material], single: Material | None) -> gl.PbrMetallicRoughness:
    """Base colour and finish."""
    color, finish = images.first(*BASE_COLOR_MAPS), images.first("orm", "metallic-roughness")
    kept = {entry.finish for entry in used}
    metallic, roughness = kept.pop() if len(kept) == 1 else Material().finish
    surface = gl.PbrMetallicRoughness(
        baseColorFactor=list(single.base_color_factor) if single is not None and color is None else [1.0] * 4,
        metallicFactor=metallic if finish is None else 1.0,
        roughnessFactor=roughness if finish is None else 1.0,
    )
    if color is not None:
        surface.baseColorTexture = gl.TextureInfo(index=images.embed(color))
    if finish is not None:
        surface.metallicRoughnessTexture = gl.TextureInfo(index=images.embed(finish))
    return surface


def _add_alpha(material: gl.Material, images: Images, used: list[Material]) -> None:
    """BLEND or MASK where some material of the source is so and there is alpha to read, else opaque."""
    name = images.first(*BASE_COLOR_MAPS)
    if name is not None and images.textures[name].pixels.shape[2] != 4:
        return
    modes: set[AlphaMode] = {entry.alpha_mode for entry in used}
    cutoffs = [entry.alpha_cutoff for entry in used if entry.alpha_mode == "MASK"]
    through = name is not None or any(entry.base_color_factor[3] < 1.0 for entry in used)
    if "BLEND" in modes or (not modes and through):
        material.alphaMode = gl.BLEND
    elif "MASK" in modes:
        material.alphaMode = gl.MASK
        material.alphaCutoff = 0.5 if name is not None else cutoffs[0]  # the map is scaled so that the cut lies at ½


def _add_emission(
    document: gl.GLTF2, material: gl.Material, images: Images, asset: Asset, used: list[Material]
) -> None:
    """Emissive texture or factor; what is above 1 goes into the extension."""
    glows = {entry.emissive for entry in used}
    strength, factor = emissive_strength(asset), np.zeros(3)
    if "emissive" in images.textures:
        material.emissiveTexture = gl.TextureInfo(index=images.embed("emissive"))
        factor = np.ones(3)
    elif len(glows) == 1 and not any("emissive" in entry.pictures for entry in used):
        factor = np.asarray(glows.pop()) / strength
    if not factor.any():
        return
    material.emissiveFactor = factor.tolist()
    if strength > 1.0:
        extensions: dict[str, Any] = {STRENGTH: {"emissiveStrength": strength}}
        material.extensions = extensions
        document.extensionsUsed = [*(document.extensionsUsed or []), STRENGTH]
