"""Rectangles on whole texels: their edges between texels, so that a picture fills them without a blurred border.

k charts · s outline segments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..growing.outlines import is_rectangle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import PackConfig

ROUNDING = 1e-6
"""Texels by which an edge may miss a whole one and count as on it."""


def aligned(
    placement: NDArray[np.float64], outlines: list[NDArray[np.float64]], size: int, config: PackConfig
) -> NDArray[np.float64]:
    """The placement (k, 2, 3) with upright rectangles shrunk to whole texels, where that is asked for.

    Each side gives up less than two texels, in its own direction alone, so that no padding is lost.  Rectangles that
    are thinner than a texel stay as they are.  outlines: (s, 2, 2), chart coordinates.  size: texels per side.
    """
    if not config.whole_texels:
        return placement
    placement = placement.copy()
    for number, outline in enumerate(outlines):
        linear, shift = placement[number, :, :2], placement[number, :, 2]
        flat = outline @ linear.T + shift
        if not is_rectangle(flat):
            continue
        low, high = flat.min(axis=(0, 1)) * size, flat.max(axis=(0, 1)) * size
        first, last = np.ceil(low - ROUNDING), np.floor(high + ROUNDING)
        if (last - first >= 1.0).all():
            scale = (last - first) / (high - low)
            placement[number] = scale[:, None] * placement[number]
            placement[number, :, 2] += (first - scale * low) / size
    return placement
