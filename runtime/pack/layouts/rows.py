"""Charts in rows of their bounding boxes, the highest first: a layout of thousands in the time that sorting them takes.

k charts.  Lengths are in sides of the page: its longer side is 1.  Shelves of decreasing height (Coffman et al. 1980).
The largest scale at which all boxes fit is found by halving; boxes keep the padding, so what is in them does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...errors import NoRoomError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import Rotation, RowConfig


def laid_in_rows(
    outlines: list[NDArray[np.float64]],
    room: float,
    extent: NDArray[np.float64],
    config: RowConfig,
    *,
    rotation: Rotation = "any",
) -> NDArray[np.float64]:
    """(k, 2, 3) chart coordinates → sides of the page.

    Args:
        outlines: k outlines (s, 2, 2), source units.
        room: what is kept free around each box and along the border, ≥ 0.
        extent: (2,) width and height of the page.
        config: numbers.
        rotation: how charts may be turned.

    Raises:
        NoRoomError: the padding leaves no room for the charts.
    """
    angle, low, size = boxes(outlines, config.angles if rotation == "any" else 1, lying=rotation != "off")
    order = np.argsort(-size[:, 1], kind="stable")
    least, most = 0.0, float(np.sqrt(extent.prod() / max(size.prod(axis=1).sum(), 1e-300)))
    if rows_of(size[order] * (most * config.smallest) + 2.0 * room, extent) is None:
        raise NoRoomError(
            f"{len(outlines)} charts with a padding of {100.0 * room:.3g} % of the atlas side leave no room for "
            "texels; lower the padding or raise the size"
        )
    for _ in range(config.halvings):
        middle = (least + most) / 2.0
        fits = rows_of(size[order] * middle + 2.0 * room, extent) is not None
        least, most = (middle, most) if fits else (least, middle)
    scale = max(least, most * config.smallest)
    corner = rows_of(size[order] * scale + 2.0 * room, extent)
    assert corner is not None, "it was tried"
    placement = np.zeros((len(outlines), 2, 3))
    cosine, sine = np.cos(angle), np.sin(angle)
    placement[:, :, :2] = scale * np.stack([cosine, -sine, sine, cosine], axis=1).reshape(-1, 2, 2)
    placement[order, :, 2] = corner + room - scale * low[order]
    return placement


def boxes(
    outlines: list[NDArray[np.float64]], angles: int, *, lying: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Of each chart the angle (k,) of those tried that gives the least box, its lower left corner (k, 2), its size.

    lying: they are turned until they are at least as wide as high.
    """
    points = np.concatenate([outline.reshape(-1, 2) for outline in outlines])
    first = np.cumsum([0, *(2 * len(outline) for outline in outlines[:-1])])
    tried = np.arange(angles) * (np.pi / 2.0 / angles)
    found = [box_of(points, first, angle) for angle in tried.tolist()]
    best = np.array([(high - low).prod(axis=1) for low, high in found]).argmin(axis=0)
    row = np.arange(len(outlines))
    low, high = (np.array([box[side] for box in found])[best, row] for side in (0, 1))
    stands = lying & ((high - low)[:, 1] > (high - low)[:, 0])  # a quarter turn: (x, y) → (−y, x)
    turned = np.stack([-high[:, 1], low[:, 0]], axis=1), np.stack([-low[:, 1], high[:, 0]], axis=1)
    low, high = (np.where(stands[:, None], there, here) for there, here in zip(turned, (low, high), strict=True))
    return tried[best] + stands * (np.pi / 2.0), low, high - low


def box_of(
    points: NDArray[np.float64], first: NDArray[np.int64], angle: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and largest coordinates (k, 2) of points (n, 2) turned by an angle; each chart begins at ``first`` (k,)."""
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = points @ np.array([[cosine, sine], [-sine, cosine]])
    return np.minimum.reduceat(turned, first, axis=0), np.maximum.reduceat(turned, first, axis=0)


def rows_of(size: NDArray[np.float64], extent: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Lower left corners (k, 2) of boxes (k, 2) in rows from the left, the highest first; None where they don't fit."""
    width, height = extent.tolist()
    end = np.concatenate([[0.0], np.cumsum(size[:, 0])])
    corner, row, level = np.zeros((len(size), 2)), 0, 0.0
    while row < len(size):
        after = int(np.searchsorted(end, end[row] + width, side="right")) - 1
        if after == row or level + size[row, 1] > height:
            return None
        corner[row:after] = np.stack([end[row:after] - end[row], np.full(after - row, level)], axis=1)
        level += float(size[row, 1])
        row = after
    return corner
