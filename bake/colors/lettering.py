"""Lines of text inside pictures, in Pillow's own TrueType font, smooth.   h w pixels, row 0 = top, linear light."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from PIL import Image, ImageDraw, ImageFont

if TYPE_CHECKING:
    from numpy.typing import NDArray

Align = Literal["left", "middle", "right"]


def text_cover(text: str, height: float) -> NDArray[np.float32]:
    """(h, w) float32 in [0, 1]: how much of each pixel one line of text covers; h is the same for all texts."""
    font = ImageFont.load_default(height)
    ascent, descent = font.getmetrics() if isinstance(font, ImageFont.FreeTypeFont) else (round(height), 0)
    image = Image.new("L", (max(int(np.ceil(font.getlength(text))), 1), ascent + descent))
    ImageDraw.Draw(image).text((0, 0), text, fill=255, font=font)
    return np.asarray(image, np.float32) / np.float32(255.0)


def with_text(
    picture: NDArray[np.float32],
    text: str,
    place: tuple[float, float],
    *,
    height: float,
    color: tuple[float, float, float],
    align: Align = "middle",
) -> NDArray[np.float32]:
    """A copy of the picture (h, w, 3) with a line of text; what lies beyond its rim is cut off.

    place: (row, column) of the text: the middle of its height, and its left end, middle or right end.
    height: of the font, pixels.  color: linear light.
    """
    cover = text_cover(text, height)
    shift = {"left": 0.0, "middle": 0.5, "right": 1.0}[align]
    top, left = round(place[0] - cover.shape[0] / 2.0), round(place[1] - shift * cover.shape[1])
    rows = slice(max(top, 0), min(top + cover.shape[0], picture.shape[0]))
    columns = slice(max(left, 0), min(left + cover.shape[1], picture.shape[1]))
    result = picture.copy()
    if rows.start < rows.stop and columns.start < columns.stop:
        part = cover[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left, None]
        result[rows, columns] += part * (np.asarray(color, np.float32) - result[rows, columns])
    return result
