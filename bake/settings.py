"""How maps become images: what a call of `baker.bake` may be asked besides its maps.   sizes in texels."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from pathlib import Path

    from ..runtime.pagesize import Size
    from .bakemap import NormalFormat
    from .raster.plan import Device


@dataclass(frozen=True, kw_only=True)
class BakeSettings:
    """Size and quality of images, and what draws them.  Checked when they are used: see `baker.bake`.

    size: texels of a square's side, or WIDTHxHEIGHT; None is the atlas' own.
    padding: texels of gutter around charts, beyond which lies the background; None fills the whole image.
    samples: 1, 4 or 16 per texel.
    normal_format: green channel of maps in tangent space that are asked for by name, opengl (+Y) or directx (−Y).
    device: "opengl", "software" (numpy: the same result, slower), or "auto": numpy where no OpenGL device answers.
    limit: the largest side drawn at once, in samples; None is what the device allows.
    tile: the UDIM tile (a, b) to draw, see udim.py; None is the unit square.
    denoise: whether Open Image Denoise takes the noise out of maps that rays estimate.
    scratch: a folder on whose disk images are kept, in files without a name, instead of in memory: for 16k.
    """

    size: Size | None = None
    padding: int | None = None
    samples: int = 1
    normal_format: NormalFormat = "opengl"
    device: Device = "auto"
    limit: int | None = None
    tile: tuple[int, int] | None = None
    denoise: bool = False
    scratch: Path | None = None
