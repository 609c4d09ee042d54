"""Image files: float pixels → encoded integers or floats → PNG and EXR, and back for checks.

h w texels, row 0 = top, c channels (1, 3 or 4).  In memory colour is linear light; only PNG holds sRGB (texture.py).
PNG carries no colour chunk (glTF ignores them, other readers disagree about them).  Same pixels, same bytes.
"""

from __future__ import annotations

import tempfile
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import FlexparaError, InputError, MissingDependencyError
from ...runtime.process.cores import core_count
from ..colors.color import srgb_bytes_from_linear, srgb_from_linear

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..texture import Bits, Encoding, Texture


class OpenImageIO:
    """The package, imported where it is first used: files without textures are written without it."""

    def __getattr__(self, name: str) -> Any:
        """What the package has by that name.  Raises: MissingDependencyError where it is absent."""
        try:
            return getattr(import_module("OpenImageIO"), name)
        except ImportError as error:
            raise MissingDependencyError(
                f"OpenImageIO cannot be imported ({error}), textures are written with it: pip install 'flexpara[bake]'"
            ) from error


oiio = OpenImageIO()
PNG_LEVEL, PNG_FILTER = 2, 0x10
"""zlib's level and libpng's filter SUB alone: a third of the time of its own choice, files 3 % larger."""
EXR_COMPRESSION = "zip:2"
BAND = 128
"""Rows quantized at once, a multiple of the dither pattern's 8: what stays in the processor's cache."""
PNG_CHUNKS = (b"IHDR", b"IDAT", b"IEND")
HALF_MAX = 65504.0
NO_DATE = "1970:01:01 00:00:00"
"""Without a date OpenImageIO writes that of the clock into EXR files, and same pixels give other bytes."""
STRAIGHT_ALPHA = "oiio:UnassociatedAlpha"
"""Without this word OpenImageIO divides or multiplies the colours of a PNG by its alpha."""


class EncodingError(InputError):
    """The pixels cannot be written this way."""


def write_texture(texture: Texture, path: Path) -> None:
    """Write by the path's ending, .png or .exr.

    Raises: EncodingError for another ending and as `write_png`, `write_exr`.
    """
    if path.suffix.lower() == ".png":
        write_png(texture, path)
    elif path.suffix.lower() == ".exr":
        write_exr(texture, path)
    else:
        raise EncodingError(f"{path.name}: textures are written as .png or .exr; choose one of these endings")


def write_png(texture: Texture, path: Path, *, bits: Bits | None = None) -> None:
    """Write 8 or 16 bits per channel (texture.bits unless given).

    Raises: EncodingError for unbounded values, 32 bits, NaN, or a channel count that PNG lacks.
    """
    path.write_bytes(encode_png(texture, bits=bits))


def encode_png(texture: Texture, *, bits: Bits | None = None) -> bytes:
    """The bytes of a PNG file: header, data and end, no other chunk.  Raises as `write_png`."""
    levels = quantize(texture, bits=bits)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "texture.png"
        _write(path, levels, {"png:compressionLevel": PNG_LEVEL, "png:filter": PNG_FILTER, STRAIGHT_ALPHA: 1})
        return strip_png(path.read_bytes())


def write_exr(texture: Texture, path: Path, *, bits: Bits | None = None) -> None:
    """Write half (16) or float (32) channels, linear, losslessly compressed; 8 is raised to half.

    Raises: EncodingError for NaN, and for values beyond the range of half.
    """
    pixels = _checked(texture.pixels)
    width = bits or texture.bits
    if width != 32:
        if np.abs(pixels).max(initial=0.0) > HALF_MAX:
            raise EncodingError(f"values reach beyond ±{HALF_MAX:.0f}, the range of half; write the EXR with 32 bits")
        pixels = pixels.astype(np.float16)
    texts = {f"flexpara:{key}": value for key, value in texture.metadata.items()}
    _write(
        path, pixels, {"compression": EXR_COMPRESSION, "oiio:ColorSpace": "lin_rec709", "DateTime": NO_DATE, **texts}
    )


def quantize(texture: Texture, *, bits: Bits | None = None) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """(h, w, c) uint8 or uint16 levels as they go into a PNG.  Raises as `write_png`."""
    depth = bits or texture.bits
    if depth not in (8, 16):
        raise EncodingError(f"{depth} bits: PNG holds 8 or 16 per channel; write an EXR instead")
    if texture.encoding == "linear":
        raise EncodingError("values of unbounded range do not fit a PNG; write an EXR instead")
    pixels = _checked(texture.pixels)
    levels = np.zeros(pixels.shape, np.uint8) if depth == 8 else np.zeros(pixels.shape, np.uint16)

    def fill(start: int) -> None:
        rows = slice(start, start + BAND)
        levels[rows] = _levels(pixels[rows], texture.encoding, depth, dither=texture.dither)

    with ThreadPoolExecutor(core_count()) as pool:
        list(pool.map(fill, range(0, len(pixels), BAND)))  # list: waits, and raises what was raised
    return levels


