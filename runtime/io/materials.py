"""Materials with all their textures, and the pictures beside a mesh file: OBJ libraries, files of one folder only.

Words are those of glTF 2.0 (metallic-roughness model): a slot is what a texture is for.  Pictures are (h, w, 4) uint8
as stored, row 0 = top: sRGB in the slots base-color and emissive, data in the others.  Factors are linear.
A mesh file may come from anyone: names in it reach no file outside its own folder, and no network.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import PureWindowsPath
from typing import TYPE_CHECKING, Literal

import numpy as np
from PIL import Image

from ..errors import MeshError
from ..mesh import Material

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

    from ..mesh import Asset

MAX_PIXELS = 16384 * 16384

Wrap = Literal["repeat", "mirror", "clamp"]
Slot = Literal["base-color", "metallic-roughness", "normal", "emissive", "occlusion"]
AlphaMode = Literal["OPAQUE", "MASK", "BLEND"]
SLOTS: tuple[Slot, ...] = ("base-color", "metallic-roughness", "normal", "emissive", "occlusion")
MTL_SLOTS: dict[str, Slot] = {"map_kd": "base-color", "map_ke": "emissive", "norm": "normal"}
UNTURNED = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0))


@dataclass(frozen=True, eq=False)
class Picture:
    """A texture as a material uses it.

    pixels: (h, w, 4) uint8 as stored, row 0 = top.  wrap: what lies outside [0, 1] along u and along v.
    placement: rows (a, b, c) of picture uv = (a u + b v + c, …), both v up: what KHR_texture_transform asks.
    smooth: whether it is filtered; False is nearest texel (pixel art).
    """

    pixels: NDArray[np.uint8]
    wrap: tuple[Wrap, Wrap] = ("repeat", "repeat")
    placement: tuple[tuple[float, float, float], tuple[float, float, float]] = UNTURNED
    smooth: bool = True


@dataclass(frozen=True, eq=False)
class PbrMaterial(Material):
    """A material with all that glTF 2.0 says about it; `base_color` is the picture of its slot once more.

    pictures: by slot.  metallic, roughness, occlusion_strength: [0, 1].  normal_scale: any number.
    emissive: linear RGB factor ≥ 0, above 1 where the file asks for more (KHR_materials_emissive_strength).
    alpha_mode: OPAQUE ignores alpha, MASK cuts at alpha_cutoff.  double_sided: seen from behind too.
    """

    pictures: Mapping[Slot, Picture] = field(default_factory=dict)
    metallic: float = 1.0
    roughness: float = 1.0
    normal_scale: float = 1.0
    occlusion_strength: float = 1.0
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha_mode: AlphaMode = "OPAQUE"
    alpha_cutoff: float = 0.5
    double_sided: bool = False


def picture_of(material: Material, slot: Slot) -> Picture | None:
    """The material's texture of that slot, or None; a plain Material has a base colour at most, repeated."""
    if isinstance(material, PbrMaterial):
        return material.pictures.get(slot)
    return Picture(material.base_color) if slot == "base-color" and material.base_color is not None else None


def source_maps(asset: Asset) -> tuple[str, ...]:
    """The maps that together make the output look like the source, beside a normal map; () for a bare surface.

    base-color where there is colour, orm where both occlusion and a metallic-roughness that varies are there, else the
    one that is, emissive where something glows.  What is the same all over needs no map: it stays a factor.
    """
    used = used_materials(asset)
    has = {slot: asset.uv is not None and any(picture_of(entry, slot) for entry in used) for slot in SLOTS}
    finishes = {(entry.metallic, entry.roughness) for entry in used if isinstance(entry, PbrMaterial)}
    finish = has["metallic-roughness"] or len(finishes) > 1
    glows = {entry.emissive for entry in used if isinstance(entry, PbrMaterial)}
    colors = {entry.base_color_factor for entry in used}
    names = ["base-color"] if has["base-color"] or asset.colors is not None or len(colors) > 1 else []
    if finish and has["occlusion"]:
        names.append("orm")
    else:
        names += [name for name, there in (("metallic-roughness", finish), ("occlusion", has["occlusion"])) if there]
    return (*names, *(["emissive"] if has["emissive"] or len(glows) > 1 else []))


def used_materials(asset: Asset) -> list[Material]:
    """The materials that some face has; the first one where faces do not say."""
    if asset.face_material is None:
        return list(asset.materials[:1])
    return [asset.materials[int(index)] for index in np.unique(asset.face_material)]


def read_in_folder(folder: Path, name: str) -> bytes | None:
    """Bytes of the file of this name inside the folder, or None where there is none.

    OBJ files often name folders of their author's machine: those are looked for beside the mesh by base name.
    """
    base = PureWindowsPath(name.strip()).name
    for candidate in (name.strip(), base):
        path = (folder / candidate).resolve()
        if candidate and path.is_relative_to(folder.resolve()) and path.is_file():
            return path.read_bytes()
    return None


def decode_image(data: bytes) -> NDArray[np.uint8]:
    """Picture file → (h, w, 4) uint8 sRGB, row 0 = top.

    Raises: MeshError for bytes that are no picture, or more than MAX_PIXELS pixels.
    """
    try:
        with Image.open(io.BytesIO(data)) as image:
            return picture_pixels(image)
    except (Image.UnidentifiedImageError, Image.DecompressionBombError) as error:
        raise MeshError(f"a texture is no readable picture ({error}); remove it or save it as PNG") from error


