"""Files beside a mesh file, and pictures: bytes → pixels.

h w texels.  A mesh file may come from anyone: names in it reach no file outside its own folder, and no network.
"""

from __future__ import annotations

import io
import struct
import zlib
from pathlib import PureWindowsPath
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from ...errors import MeshError
from ..limits import TEXTURES, limits, raised

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    from numpy.typing import NDArray

FORMATS = ("PNG", "JPEG", "WEBP", "BMP", "TGA", "TIFF", "GIF")
"""Kinds of pictures that are opened.  Pillow knows others, some of which start programs or are hardly used."""
OTHERS = (b"DDS ", b"\xabKTX", b"v/1\x01", b"8BPS", b"#?RADIANCE", b"#?RGBE", b"\x00\x00\x00\x0cJXL ")
"""How files of other kinds begin: DDS, KTX, OpenEXR, Photoshop, Radiance, JPEG XL."""
PNG = b"\x89PNG\r\n\x1a\n"
BROKEN = (OSError, ValueError, SyntaxError, EOFError, IndexError, KeyError, TypeError, OverflowError, struct.error)
BROKEN += (zlib.error, Image.DecompressionBombError, MemoryError)
"""What Pillow raises on damaged files: it has no family of its own."""


def read_in_folder(folder: Path, name: str) -> bytes | None:
    """Bytes of the file of this name inside the folder, or None where there is none.

    OBJ files often name folders of their author's machine: those are looked for beside the mesh by base name.
    """
    path = found_in_folder(folder, name)
    return None if path is None else path.read_bytes()


def found_in_folder(folder: Path, name: str) -> Path | None:
    """The file that `read_in_folder` reads."""
    base = PureWindowsPath(name.strip()).name
    return inside(folder, name.strip()) or inside(folder, base)


def inside(folder: Path, name: str) -> Path | None:
    """The file of this name if it lies in the folder or below it, else None; links that lead outside are not followed.

    None too for a name that no file can have: it may hold any character.
    """
    try:
        path = (folder / name).resolve()
        return path if name and path.is_relative_to(folder.resolve()) and path.is_file() else None
    except (OSError, ValueError):
        return None


def decode_image(data: bytes, beside: Iterable[NDArray[np.uint8] | None] = ()) -> NDArray[np.uint8]:
    """Picture file → (h, w, 4) uint8 sRGB, row 0 = top.  beside: pictures of the same file that are read already.

    Raises: MeshError for bytes that are no picture, or more texels than are read.
    """
    try:
        with _opened(data) as image:
            demand_texels(image.width, image.height, beside)
            limits().demand_unpacked(4 * image.width * image.height, len(data), "a texture")
            return picture_pixels(image)
    except MeshError:
        raise
    except BROKEN as error:
        raise MeshError("a texture is no picture that is read, expected PNG or JPEG; save it as PNG") from error


def decoded_if_known(data: bytes | None, beside: Iterable[NDArray[np.uint8] | None] = ()) -> NDArray[np.uint8] | None:
    """The same, None where there is no file, or a picture of a kind that is not read.  Raises: as `decode_image`."""
    return None if data is None or data.startswith(OTHERS) else decode_image(data, beside)


def is_deep(data: bytes) -> bool:
    """Whether a picture file is a PNG of 16 bits a channel, of which 8 are read."""
    return data.startswith(PNG) and data[24:25] == b"\x10"


def _opened(data: bytes) -> Image.Image:
    """A picture of which but the head is read.  Pillow's own limit on pixels stands aside: ours follows."""
    theirs, Image.MAX_IMAGE_PIXELS = Image.MAX_IMAGE_PIXELS, None
    try:
        return Image.open(io.BytesIO(data), formats=FORMATS)
    finally:
        Image.MAX_IMAGE_PIXELS = theirs


def demand_texels(width: int, height: int, beside: Iterable[NDArray[np.uint8] | None] = ()) -> None:
    """Raises: MeshError for a texture of more texels than the limits in force allow, alone or with those beside it."""
    most = limits().texels
    if width * height > most:
        remedy = f"scale it down, or {raised('texels')}"
        raise MeshError(f"a texture has {width} × {height} pixels, at most {most} are read; {remedy}")
    together = width * height + sum(picture.shape[0] * picture.shape[1] for picture in beside if picture is not None)
    if together > TEXTURES * most:
        found = f"the textures of a file have more than {TEXTURES * most} pixels together, expected fewer"
        raise MeshError(f"{found}; scale them down, or {raised('texels')}")


def picture_pixels(image: Image.Image) -> NDArray[np.uint8]:
    """Opened picture → (h, w, 4) uint8 sRGB, row 0 = top; the upper 8 of 16 bits.

    Raises: MeshError where it is damaged or has more texels than are read.
    """
    demand_texels(image.width, image.height)
    try:
        if image.mode.startswith("I"):  # grey of 16 bits, which Pillow would clip at 255
            grey = np.clip(np.asarray(image).astype(np.int64) >> 8, 0, 255).astype(np.uint8)
            image = Image.fromarray(grey)
        return np.asarray(image.convert("RGBA"), dtype=np.uint8)
    except BROKEN as error:
        raise MeshError("a texture is damaged, expected a whole PNG or JPEG; remove it or save it as PNG") from error


def png_of(pixels: NDArray[np.uint8]) -> bytes:
    """The bytes of a PNG file of (h, w, 4) uint8, without alpha where all of it is 255."""
    stream = io.BytesIO()
    opaque = bool((pixels[..., 3] == 255).all())
    Image.fromarray(np.ascontiguousarray(pixels[..., :3] if opaque else pixels)).save(stream, "PNG")
    return stream.getvalue()
