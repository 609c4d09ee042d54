"""Multi-layer EXR: all maps of a bake in one file, each a layer `<map>.R`, `.G`, … of one part.

h w texels, row 0 = top.  Values are linear, as in memory: no sRGB curve, no (value + 1) / 2.  One number type and one
compression serve the whole file.  The first map's channels could also be called R G B, but then readers disagree about
which layer they belong to: here every channel has its layer's name.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from .images import HALF_MAX, NO_DATE, EncodingError, oiio

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset
    from ..texture import Texture

Compression = Literal["none", "rle", "zip", "zips", "piz", "pxr24", "dwaa", "dwab"]
COMPRESSIONS: tuple[Compression, ...] = ("none", "rle", "zip", "zips", "piz", "pxr24", "dwaa", "dwab")
CHANNELS = ("R", "G", "B", "A")
PLAIN = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True)
class ExrSettings:
    """How an EXR file is stored.

    bits: 16 (half) or 32 (float) for all channels.  compression: of OpenEXR; pxr24 and dwa* lose digits, the others
    none.

    Raises: EncodingError for other values.
    """

    bits: Literal[16, 32] = 32
    compression: Compression = "zip"

    def __post_init__(self) -> None:
        if self.bits not in (16, 32):
            raise EncodingError(f"{self.bits} bits: EXR holds 16 (half) or 32 (float) per channel; choose one")
        if self.compression not in COMPRESSIONS:
            known = ", ".join(COMPRESSIONS)
            raise EncodingError(f"EXR compression {self.compression!r}: expected one of {known}; choose one")


def write_layers(
    textures: Mapping[str, Texture],
    path: Path,
    settings: ExrSettings | None = None,
    *,
    metadata: Mapping[str, str] | None = None,
) -> None:
    """Write all maps as layers of one file.

    Args:
        textures: map name → Texture, all of one size.
        path: ends in .exr.
        settings: number type and compression.
        metadata: texts for the header, stored as `flexpara:<key>`; see `file_metadata`.

    Raises: EncodingError for no map, maps of several sizes, names that are no plain words, NaN, values beyond half.
    """
    settings = settings or ExrSettings()
    _check(textures, path)
    names = [f"{layer}.{letter}" for layer, texture in textures.items() for letter in CHANNELS[: _count(texture)]]
    pixels = _stacked(textures, settings.bits)
    height, width, channels = pixels.shape
    spec = oiio.ImageSpec(width, height, channels, oiio.HALF if settings.bits == 16 else oiio.FLOAT)
    spec.channelnames = tuple(names)
    spec.alpha_channel = -1
    level = ":2" if settings.compression in ("zip", "zips") else ""
    spec.attribute("compression", f"{settings.compression}{level}")
    spec.attribute("oiio:ColorSpace", "lin_rec709")
    spec.attribute("DateTime", NO_DATE)
    for key, text in {**(metadata or {}), **_layer_texts(textures)}.items():
        spec.attribute(f"flexpara:{key}", text)
    output = oiio.ImageOutput.create(str(path))
    if output is None or not (output.open(str(path), spec) and output.write_image(pixels) and output.close()):
        reason = oiio.geterror() if output is None else output.geterror()
        raise EncodingError(
            f"{path.name}: could not be written ({reason}), expected room for it; free some, or choose another folder"
        )


def file_metadata(asset: Asset, *, normal_format: str = "opengl", uv_set: str = "TEXCOORD_0") -> dict[str, str]:
    """Texts that make a file of maps explain itself: uv set, units, orientation, normal convention, source hash."""
    return {
        "uv_set": uv_set,
        "uv_origin": "lower left, v up; image row 0 is v = 1",
        "units": "source file",
        "normal_convention": f"tangent space MikkTSpace, green {'+Y' if normal_format == 'opengl' else '-Y'}",
        "source": asset.stem,
        "source_sha256": asset.sha256,
    }


def _check(textures: Mapping[str, Texture], path: Path) -> None:
    """Raise EncodingError for what one file cannot hold."""
    if path.suffix.lower() != ".exr":
        raise EncodingError(f"{path.name}: layers are written into .exr files; choose this ending")
    if not textures:
        raise EncodingError("no map to write; expected one or more")
    sizes = {texture.pixels.shape[:2] for texture in textures.values()}
    if len(sizes) > 1:
        raise EncodingError(f"maps of sizes {sorted(sizes)}: the layers of a file have one size; bake them alike")
    for name, texture in textures.items():
        if PLAIN.fullmatch(name) is None:
            raise EncodingError(f"map {name!r}: a layer's name has letters, digits, - and _ only; rename the map")
        if not np.isfinite(texture.pixels).all():
            raise EncodingError(f"map {name} holds NaN or infinite values; mend the function that made it")


def _stacked(textures: Mapping[str, Texture], bits: int) -> NDArray[np.float16] | NDArray[np.float32]:
    """(h, w, all channels) in the file's number type."""
    for name, texture in textures.items():
        if bits == 16 and np.abs(texture.pixels).max(initial=0.0) > HALF_MAX:
            raise EncodingError(f"map {name} reaches beyond ±{HALF_MAX:.0f}, the range of half; write 32 bits")
    whole = np.concatenate([texture.pixels for texture in textures.values()], axis=2)
    return whole.astype(np.float16) if bits == 16 else np.ascontiguousarray(whole, np.float32)


def _count(texture: Texture) -> int:
    """Channels of a map."""
    return texture.pixels.shape[2]


def _layer_texts(textures: Mapping[str, Texture]) -> dict[str, str]:
    """What each map says about itself, by `<map>.<key>`."""
    return {f"{name}.{key}": text for name, texture in textures.items() for key, text in texture.metadata.items()}
