"""Gutters: the free texels around charts take the value of the nearest texel that holds a surface.

h w texels · g gutter texels.  Distances are Euclidean between texel centres.  The nearest chart wins, so no chart leaks
across another's border.  Among equally near texels the choice depends on the offsets alone, so that a window of the
image, with a halo as wide as the radius, gives what the whole image gives.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import ndimage

from ...runtime.errors import InputError
from ...runtime.process.cores import core_count
from .background import NearestCells

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray


FAR = 127
BAND = 1 << 20
"""Texels whose gutters are searched together."""
LEAST_NEAR = 16
"""Texels around charts that are exact where the whole image is filled."""
MOST_NEAR = 96
"""Texels: up to this radius the search near charts is cheaper than a distance transform of the whole image."""


@dataclass(frozen=True, eq=False)
class Gutter:
    """Which texels to fill, and from where; one Gutter serves all maps of a G-buffer.

    target, source: (g,) int64 flat texel indices: value[target] = value[source].
    beyond: (h, w) bool, the free texels farther away than the radius: they take the background.
    """

    target: NDArray[np.int64]
    source: NDArray[np.int64]
    beyond: NDArray[np.bool_]

    def fill(self, pixels: NDArray[np.float32], background: NDArray[np.float32]) -> NDArray[np.float32]:
        """(h, w, c) float32 and a background (c,) → a new array with gutters filled and background beyond them."""
        filled = np.array(pixels, np.float32, order="C")
        self.part(slice(pixels.shape[0]), slice(pixels.shape[1])).fill(filled, background)
        return filled

    def part(self, rows: slice, columns: slice) -> GutterPart:
        """What concerns some rows and columns of the image."""
        part = self.beyond[rows, columns]
        row, column = np.divmod(self.target, self.beyond.shape[1])
        row -= rows.start or 0
        column -= columns.start or 0
        held = (row >= 0) & (row < part.shape[0]) & (column >= 0) & (column < part.shape[1])
        return GutterPart(rows, columns, row[held], column[held], self.source[held], part)


@dataclass(frozen=True, eq=False)
class GutterPart:
    """A part of an image to fill, from the whole of it.

    rows, columns: which part.  row, column: (g,) int64 targets, counted in the part.  source: (g,) int64 flat indices
    in the image.  beyond: (high, wide) bool.
    """

    rows: slice
    columns: slice
    row: NDArray[np.int64]
    column: NDArray[np.int64]
    source: NDArray[np.int64]
    beyond: NDArray[np.bool_]

    def fill(self, image: NDArray[np.float32], background: NDArray[np.float32]) -> None:
        """Fill that part of the image (h, w, c) in place.  What is read, covered texels, is not changed."""
        part = image[self.rows, self.columns]
        part[self.beyond] = background
        part[self.row, self.column] = image[np.divmod(self.source, image.shape[1])]


def fill_gutters(
    images: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]], covered: NDArray[np.bool_], radius: int | None
) -> None:
    """Fill images (h, w, c), each with its background (c,), in place.

    covered: (h, w) bool.  radius: texels; None fills the whole image from the nearest chart, see background.py.
    Band by band on all cores, each with a halo of the radius: the same as all at once, with less memory.
    """
    height, width = covered.shape
    cells = NearestCells.of(covered) if radius is None and covered.any() else None
    near = (0 if cells is None else max(LEAST_NEAR, 2 * cells.cell)) if radius is None else radius
    band = max(BAND // width, near, 1)

    def fill(top: int) -> None:
        bottom = min(top + band, height)
        first, last = max(top - near, 0), min(bottom + near, height)
        part = find_gutter(covered[first:last], near).part(slice(top - first, bottom - first), slice(width))
        row, column = np.nonzero(part.beyond) if cells is not None else (np.zeros(0, np.int64),) * 2
        source = cells.sources(row + top, column) if cells is not None else row
        for image, background in images:
            part.fill(image[first:last], background)
            image[row + top, column] = image[np.divmod(source, width)]

    with ThreadPoolExecutor(core_count()) as pool:
        list(pool.map(fill, range(0, height, band)))  # list: waits, and raises what was raised


def find_gutter(covered: NDArray[np.bool_], radius: int) -> Gutter:
    """Nearest covered texel of each free texel within radius.

    covered: (h, w) bool.  radius: texels.  Nothing covered: nothing to fill.
    Raises: InputError for a negative radius.
    """
    check_padding(radius)
    none = np.zeros(0, np.int64)
    if radius == 0 or not covered.any():
        return Gutter(target=none, source=none, beyond=~covered)
    if radius > MOST_NEAR:
        return _by_transform(covered, radius)
    down = _down_to_nearest(covered, radius)
    target, source = _nearest_within(covered, down, radius)
    beyond = ~covered
    beyond.reshape(-1)[target] = False
    return Gutter(target=target, source=source, beyond=beyond)


def check_padding(radius: int | None) -> None:
    """Raise InputError for a negative radius."""
    if radius is not None and radius < 0:
        raise InputError(f"padding {radius}: expected 0 texels or more, or None for the whole image")


def _by_transform(covered: NDArray[np.bool_], radius: int) -> Gutter:
    """By the distance transform of the whole image, whose time does not grow with the radius."""
    width = covered.shape[1]
    free = np.flatnonzero(~covered)
    indices = ndimage.distance_transform_edt(~covered, return_distances=False, return_indices=True)
    row, column = np.asarray(indices, np.int32).reshape(2, -1)[:, free].astype(np.int64)
    down, across = row - free // width, column - free % width
    near = down * down + across * across <= radius * radius
    beyond = ~covered
    beyond.reshape(-1)[free[near]] = False
    return Gutter(target=free[near], source=(row * width + column)[near], beyond=beyond)


def _down_to_nearest(covered: NDArray[np.bool_], radius: int) -> NDArray[np.int8]:
    """(h, w) int8 signed rows to the nearest covered texel of the same column, up before down; `FAR` beyond radius.

    Row by row, since a row of bytes is a few machine instructions.
    """
    height, width = covered.shape
    free = (~covered).view(np.uint8)
    up, nearest = np.zeros((height, width), np.uint8), np.zeros((height, width), np.int8)
    steps = np.full(width, FAR, np.uint8)
    for row in range(height):
        steps = np.minimum(steps + np.uint8(1), np.uint8(FAR)) * free[row]
        up[row] = steps
    steps = np.full(width, FAR, np.uint8)
    for row in range(height - 1, -1, -1):
        steps = np.minimum(steps + np.uint8(1), np.uint8(FAR)) * free[row]
        shorter = np.where(up[row] <= steps, -up[row].view(np.int8), steps.view(np.int8))
        nearest[row] = np.where(np.minimum(up[row], steps) <= radius, shorter, np.int8(FAR))
    return nearest


def _spread(near: NDArray[np.bool_], radius: int) -> NDArray[np.bool_]:
    """(h, w) bool: whether a texel of the same row, at most radius columns away, is near."""
    for forward in (True, False):
        near, reach = near.copy(), 0
        while reach < radius:
            step = min(reach + 1, radius - reach)
            if forward:
                near[:, step:] |= near[:, :-step]
            else:
                near[:, :-step] |= near[:, step:]
            reach += step
    return near


def _nearest_within(
    covered: NDArray[np.bool_], down: NDArray[np.int8], radius: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(g,) flat targets, ascending, and their sources: for each the least across² + down² over the columns near it."""
    height, width = covered.shape
    wide = np.full((height, width + 2 * radius), FAR, np.int8)
    wide[:, radius:-radius] = down
    stride, flat = wide.shape[1], wide.reshape(-1)
    target = np.flatnonzero(_spread(down != FAR, radius) & ~covered)
    place = target // width * (stride - width) + target + radius
    best = np.full(len(place), radius * radius + 1, np.int32)
    offset = np.zeros(len(place), np.int64)  # from target to source in the image
    active = np.arange(len(place))
    for across in range(radius + 1):
        active = active[best[active] > across * across]
        for step in (-across, across) if across else (0,):
            rows = flat[place[active] + step].astype(np.int32)
            square = across * across + rows * rows
            better = (square < best[active]) & (rows != FAR)
            won = active[better]
            best[won], offset[won] = square[better], rows[better] * width + step
    found = best <= radius * radius
    return target[found], (target + offset)[found]
