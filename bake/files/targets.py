"""Engine presets: green channel, packing, bit depth, file names and padding, as each engine's importer expects them.

| target | green | finish | files |
|---|---|---|---|
| gltf | +Y | red occlusion, green roughness, blue metalness | STEM_baseColor.png … |
| unreal | −Y | the same, "ORM" | T_STEM_BC.png, T_STEM_N.png, T_STEM_ORM.png … |
| unity | +Y | mask map: red metalness, green occlusion, blue 0, alpha smoothness | STEM_BaseMap.png … |
| godot | +Y | ORM | STEM_albedo.png … |
| blender | +Y | one file each | STEM_base_color.png …, normals in 16 bits |
| usd | +Y | as gltf | STEM_diffuseColor.png … |

Sources: glTF 2.0 section 3.9 · Unreal's texture naming (T_ prefix, _BC _N _ORM _E) and DirectX normals · Unity HDRP
mask map (URP reads its red and alpha) · Godot's ORMMaterial3D · UsdPreviewSurface.  Maps that an engine has no slot for
keep their names.  Values are in memory as everywhere: linear light, [0, 1], or [−1, 1].
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Literal

import numpy as np

from ...runtime.errors import InputError
from ..texture import Texture
from .images import write_texture

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from ..bakemap import NormalFormat
    from ..texture import Bits

Part = Literal["occlusion", "roughness", "metallic", "smoothness", "zero"]
FINISH_MAPS = ("orm", "metallic-roughness", "occlusion", "ao")
"""Maps that are packed by part; of those that hold the same part the last one here is taken."""
PARTS: dict[str, tuple[Part | None, ...]] = {
    "orm": ("occlusion", "roughness", "metallic"),
    "metallic-roughness": (None, "roughness", "metallic"),
    "occlusion": ("occlusion",),
    "ao": ("occlusion",),
}
MISSING: dict[Part, float] = {"occlusion": 1.0, "roughness": 0.8, "metallic": 0.0, "zero": 0.0}
ORM: tuple[Part, ...] = ("occlusion", "roughness", "metallic")


@dataclass(frozen=True)
class Target:
    """What an engine expects.

    name: as on the command line.  green: of tangent-space normal maps.  pattern: file name without ending, of {stem}
    and {map}.  names: map → word in the file name; others keep theirs.  packed: word in the file name → the part in
    each channel.  bits: map → bits per channel where not the map's own.  texels_per_padding: padding = size / this, at
    least 2: block-compressed textures need twice the usual.  light_padding: of light maps, whatever their size; two
    charts are twice that apart: 4 texels are Unity's pack margin and a block of Unreal's compressed light maps.
    """

    name: str
    green: NormalFormat
    pattern: str
    names: Mapping[str, str]
    packed: Mapping[str, tuple[Part, ...]]
    bits: Mapping[str, Bits] = field(default_factory=dict)
    texels_per_padding: int = 256
    light_padding: int = 2

    def padding(self, size: int, *, light: bool = False) -> int:
        """Texels kept free around charts in an atlas of that size.  light: for a light map."""
        return self.light_padding if light else max(2, size // self.texels_per_padding)

    def file_names(self, maps: Sequence[str], stem: str) -> dict[str, str]:
        """Product → file name without ending, in the order of the maps, packed ones last; known before baking."""
        direct = {name: self.names.get(name, name) for name in maps if name not in FINISH_MAPS}
        products = {**direct, **{word: word for word in self.packed_of(maps)}}
        return {key: self.pattern.format(stem=stem, map=word) for key, word in products.items()}

    def packed_of(self, maps: Sequence[str]) -> list[str]:
        """Words of the packed files that some map has a part of."""
        there = {part for name in maps if name in PARTS for part in PARTS[name] if part is not None}
        wanted = there | ({"smoothness"} if "roughness" in there else set())
        return [word for word, parts in self.packed.items() if wanted & set(parts)]


GLTF = Target(
    "gltf",
    "opengl",
    "{stem}_{map}",
    {"base-color": "baseColor", "normal": "normal", "emissive": "emissive"},
    {"occlusionRoughnessMetallic": ORM},
)
UNREAL = Target(
    "unreal",
    "directx",
    "T_{stem}_{map}",
    {"base-color": "BC", "normal": "N", "emissive": "E", "height": "H", "bent-normal": "BN", "vertex-color": "VC"},
    {"ORM": ORM},
    texels_per_padding=128,
)
UNITY = Target(
    "unity",
    "opengl",
    "{stem}_{map}",
    {"base-color": "BaseMap", "normal": "Normal", "emissive": "Emission", "height": "Height"},
    {"MaskMap": ("metallic", "occlusion", "zero", "smoothness")},
    texels_per_padding=128,
)
GODOT = Target(
    "godot",
    "opengl",
    "{stem}_{map}",
    {"base-color": "albedo", "normal": "normal", "emissive": "emission", "height": "height"},
    {"orm": ORM},
    texels_per_padding=128,
)
BLENDER = Target(
    "blender",
    "opengl",
    "{stem}_{map}",
    {"base-color": "base_color", "emissive": "emission"},
    {"ao": ("occlusion",), "roughness": ("roughness",), "metallic": ("metallic",)},
    {"normal": 16},
)
USD = Target(
    "usd",
    "opengl",
    "{stem}_{map}",
    {"base-color": "diffuseColor", "normal": "normal", "emissive": "emissiveColor"},
    {"occlusionRoughnessMetallic": ORM},
)
TARGETS: dict[str, Target] = {entry.name: entry for entry in (GLTF, UNREAL, UNITY, GODOT, BLENDER, USD)}


def find_target(name: str) -> Target:
    """The preset of that name.  Raises: InputError that lists the names there are."""
    if name not in TARGETS:
        raise InputError(f"unknown target {name!r}: expected one of {', '.join(TARGETS)}")
    return TARGETS[name]


def prepare(textures: Mapping[str, Texture], target: Target) -> dict[str, Texture]:
    """Product → Texture as the target wants it; keys as `Target.file_names` of the same maps.

    Normal maps are turned to the target's green, finish maps packed, bit depths set; nothing else changes.

    Raises: InputError when maps to be packed differ in size.
    """
    result = {name: _direct(name, entry, target) for name, entry in textures.items() if name not in FINISH_MAPS}
    return result | packed_textures(textures, target)


def write_target(textures: Mapping[str, Texture], folder: Path, stem: str, target: Target) -> dict[str, Path]:
    """Write all products of baked maps into an existing folder; product → path.

    Raises: InputError as `prepare`, EncodingError as `images.write_texture`.
    """
    names = target.file_names(list(textures), stem)
    products = prepare(textures, target)
    paths = {key: folder / f"{names[key]}.{file_ending(product)}" for key, product in products.items()}
    for key, product in products.items():
        write_texture(product, paths[key])
    return paths


def file_ending(texture: Texture) -> str:
    """EXR for what a PNG cannot hold, else the texture's own."""
    return "exr" if texture.encoding == "linear" else texture.file_type


