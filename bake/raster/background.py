"""The rest of an image: texels far from every chart take the value of the nearest chart, found on a coarser image.

h w texels · cells of `cell` × `cell` texels.  Mip levels then mix charts with charts, never with an empty background.
A distance transform of a large image takes seconds and gigabytes; that of its cells takes neither, and where charts are
far, a texel to the left or right makes no difference: the source lies within three cells' diagonals of the nearest one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_CELLS = 1024
"""Cells along the longer side of an image; up to this side each texel is a cell, and the answer exact."""


@dataclass(frozen=True, eq=False)
class NearestCells:
    """A covered texel near each cell.

    cell: side of a cell, texels.  source: (⌈h / cell⌉, ⌈w / cell⌉) int64 flat index of a covered texel of the image.
    """

    cell: int
    source: NDArray[np.int64]

    @classmethod
    def of(cls, covered: NDArray[np.bool_]) -> NearestCells:
        """Of an image (h, w) in which some texel is covered."""
        height, width = covered.shape
        cell = -(-max(height, width) // MOST_CELLS)
        held, first = _first_covered(covered, cell)
        nearest = ndimage.distance_transform_edt(~held, return_distances=False, return_indices=True)
        row, column = np.asarray(nearest, np.int64)
        place = first[row, column]
        texel_row, texel_column = row * cell + place // cell, column * cell + place % cell
        return cls(cell, texel_row * width + texel_column)

    def sources(self, row: NDArray[np.int64], column: NDArray[np.int64]) -> NDArray[np.int64]:
        """(g,) flat covered texels for the texels at rows and columns (g,)."""
        return self.source[row // self.cell, column // self.cell]


def _first_covered(covered: NDArray[np.bool_], cell: int) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """Of each cell whether it holds a covered texel, and the number of the first one in it, row by row."""
    height, width = covered.shape
    padded = np.pad(covered, ((0, -height % cell), (0, -width % cell)))
    cells = padded.reshape(padded.shape[0] // cell, cell, padded.shape[1] // cell, cell)
    flat = cells.transpose(0, 2, 1, 3).reshape(cells.shape[0], cells.shape[2], cell * cell)
    return np.asarray(flat.any(axis=2)), flat.argmax(axis=2).astype(np.int64)
