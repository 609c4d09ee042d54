"""A baked image before it is a file.

h w texels, row 0 = top · c channels, 1 to 4.  Colour is linear light in memory; how a value is stored is its encoding:

| encoding | values in memory | in PNG | in EXR |
|---|---|---|---|
| srgb | linear light in [0, 1], a fourth channel is alpha, straight | sRGB curve, alpha as it is | linear |
| unit | [0, 1] | as it is | as it is |
| signed | [−1, 1] | (value + 1) / 2 | as it is |
| linear | any real number | refused | as it is |
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from ..runtime.brief import Brief

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from .bakemap import BakeMap

Encoding = Literal["srgb", "unit", "signed", "linear"]
Bits = Literal[8, 16, 32]
FileType = Literal["png", "exr"]


@dataclass(frozen=True, eq=False, repr=False)
class Texture(Brief):
    """A baked image, not encoded yet.

    pixels: (h, w, c) float32, meaning by `encoding` (see the table above).  bits: per channel in the file, 32 for EXR
    only. file_type: how it is written unless asked otherwise.  dither: whether 8-bit files are dithered.
    metadata: texts for the EXR header, such as units.
    """

    pixels: NDArray[np.float32]
    encoding: Encoding
    bits: Bits
    file_type: FileType
    dither: bool = False
    metadata: dict[str, str] = field(default_factory=dict)


def as_texture(entry: BakeMap, pixels: NDArray[np.float32]) -> Texture:
    """Pixels with what the map says of them."""
    metadata = {"map": entry.name, "space": entry.space, "units": entry.units, "range": entry.value_range}
    return Texture(pixels, entry.encoding, entry.bits, entry.file_type, entry.dither, metadata)
