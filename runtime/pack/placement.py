"""Where charts go: silhouettes on a coarse grid, placed by xatlas.

k charts · R cells per side of the coarse grid.  A silhouette is a boolean mask (h, w) of grid cells, row 0 lowest, that
holds the chart and its padding; charts are as far apart as their paddings demand when no two silhouettes share a cell.

xatlas moves charts, and we let it do nothing else: it turns charts by swapping x and y (a mirror image), stretches them
to whole texels and rounds paddings, so it only gets silhouettes, which are whole cells already, and gives translations.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import xatlas
from scipy import ndimage
from scipy.spatial import KDTree

from ..errors import FinishError
from ..geometry.gaps import sample_segments

if TYPE_CHECKING:
    from numpy.typing import NDArray

_HALF_DIAGONAL = 0.5**0.5 + 0.01


@dataclass(frozen=True, eq=False)
class Relief:
    """Signed distance of a chart's outline on the coarse grid, for silhouettes of any padding.

    distance: (h, w) float64 cells from each cell's centre to the chart, 0 inside, inf beyond the padding planned for.
    origin: (2,) float64 chart coordinates, in cells, of the lower left corner of cell (0, 0).
    """

    distance: NDArray[np.float64]
    origin: NDArray[np.float64]

    def silhouette(self, padding: float) -> NDArray[np.bool_]:
        """(h, w) bool: the cells that hold anything within padding (cells) of the chart."""
        return self.distance <= padding + _HALF_DIAGONAL


def relief(outline: NDArray[np.float64], reach: float) -> Relief:
    """Relief of one chart.

    Args:
        outline: (s, 2, 2) float64 directed outline segments, in cells, the chart to the left of each.
        reach: largest padding that will be asked for, cells.
    """
    margin = np.ceil(reach) + 2.0
    low = np.floor(outline.min(axis=(0, 1))) - margin
    width, height = (np.ceil(outline.max(axis=(0, 1))) + margin - low).astype(np.int64).tolist()
    local = outline - low
    inside = _inside(local, height, width)
    near = np.zeros((height, width), dtype=bool)
    ndimage.binary_dilation(_touched(local, height, width), np.ones((3, 3)), iterations=int(margin) + 1, output=near)
    rows, columns = np.nonzero(near & ~inside)
    tree = KDTree(sample_segments(local, 0.25)[0])
    distance = np.where(inside, 0.0, np.inf)
    centres = np.stack([columns + 0.5, rows + 0.5], axis=1)
    distance[rows, columns] = tree.query(centres, distance_upper_bound=margin)[0]
    return Relief(distance=distance, origin=low)


def _touched(segments: NDArray[np.float64], height: int, width: int) -> NDArray[np.bool_]:
    grid = np.zeros((height, width), dtype=bool)
    cell = sample_segments(segments, 0.5)[0].astype(np.int64)
    grid[cell[:, 1], cell[:, 0]] = True
    return grid


def _inside(segments: NDArray[np.float64], height: int, width: int) -> NDArray[np.bool_]:
    """(h, w) bool: cell centres with winding number ≠ 0."""
    low, high = np.sort(segments[:, :, 1], axis=1).T
    first, last = np.ceil(low - 0.5).astype(np.int64), np.ceil(high - 0.5).astype(np.int64)
    count = last - first
    owner = np.repeat(np.arange(len(segments)), count)
    row = np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count) + first[owner]
    start, end = segments[owner, 0], segments[owner, 1]
    rise = end[:, 1] - start[:, 1]
    x = start[:, 0] + (row + 0.5 - start[:, 1]) / rise * (end[:, 0] - start[:, 0])
    winding = np.zeros((height, width + 1), dtype=np.int64)
    np.add.at(winding, (row, np.clip(np.ceil(x - 0.5).astype(np.int64), 0, width)), np.where(rise > 0.0, 1, -1))
    return np.cumsum(winding, axis=1)[:, :width] != 0


def turned(mask: NDArray[np.bool_], quarters: int) -> NDArray[np.bool_]:
    """The mask (h, w) turned counter-clockwise by quarters · 90° (row 0 is lowest)."""
    return np.rot90(mask, -quarters)


def solid(mask: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """What `place` takes: the mask (h, w) cropped, at least 2 × 2 and 4-connected.

    A mask in several pieces grows by a cell, and where that doesn't join them, to its bounding rectangle.

    Returns:
        The new mask, and (2,) int64 column and row of its cell (0, 0) in the old one (−1 where it grew over it).
    """
    if _pieces(mask) > 1:
        mask = np.pad(mask, 1)
        grown = np.asarray(ndimage.binary_dilation(mask), dtype=bool)
        moved, offset = solid(grown if _pieces(grown) == 1 else _rectangle(mask))
        return moved, offset - 1
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    offset = np.array([columns[0], rows[0]], dtype=np.int64)
    cropped = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    missing = np.maximum(2 - np.array(cropped.shape), 0)
    return np.pad(cropped, ((0, missing[0]), (0, missing[1])), mode="edge"), offset


def _pieces(mask: NDArray[np.bool_]) -> int:
    labels = np.zeros(mask.shape, dtype=np.int32)
    ndimage.label(mask, output=labels)
    return int(labels.max())


def _rectangle(mask: NDArray[np.bool_]) -> NDArray[np.bool_]:
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    full = np.zeros_like(mask)
    full[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] = True
    return full


def place(masks: list[NDArray[np.bool_]], resolution: int, *, exhaustive: bool) -> NDArray[np.int64] | None:
    """Places silhouettes on a square grid without common cells.

    Args:
        masks: k silhouettes (h, w), each 4-connected, its first and last rows and columns not empty, h and w ≥ 2.
        resolution: cells per side.
        exhaustive: whether every place is looked at, which takes longer the more charts there are.

    Returns:
        (k, 2) int64 column and row of each mask's cell (0, 0), or None where xatlas finds no room.

    Raises:
        FinishError: xatlas broke a silhouette up or put two on one cell (a defect).
    """
    if max(max(mask.shape) for mask in masks) > resolution or sum(int(mask.sum()) for mask in masks) > resolution**2:
        return None
    soups = [_soup(mask) for mask in masks]
    count = [len(soup) for soup in soups]
    corners = np.concatenate(soups).reshape(-1, 2)
    owner = np.repeat(np.arange(len(masks)), count)
    atlas = xatlas.Atlas()
    indices = np.arange(len(corners), dtype=np.uint32).reshape(-1, 3)
    atlas.add_uv_mesh(corners.astype(np.float32), indices, owner.astype(np.uint32).reshape(-1, 1))
    atlas.generate(pack_options=_options(resolution, exhaustive=exhaustive))
    if atlas.chart_count != len(masks):
        raise FinishError(f"xatlas saw {atlas.chart_count} charts in {len(masks)} silhouettes; please report the mesh")
    if atlas.atlas_count != 1 or (atlas.width, atlas.height) != (resolution, resolution):
        return None
    source, _, uv = atlas.get_mesh(0)
    moved = np.rint(uv.astype(np.float64) * resolution - 0.5 - corners[source]).astype(np.int64)
    offset = np.zeros((len(masks), 2), dtype=np.int64)
    offset[np.repeat(owner, 3)[source]] = moved
    _verify(masks, offset, resolution)
    return offset


def _options(resolution: int, *, exhaustive: bool) -> xatlas.PackOptions:
    options = xatlas.PackOptions()
    options.resolution = resolution
    options.texels_per_unit = 1.0
    options.padding = 0
    options.bilinear = False
    options.bruteForce = exhaustive
    options.rotate_charts = False
    options.rotate_charts_to_axis = False
    options.create_image = False
    return options


def _verify(masks: list[NDArray[np.bool_]], offset: NDArray[np.int64], resolution: int) -> None:
    used = np.zeros((resolution, resolution), dtype=np.int64)
    for mask, (column, row) in zip(masks, offset.tolist(), strict=True):
        used[row : row + mask.shape[0], column : column + mask.shape[1]] += mask
    if used.max() > 1 or used.sum() != sum(int(mask.sum()) for mask in masks):
        raise FinishError(f"xatlas put {int((used > 1).sum())} cells of {resolution}² under two charts; please report")


def _soup(mask: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Triangles (t, 3, 2) that touch exactly the cells of a mask (h, w), joined through shared corners.

    Corners lie on cell centres (cell (0, 0) at the origin), because xatlas puts whole coordinates on texel centres.
    Rows are runs of cells: slivers along each run, rectangles where runs of neighbouring rows overlap.
    """
    height, width = mask.shape
    edge = np.diff(np.pad(mask, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    row, start = np.nonzero(edge == 1)
    end = np.nonzero(edge == -1)[1] - 1
    span = width + 1
    first = np.searchsorted(row * span + end, (row + 1) * span + start, "left")
    count = np.maximum(np.searchsorted(row * span + start, (row + 1) * span + end, "right") - first, 0)
    lower = np.repeat(np.arange(len(row)), count)
    upper = first[lower] + np.arange(len(lower)) - np.repeat(np.cumsum(count) - count, count)
    left, right, y = np.maximum(start[lower], start[upper]), np.minimum(end[lower], end[upper]), row[lower]
    ends = [row * span + start, row * span + end, y * span + left, y * span + right]
    stops = np.unique(np.concatenate([*ends, (y + 1) * span + left, (y + 1) * span + right]))
    run = np.searchsorted(row * span + start, stops, "right")
    joined = run[1:] == run[:-1]
    along, a, b = stops[:-1][joined] // span, stops[:-1][joined] % span, stops[1:][joined] % span
    inward = np.where(along + 1 < height, along + 0.25, along - 0.25)
    tip = np.where(left + 1 < width, left + 0.25, left - 0.25)
    right_corner, right_y = np.where(right > left, right, tip), np.where(right > left, y, y + 0.5)
    slivers = np.stack([a, along, b, along, (a + b) / 2.0, inward], axis=1)
    halves = np.stack([left, y, right_corner, right_y, left, y + 1], axis=1)
    others = np.stack([right, y, right, y + 1, left, y + 1], axis=1)[right > left]
    return np.concatenate([slivers, halves, others]).reshape(-1, 3, 2).astype(np.float64)
