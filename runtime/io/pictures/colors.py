"""Vertex colours: (n, 4) uint8 sRGB in memory, whatever the file has."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import ShapeError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...mesh import Atlas


def as_rgba(colors: NDArray[Any]) -> NDArray[np.uint8]:
    """(n, 3 or 4) uint8, or float in [0, 1] → (n, 4) uint8; a missing alpha is opaque."""
    if colors.dtype.kind == "f":
        colors = np.rint(np.clip(np.nan_to_num(colors), 0.0, 1.0) * 255.0)
    elif colors.dtype != np.uint8:
        raise ShapeError(f"colors have dtype {colors.dtype}, expected uint8, or float in [0, 1]; convert them")
    opaque = np.full((len(colors), 4), 255, dtype=np.uint8)
    opaque[:, : colors.shape[1]] = colors
    return opaque


def source_colors(atlas: Atlas, colors: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """(n, 4) uint8: the colour of the source vertex of each atlas vertex."""
    needed = int(atlas.source_vertex.max(initial=-1)) + 1
    if colors.ndim != 2 or colors.shape[1] != 4 or colors.dtype != np.uint8 or len(colors) < needed:
        raise ShapeError(
            f"colors has shape {colors.shape} and dtype {colors.dtype}, expected ({needed} or more, 4) uint8; "
            "pass Asset.colors"
        )
    return colors[atlas.source_vertex]


def linear_to_srgb(value: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear in [0, 1] → sRGB in [0, 1] (IEC 61966-2-1)."""
    return np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 0.0031308) ** (1 / 2.4) - 0.055)
