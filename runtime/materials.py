"""Pictures and materials beside a mesh file: (h, w, 4) uint8 sRGB, OBJ material libraries, files of one folder only.

A mesh file may come from anyone: names in it reach no file outside its own folder, and no network.
"""

from __future__ import annotations

import io
from pathlib import PureWindowsPath
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from .errors import MeshError
from .mesh import Material

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from numpy.typing import NDArray

MAX_PIXELS = 16384 * 16384


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
    """OBJ material library → materials by name (Kd, d and map_Kd), and how many textures were not found.

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
    materials, missing = {}, 0
    for name, fields in raw.items():
        picture = read_sibling(_map_name(fields["map_kd"])) if fields.get("map_kd") else None
        missing += bool(fields.get("map_kd")) and picture is None
        texture = None if picture is None else decode_image(picture)
        materials[name] = Material(
            name=name, base_color_factor=_factor(fields, texture is not None), base_color=texture
        )
    return materials, missing


def _map_name(text: str) -> str:
    """The file name after options such as '-s 1 1 1' (a name with spaces stays whole when there are no options)."""
    return text.split()[-1] if text.startswith("-") else text


def _factor(fields: dict[str, str], textured: bool) -> tuple[float, float, float, float]:
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