def _levels(
    pixels: NDArray[np.float32], encoding: Encoding, depth: int, *, dither: bool
) -> NDArray[np.uint8] | NDArray[np.uint16]:
    """(h, w, c) levels of some rows, of which the first is a multiple of 8."""
    if encoding == "srgb" and depth == 8 and not dither:
        return _srgb_bytes(pixels)
    unit = _to_unit(pixels, encoding)
    top = float(2**depth - 1)
    unit *= top
    unit += bayer_threshold(*unit.shape[:2])[..., None] if dither and depth == 8 else np.float32(0.5)
    np.floor(unit, out=unit)
    np.clip(unit, 0.0, top, out=unit)
    return unit.astype(np.uint8) if depth == 8 else unit.astype(np.uint16)


def bayer_threshold(height: int, width: int) -> NDArray[np.float32]:
    """(h, w) float32 in (0, 1), mean ½: the 8 × 8 ordered pattern (Bayer 1973).  Constant in time and compressible."""
    pattern = np.zeros((1, 1))
    for _ in range(3):
        pattern = np.block([[4 * pattern, 4 * pattern + 2], [4 * pattern + 3, 4 * pattern + 1]])
    threshold = ((pattern + 0.5) / 64.0).astype(np.float32)
    return np.tile(threshold, (-(-height // 8), -(-width // 8)))[:height, :width]


def strip_png(data: bytes) -> bytes:
    """A PNG file without its ancillary chunks (colour space, offsets, comments); the image data is untouched."""
    kept, place = [data[:8]], 8
    while place < len(data):
        end = place + 12 + int.from_bytes(data[place : place + 4], "big")
        if data[place + 4 : place + 8] in PNG_CHUNKS:
            kept.append(data[place:end])
        place = end
    return b"".join(kept)


def read_image(path: Path) -> NDArray[np.generic]:
    """(h, w, c) array in the file's own number type, values as stored.

    Raises: InputError when the file can't be read.
    """
    options = oiio.ImageSpec()
    options.attribute(STRAIGHT_ALPHA, 1)
    source = oiio.ImageInput.open(str(path), options)
    if source is None:
        raise InputError(f"{path}: no image that OpenImageIO reads ({oiio.geterror()}); expected PNG or EXR")
    try:
        return np.asarray(source.read_image(source.spec().format))
    finally:
        source.close()


def _checked(pixels: NDArray[np.float32]) -> NDArray[np.float32]:
    """The pixels, finite and of a channel count both formats hold."""
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 2, 3, 4):
        raise EncodingError(f"pixels of shape {pixels.shape}: expected (h, w, c) with 1 to 4 channels")
    if not np.isfinite(pixels).all():
        raise EncodingError("pixels hold NaN or infinite values; mend the map that made them")
    return pixels


def _srgb_bytes(pixels: NDArray[np.float32]) -> NDArray[np.uint8]:
    """8-bit levels of linear light, alpha as it is."""
    levels = srgb_bytes_from_linear(pixels)
    if pixels.shape[2] in (2, 4):
        levels[..., -1] = np.round(np.clip(pixels[..., -1], 0.0, 1.0) * 255.0).astype(np.uint8)
    return levels


def _to_unit(pixels: NDArray[np.float32], encoding: Encoding) -> NDArray[np.float32]:
    """A new array of stored values in [0, 1] (values outside the encoding's range are clamped later)."""
    if encoding == "signed":
        unit = pixels * np.float32(0.5)
        unit += np.float32(0.5)
        return unit
    if encoding == "unit":
        return pixels.copy()
    unit = srgb_from_linear(pixels)
    if pixels.shape[2] in (2, 4):
        unit[..., -1] = pixels[..., -1]
    return unit


def _write(path: Path, levels: NDArray[np.generic], attributes: dict[str, str | int]) -> None:
    """Hand the array to OpenImageIO as it is."""
    formats = {"uint8": oiio.UINT8, "uint16": oiio.UINT16, "float16": oiio.HALF, "float32": oiio.FLOAT}
    height, width, channels = levels.shape
    spec = oiio.ImageSpec(width, height, channels, formats[levels.dtype.name])
    for name, value in attributes.items():
        spec.attribute(name, value)
    output = oiio.ImageOutput.create(str(path))
    if output is None:
        raise FlexparaError(f"{path}: OpenImageIO has no writer for this ending ({oiio.geterror()}); use .png or .exr")
    done = output.open(str(path), spec) and output.write_image(np.ascontiguousarray(levels)) and output.close()
    if not done:
        raise EncodingError(
            f"{path.name}: could not be written ({output.geterror()}), expected a folder with room for it; free some "
            "space, or choose another"
        )
