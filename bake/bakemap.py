"""A kind of texture: what it holds, how it is stored, and the function of the G-buffer that makes it.

h w texels, row 0 = top.  A map's function takes (GBuffer, Atlas, Asset) and returns (h, w, c) float32; what it
returns where no surface lies is replaced by the background.  Colours are linear light in memory.  Gutters, dithering
and encoding come later, in baker.py and files/images.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ..runtime.mesh import Asset, Atlas
    from .raster.gbuffer import GBuffer
    from .texture import Bits, Encoding, FileType

NormalFormat = Literal["opengl", "directx"]
"""Green channel of tangent-space normal maps: +Y (up) or −Y (down)."""
NORMAL_FORMATS: tuple[NormalFormat, ...] = ("opengl", "directx")

Compute = Callable[["GBuffer", "Atlas", "Asset"], "NDArray[np.float32]"]


@dataclass(frozen=True)
class BakeMap:
    """A kind of texture.

    name: as on the command line and in file names.  space, units, value_range: what the numbers mean, in words.
    encoding, file_type, bits: how they are stored (see images.py).  compute: the map itself.
    background: values of the first three channels where no surface lies; a fourth, alpha, is 1 there.  dither:
    whether 8-bit files are dithered. everywhere: True when the map covers the whole image, so that it needs neither
    background nor gutter.  estimated: True when each texel carries noise of its own, as what rays find.
    """

    name: str
    space: str
    units: str
    value_range: str
    encoding: Encoding
    file_type: FileType
    bits: Bits
    compute: Compute
    background: tuple[float, ...]
    dither: bool = False
    everywhere: bool = False
    estimated: bool = False