def picture_pixels(image: Image.Image) -> NDArray[np.uint8]:
    """Opened picture → (h, w, 4) uint8 sRGB, row 0 = top.

    Raises: MeshError where it is damaged or has more than MAX_PIXELS pixels.
    """
    if image.width * image.height > MAX_PIXELS:
        raise MeshError(
            f"a texture has {image.width} × {image.height} pixels, at most {MAX_PIXELS} are read; scale it down"
        )
    try:
        return np.asarray(image.convert("RGBA"), dtype=np.uint8)
    except (OSError, ValueError, SyntaxError) as error:
        raise MeshError(f"a texture is damaged ({error}); remove it or save it as PNG") from error


def read_mtl(data: bytes, read_sibling: Callable[[str], bytes | None]) -> tuple[dict[str, Material], int]:
    """OBJ material library → materials by name, and how many textures were not found.

    Read are Kd, d, map_Kd, and of the physically based additions Pm, Pr, Ke, map_Ke and norm; of options -clamp on.
    Kd is a linear factor; beside a texture it is ignored, as exporters leave their default grey there.

    Raises: MeshError for a texture that is no picture.
    """
    raw: dict[str, dict[str, str]] = {}
    current: dict[str, str] = {}
    for line in data.decode("utf-8", errors="replace").splitlines():
        key, _, rest = line.strip().partition(" ")
        if key.lower() == "newmtl":
            current = raw.setdefault(rest.strip(), {})
        else:
            current[key.lower()] = rest.strip()
    materials: dict[str, Material] = {}
    missing = 0
    for name, fields in raw.items():
        pictures: dict[Slot, Picture] = {}
        for key, slot in MTL_SLOTS.items():
            picture = read_sibling(_map_name(fields[key])) if fields.get(key) else None
            missing += bool(fields.get(key)) and picture is None
            if picture is not None:
                pictures[slot] = Picture(decode_image(picture), _mtl_wrap(fields[key]))
        materials[name] = _mtl_material(name, fields, pictures)
    return materials, missing


def _mtl_material(name: str, fields: Mapping[str, str], pictures: Mapping[Slot, Picture]) -> Material:
    """A plain Material where the library says no more than a colour, repeated."""
    base = pictures.get("base-color")
    factor, pixels = _factor(fields, base is not None), None if base is None else base.pixels
    simple = set(pictures) <= {"base-color"} and not {"ke", "pm", "pr"} & set(fields)
    if simple and (base is None or base.wrap == ("repeat", "repeat")):
        return Material(name=name, base_color_factor=factor, base_color=pixels)
    clear = factor[3] < 1.0 or (pixels is not None and int(pixels[..., 3].min()) < 255)
    red, green, blue = _numbers(fields.get("ke", "1 1 1" if "emissive" in pictures else "0 0 0"))
    return PbrMaterial(
        name=name,
        base_color_factor=factor,
        base_color=pixels,
        pictures=pictures,
        metallic=_numbers(fields.get("pm", "0"))[0],
        roughness=_numbers(fields.get("pr", "0.8"))[0],
        emissive=(red, green, blue),
        alpha_mode="BLEND" if clear else "OPAQUE",
    )


def _mtl_wrap(text: str) -> tuple[Wrap, Wrap]:
    """Clamped where the options say "-clamp on", else repeated."""
    words = text.lower().split()
    clamped = any(pair == ("-clamp", "on") for pair in pairwise(words))
    return ("clamp", "clamp") if clamped else ("repeat", "repeat")


def finite(value: object) -> float:
    """The value as a float.  Raises: ValueError for NaN, infinity, or what is no number."""
    number = float(str(value))
    if not np.isfinite(number):
        raise ValueError(f"{number} is not finite")
    return number


def _numbers(text: str) -> list[float]:
    """Three numbers in [0, 1]; a single one stands for all.  Raises: MeshError for what is no number."""
    try:
        found = [min(max(finite(word), 0.0), 1.0) for word in text.split()]
    except ValueError as error:
        raise MeshError(
            f"a material has factors that are no numbers ({error}); mend or delete the .mtl file"
        ) from error
    return (found * 3)[:3] if len(found) == 1 else [*found, 0.0, 0.0, 0.0][:3]


def _map_name(text: str) -> str:
    """The file name after options such as '-s 1 1 1' (a name with spaces stays whole when there are no options)."""
    return text.split()[-1] if text.startswith("-") else text


def _factor(fields: Mapping[str, str], textured: bool) -> tuple[float, float, float, float]:
    try:
        kd = [min(max(float(word), 0.0), 1.0) for word in fields.get("kd", "1 1 1").split()]
        alpha = min(max(float(fields.get("d", "1").split()[-1]), 0.0), 1.0)
    except (ValueError, IndexError) as error:
        raise MeshError(
            f"a material has colours that are no numbers ({error}); mend or delete the .mtl file"
        ) from error
    red, green, blue = (1.0, 1.0, 1.0) if textured else (kd * 3)[:3] if len(kd) == 1 else (*kd, 1.0, 1.0, 1.0)[:3]
    return red, green, blue, alpha


def linear_to_srgb(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear in [0, 1] → sRGB in [0, 1] (IEC 61966-2-1)."""
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 0.0031308) ** (1 / 2.4) - 0.055)
