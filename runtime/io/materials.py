"""OBJ material libraries, and the pictures beside a mesh file: files of one folder only.

A mesh file may come from anyone: names in it reach no file outside its own folder, and no network.
"""

from __future__ import annotations

import io
from itertools import pairwise
from pathlib import PureWindowsPath
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from ..errors import MeshError
from ..material import Material, Picture, seen_through

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ..material import Slot, Wrap

MAX_PIXELS = 16384 * 16384

MTL_SLOTS: dict[str, Slot] = {"map_kd": "base-color", "map_ke": "emissive", "norm": "normal"}


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
    base = pictures.get("base-color")
    factor = _factor(fields, base is not None)
    red, green, blue = _numbers(fields.get("ke", "1 1 1" if "emissive" in pictures else "0 0 0"))
    return Material(
        name=name,
        base_color_factor=factor,
        pictures=pictures,
        metallic=_numbers(fields.get("pm", "0"))[0],
        roughness=_numbers(fields.get("pr", "0.8"))[0],
        emissive=(red, green, blue),
        alpha_mode="BLEND" if seen_through(factor, base) else "OPAQUE",
        tinted=False,
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
