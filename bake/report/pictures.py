"""Baked maps as pictures that a browser shows: scaled down, eight bits, WebP.   h w texels, row 0 = top.

A folder may come from anyone: only plain names in it are opened, and no picture beyond a size.
"""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from ...runtime.errors import FlexparaError, InputError
from ...runtime.io.pictures.pictures import demand_texels, inside
from ..colors.color import srgb_from_linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

QUALITY = 88
"""Of WebP, 0 to 100."""
ENDS = (0.01, 0.99)
"""Quantiles of an EXR channel that become black and white."""


def data_uri(kind: str, content: bytes) -> str:
    """Content as an address of its own."""
    return f"data:{kind};base64,{base64.b64encode(content).decode('ascii')}"


def as_webp(image: Image.Image, size: int, *, lossless: bool = False) -> str:
    """A picture of at most that side as a data address."""
    image = eight_bits(image)
    if max(image.size) > size:
        scale = size / max(image.size)
        image = image.resize(
            (max(1, round(image.width * scale)), max(1, round(image.height * scale))), Image.Resampling.BOX
        )
    stream = io.BytesIO()
    image.save(stream, "WEBP", quality=QUALITY, lossless=lossless, method=4)
    return data_uri("image/webp", stream.getvalue())


def eight_bits(image: Image.Image) -> Image.Image:
    """The picture as RGB or RGBA of eight bits a channel; sixteen bits lose their lower half."""
    if image.mode.startswith("I") or image.mode == "F":
        levels = np.asarray(image, np.float64)
        image = Image.fromarray((levels / (65535.0 / 255.0)).clip(0.0, 255.0).astype(np.uint8))
    return image.convert("RGBA" if "A" in image.getbands() or image.mode == "P" else "RGB")


def picture_file(folder: Path, name: str, size: int) -> str:
    """A picture of the folder as a data address.

    Raises: InputError for a name that leads elsewhere, or a file that is no PNG, JPEG, WebP or EXR within limits.
    """
    path = inside(folder, name) if name == Path(name).name else None
    if path is None:
        raise InputError(f"{name} is no file of the folder, expected a picture; unwrap the mesh again")
    if path.suffix.lower() == ".exr":
        return as_webp(_of_exr(path), size)
    try:
        with Image.open(path, formats=("PNG", "JPEG", "WEBP")) as image:
            demand_texels(image.width, image.height)
            return as_webp(image, size)
    except InputError:
        raise
    except (OSError, ValueError, SyntaxError, Image.DecompressionBombError) as error:
        raise InputError(f"{name} is no picture that is read ({error}); unwrap the mesh again") from error


def _of_exr(path: Path) -> Image.Image:
    """An EXR file of one map, each channel stretched from its low to its high values.

    Raises: InputError where it has no or too many channels, or OpenImageIO is absent.
    """
    from ..files.images import read_image

    try:
        pixels: NDArray[Any] = np.asarray(read_image(path), np.float32)
    except FlexparaError as error:
        raise InputError(f"{path.name} can't be shown ({error})") from error
    if pixels.ndim != 3 or pixels.shape[2] > 4:
        raise InputError(f"{path.name} holds layers, which are not shown; bake single maps for that")
    pixels = np.nan_to_num(pixels[..., :3] if pixels.shape[2] >= 3 else pixels[..., [0, 0, 0]])
    low, high = np.quantile(pixels[::4, ::4].reshape(-1, 3), ENDS, axis=0)
    unit = (pixels - low) / np.maximum(high - low, 1e-12)
    return Image.fromarray((srgb_from_linear(unit.astype(np.float32)) * 255.0).astype(np.uint8))
