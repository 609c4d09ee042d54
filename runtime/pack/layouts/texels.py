"""Rectangles on whole texels: their edges between texels, so that a picture fills them without a blurred border.

k charts · s outline segments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..growing.outlines import is_rectangle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...pagesize import PageSize
    from ..config import PackConfig

ROUNDING = 1e-6
"""Texels by which an edge may miss a whole one and count as on it."""


def aligned(
    placement: NDArray[np.float64], outlines: list[NDArray[np.float64]], page: PageSize, config: PackConfig
) -> NDArray[np.float64]:
    """The placement (k, 2, 3) with upright rectangles shrunk to whole texels, where that is asked for.

    Each side gives up less than two texels, in its own direction alone, so that no padding is lost.  Rectangles that
    are thinner than a texel stay as they are.  outlines: (s, 2, 2), chart coordinates.
    """
    if not config.whole_texels:
        return placement
    placement, texels = placement.copy(), np.array(page, dtype=np.float64)
    for number, outline in enumerate(outlines):
        linear, shift = placement[number, :, :2], placement[number, :, 2]
        flat = outline @ linear.T + shift
        if not is_rectangle(flat):
            continue
        low, high = flat.min(axis=(0, 1)) * texels, flat.max(axis=(0, 1)) * texels
        first, last = np.ceil(low - ROUNDING), np.floor(high + ROUNDING)
        if (last - first >= 1.0).all():
            scale = (last - first) / (high - low)
            placement[number] = scale[:, None] * placement[number]
            placement[number, :, 2] += (first - scale * low) / texels
    return placement