def with_green(texture: Texture, green: NormalFormat) -> Texture:
    """A tangent-space normal map with green along +v (opengl) or −v (directx), whatever it was baked for."""
    down = texture.metadata.get("space", "").endswith("Y down")
    if down == (green == "directx"):
        return texture
    wanted = "tangent, Y up" if green == "opengl" else "tangent, Y down"
    pixels = texture.pixels * np.array([1.0, -1.0, 1.0], np.float32)
    return replace(texture, pixels=pixels, metadata={**texture.metadata, "space": wanted})


def packed_textures(textures: Mapping[str, Texture], target: Target) -> dict[str, Texture]:
    """The target's packed files, of the finish maps among the textures."""
    parts: dict[Part, np.ndarray] = {}
    for name in (name for name in FINISH_MAPS if name in textures):
        for part, channel in zip(PARTS[name], np.moveaxis(textures[name].pixels, 2, 0), strict=False):
            if part is not None:
                parts[part] = channel
    if len({channel.shape for channel in parts.values()}) > 1:
        found = sorted({channel.shape for channel in parts.values()})
        raise InputError(f"maps of sizes {found} can't be packed into one file; bake them at one size")
    if "roughness" in parts:
        parts["smoothness"] = 1.0 - parts["roughness"]
    return {word: _packed(target.packed[word], parts) for word in target.packed_of(list(textures))}


def _packed(layout: tuple[Part, ...], parts: Mapping[Part, np.ndarray]) -> Texture:
    """One packed file; a part that nothing holds takes its constant."""
    shape = next(iter(parts.values())).shape
    constants = {**MISSING, "smoothness": 1.0 - MISSING["roughness"]}
    channels = [parts[part] if part in parts else np.full(shape, constants[part], np.float32) for part in layout]
    metadata = {"map": "packed", "space": "none", "units": "share", "range": "[0, 1]", "channels": " ".join(layout)}
    return Texture(np.stack(channels, axis=2).astype(np.float32), "unit", 8, "png", metadata=metadata)


def _direct(name: str, texture: Texture, target: Target) -> Texture:
    """A map that has a file of its own."""
    turned = with_green(texture, target.green) if texture.metadata.get("space", "").startswith("tangent") else texture
    return replace(turned, bits=target.bits[name]) if name in target.bits else turned
