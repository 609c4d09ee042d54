"""Materials of a glTF 2.0 file → Material: all five textures with their samplers, placements and factors.

Words of the specification (Khronos, glTF 2.0.1): texture, sampler, textureInfo.  What can't be kept is counted.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from ...errors import MeshError, MissingDependencyError
from ...material import SLOTS, UNTURNED, Material, Picture
from ..pictures.ktx2 import decode_ktx2
from ..pictures.pictures import decode_image, is_deep
from ..text import finite
from .buffers import GltfFile, buffer_view, read_resource

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...material import AlphaMode, Placement, Slot, Wrap

TRANSFORM = "KHR_texture_transform"
WEBP = "EXT_texture_webp"
BASIS = "KHR_texture_basisu"
KTX2 = b"\xabKTX 20\xbb\r\n\x1a\n"
"""First bytes of such a file."""
STRENGTH = "KHR_materials_emissive_strength"
WRAPS: dict[int, Wrap] = {10497: "repeat", 33648: "mirror", 33071: "clamp"}
NEAREST = 9728
ALPHA_MODES: tuple[AlphaMode, ...] = ("OPAQUE", "MASK", "BLEND")
COUNTS = ("textures_not_decoded", "textures_of_other_uv", "textures_to_8_bits")


def read_materials(file: GltfFile) -> tuple[list[Material], dict[str, int]]:
    """All materials of the file, and what could not be kept.

    Counted are textures whose picture can't be had, textures on another uv set than the material's first one, and
    pictures of 16 bits a channel.
    Raises: MeshError for a picture that is none; lookup and value errors where the tree is damaged.
    """
    changes: dict[str, int] = dict.fromkeys(COUNTS, 0)
    pictures: dict[int, NDArray[np.uint8]] = {}
    entries = enumerate(file.tree.get("materials", []))
    return [_material(file, entry, index, pictures, changes) for index, entry in entries], changes


def uv_set(material: dict[str, Any]) -> int:
    """Number of the TEXCOORD that the material's textures are read with: that of its first one in slot order."""
    infos = _texture_infos(material)
    return next((_coordinates(infos[slot]) for slot in SLOTS if slot in infos), 0)


def _texture_infos(material: dict[str, Any]) -> dict[Slot, dict[str, Any]]:
    """The textureInfo of each slot that has one."""
    surface = material.get("pbrMetallicRoughness", {})
    infos: dict[Slot, dict[str, Any] | None] = {
        "base-color": surface.get("baseColorTexture"),
        "metallic-roughness": surface.get("metallicRoughnessTexture"),
        "normal": material.get("normalTexture"),
        "emissive": material.get("emissiveTexture"),
        "occlusion": material.get("occlusionTexture"),
    }
    return {slot: info for slot, info in infos.items() if info is not None}


def _coordinates(info: dict[str, Any]) -> int:
    """The uv set of a textureInfo, which its transform may overrule."""
    return int(info.get("extensions", {}).get(TRANSFORM, {}).get("texCoord", info.get("texCoord", 0)))


def _material(
    file: GltfFile,
    entry: dict[str, Any],
    index: int,
    known: dict[int, NDArray[np.uint8]],
    changes: dict[str, int],
) -> Material:
    """One material; known and changes grow."""
    infos = _texture_infos(entry)
    pictures, unread = _pictures(file, infos, uv_set(entry), known, changes)
    for reason in unread.values():
        changes["textures_not_decoded" if reason else "textures_of_other_uv"] += 1
    surface = entry.get("pbrMetallicRoughness", {})
    red, green, blue, alpha = (_unit(value) for value in surface.get("baseColorFactor", (1.0, 1.0, 1.0, 1.0)))
    strength = max(finite(entry.get("extensions", {}).get(STRENGTH, {}).get("emissiveStrength", 1.0)), 0.0)
    glow = tuple(_unit(value) * strength for value in entry.get("emissiveFactor", (0.0, 0.0, 0.0)))
    mode = entry.get("alphaMode", "OPAQUE")
    return Material(
        name=str(entry.get("name", f"material_{index}")),
        base_color_factor=(red, green, blue, alpha),
        pictures=pictures,
        metallic=_unit(surface.get("metallicFactor", 1.0)),
        roughness=_unit(surface.get("roughnessFactor", 1.0)),
        normal_scale=finite(infos.get("normal", {}).get("scale", 1.0)),
        occlusion_strength=_unit(infos.get("occlusion", {}).get("strength", 1.0)),
        emissive=(glow[0], glow[1], glow[2]),
        alpha_mode=ALPHA_MODES[ALPHA_MODES.index(mode)],
        alpha_cutoff=max(finite(entry.get("alphaCutoff", 0.5)), 0.0),
        double_sided=bool(entry.get("doubleSided", False)),
        unread=unread,
    )


