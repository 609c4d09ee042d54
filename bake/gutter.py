"""Gutters: the free texels around charts take the value of the nearest texel that holds a surface.

h w texels.  Distances are Euclidean between texel centres.  The nearest chart wins, so no chart leaks across
another's border.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from ..runtime.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Gutter:
    """Which texels to fill, and from where; one Gutter serves all maps of a G-buffer.

    target, source: (g,) int64 flat texel indices: value[target] = value[source].
    beyond: (b,) int64 flat indices of the free texels farther away than the radius: they take the background.
    """

    target: NDArray[np.int64]
    source: NDArray[np.int64]
    beyond: NDArray[np.int64]

    def fill(self, pixels: NDArray[np.float32], background: NDArray[np.float32]) -> NDArray[np.float32]:
        """(h, w, c) float32 and a background (c,) → a new array with gutters filled and background beyond them."""
        filled = np.array(pixels, np.float32, order="C")
        flat = filled.reshape(-1, filled.shape[-1])
        flat[self.target] = np.take(flat, self.source, axis=0)
        flat[self.beyond] = background
        return filled


def find_gutter(covered: NDArray[np.bool_], radius: int | None) -> Gutter:
    """Nearest covered texel of each free texel within radius.

    covered: (h, w) bool.  radius: texels; None fills the whole image.  Nothing covered: nothing to fill.
    Raises: InputError for a negative radius.
    """
    if radius is not None and radius < 0:
        raise InputError(f"padding {radius}: expected 0 texels or more, or None for the whole image")
    free = np.flatnonzero(~covered)
    none = np.zeros(0, np.int64)
    if radius == 0 or not covered.any():
        return Gutter(target=none, source=none, beyond=free)
    width = covered.shape[1]
    source = _nearest(covered)[free]
    if radius is None:
        return Gutter(target=free, source=source, beyond=none)
    down, across = source // width - free // width, source % width - free % width
    near = down * down + across * across <= radius * radius
    return Gutter(target=free[near], source=source[near], beyond=free[~near])


def _nearest(covered: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(h · w,) int64: flat index of the covered texel nearest to each texel (exact Euclidean)."""
    indices = ndimage.distance_transform_edt(~covered, return_distances=False, return_indices=True)
    row, column = np.asarray(indices, np.int32)
    return (row.astype(np.int64) * covered.shape[1] + column).reshape(-1)