def _pictures(
    file: GltfFile,
    infos: dict[Slot, dict[str, Any]],
    uv: int,
    known: dict[int, NDArray[np.uint8]],
    changes: dict[str, int],
) -> tuple[dict[Slot, Picture], dict[Slot, str]]:
    """The textures that can be read over a set of uv, and why others can't: "" where they lie on other uv."""
    pictures: dict[Slot, Picture] = {}
    unread: dict[Slot, str] = {}
    for slot, info in infos.items():
        pixels = _pixels(file, info, known, changes)
        if isinstance(pixels, str):
            unread[slot] = pixels
        elif _coordinates(info) != uv:
            unread[slot] = ""
        else:
            pictures[slot] = _picture(file, info, pixels)
    return pictures, unread


def _unit(value: Any) -> float:
    """A number of the file, limited to [0, 1]."""
    return min(max(finite(value), 0.0), 1.0)


def _pixels(
    file: GltfFile, info: dict[str, Any], known: dict[int, NDArray[np.uint8]], changes: dict[str, int]
) -> NDArray[np.uint8] | str:
    """The picture of a textureInfo, decoded once, or why none can be had.  known and changes grow."""
    texture = file.tree["textures"][info["index"]]
    extensions = texture.get("extensions", {})
    holders = (texture, *(extensions[name] for name in (WEBP, BASIS) if name in extensions))
    source = next((holder["source"] for holder in holders if "source" in holder), None)
    if source is None:
        return f"has its picture in {', '.join(extensions) or 'no extension'}, which is not read"
    if source not in known:
        data = image_bytes(file, source)
        if not data.startswith(KTX2) and source != extensions.get(BASIS, {}).get("source"):
            known[source] = decode_image(data, known.values())
            changes["textures_to_8_bits"] += is_deep(data)
        else:
            try:
                known[source] = decode_ktx2(data, known.values())
            except (MissingDependencyError, MeshError) as error:
                return f"is a KTX 2 picture that can't be decoded ({error})"
    return known[source]


def image_bytes(file: GltfFile, index: int) -> bytes:
    """The picture file of an image, embedded or beside the document."""
    image = file.tree["images"][index]
    embedded = "bufferView" in image
    return bytes(buffer_view(file, image["bufferView"])[0]) if embedded else read_resource(image["uri"], file.folder)


def _picture(file: GltfFile, info: dict[str, Any], pixels: NDArray[np.uint8]) -> Picture:
    """The pixels with the sampler and the placement of the textureInfo."""
    texture = file.tree["textures"][info["index"]]
    sampler = file.tree["samplers"][texture["sampler"]] if "sampler" in texture else {}
    wrap = WRAPS[sampler.get("wrapS", 10497)], WRAPS[sampler.get("wrapT", 10497)]
    placement = _placement(info.get("extensions", {}).get(TRANSFORM, {}))
    return Picture(pixels, wrap, placement, smooth=sampler.get("magFilter") != NEAREST)


def _placement(transform: dict[str, Any]) -> Placement:
    """KHR_texture_transform (v down: translate · rotate · scale) as rows for uv that are v up.

    With v' = 1 − v the matrix keeps its form: both off-diagonal terms change sign, and the offset along v takes what
    turning about the other corner moves.
    """
    if not transform:
        return UNTURNED
    shift_u, shift_v = (finite(value) for value in transform.get("offset", (0.0, 0.0)))
    scale_u, scale_v = (finite(value) for value in transform.get("scale", (1.0, 1.0)))
    angle = finite(transform.get("rotation", 0.0))
    cos, sin = math.cos(angle), math.sin(angle)
    across = (cos * scale_u, sin * scale_v)
    down = (-sin * scale_u, cos * scale_v)
    return (
        (across[0], -across[1], shift_u + across[1]),
        (-down[0], down[1], 1.0 - shift_v - down[1]),
    )
