"""Placed charts grow and move until they are jammed: what a coarse grid left free becomes texels.

k charts · s outline segments · p pairs of segments that face each other.  All charts keep one common scale; distances
are those of the outlines themselves.  Each step is a linear program in the charts' shifts and the growth of the common
scale: to first order, the distance of two outlines changes by the motion along the line of their closest points
(compaction of nested polygons, Li and Milenkovic 1995).  The padding is restored exactly after each round (`padding`).
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array, vstack

from ...errors import FinishError
from ...geometry.gaps import closest_points, facing_segments
from .padding import Crowd, padded

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse import csr_array

    from ...pagesize import PageSize
    from ..config import GrowthConfig


def apply_placement(
    placement: NDArray[np.float64], face_chart: NDArray[np.int64], corner_uv: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Chart coordinates (f, 3, 2) → atlas uv (f, 3, 2) by placement (k, 2, 3); equal in, equal out, bit by bit."""
    matrix = placement[face_chart][:, None]
    x, y = corner_uv[..., 0], corner_uv[..., 1]
    return np.stack([matrix[..., i, 0] * x + matrix[..., i, 1] * y + matrix[..., i, 2] for i in (0, 1)], axis=-1)


def grown(
    placement: NDArray[np.float64],
    outlines: list[NDArray[np.float64]],
    page: PageSize,
    padding: int,
    config: GrowthConfig,
    *,
    slack: float = 2.0**-23,
) -> tuple[NDArray[np.float64], int]:
    """The placement (k, 2, 3) with charts shifted and grown as far as the padding allows; never turned or mirrored.

    Args:
        placement: (k, 2, 3) float64, chart coordinates → sides of the page, with the padding kept.
        outlines: per chart its outline segments (s, 2, 2) float64 in chart coordinates.
        page: texels.
        padding: texels.
        config: numbers.
        slack: what is kept free around each chart beyond the padding, sides of the page: rounding must not undercut it.

    Returns:
        The new placement, and how many of the linear programs had no solution (their step is left out).

    Raises:
        FinishError: the padding was not kept to begin with and cannot be restored.
    """
    chart = np.repeat(np.arange(len(outlines)), [len(outline) for outline in outlines])
    segments = apply_placement(placement, chart, np.concatenate(outlines))
    parts = np.split(segments, np.cumsum([len(outline) for outline in outlines])[:-1])
    box = np.array([(part.min(axis=(0, 1)), part.max(axis=(0, 1))) for part in parts])
    centre = box.mean(axis=1)
    border, apart = padding / page.side + slack, 2.0 * (padding / page.side + slack)
    fit = float(((page.extent - 2.0 * border) / np.maximum(np.ptp(box.reshape(-1, 2), axis=0), 1e-300)).min())
    fitted = border + fit * (centre - box.reshape(-1, 2).min(axis=0))
    crowd = Crowd(segments - centre[chart][:, None], chart, box[:, 1] - centre, fitted, fit, page.extent)
    crowd, skipped = jammed(padded(crowd, border, apart, config), border, apart, config)
    linear, shift = placement[:, :, :2] * crowd.factor, (placement[:, :, 2] - centre) * crowd.factor + crowd.centre
    return np.concatenate([linear, shift[:, :, None]], axis=2), skipped


def jammed(crowd: Crowd, border: float, apart: float, config: GrowthConfig) -> tuple[Crowd, int]:
    """The crowd after rounds of linear programs, each kept where charts really grew, and the programs left out."""
    k, skipped = len(crowd.centre), 0
    trust = config.trust / max(1.0, math.sqrt(k / config.crowd))
    for _ in range(config.rounds if k <= config.few else 0):
        pairs = facing_segments(crowd.segments(), crowd.chart, spacing=config.sample, reach=config.reach)
        moved = crowd
        for step in range(config.steps):
            found = _step(moved, pairs, border, apart, trust * config.calmer**step)
            moved, skipped = found or moved, skipped + (found is None)
        try:
            moved = padded(moved, border, apart, config)
        except FinishError:  # charts in each other's bays went through each other: this round is undone
            moved = replace(crowd, factor=0.0)
        trust *= config.calmer**config.steps if moved.factor > crowd.factor else config.smaller
        crowd = max(crowd, moved, key=lambda one: one.factor)
    return crowd, skipped


def _step(crowd: Crowd, pairs: NDArray[np.int64], border: float, apart: float, trust: float) -> Crowd | None:
    """One linear program: the largest growth of the factor, shifts and growth of a box within trust (uv units).

    None where it has no solution.  Two outlines come closer by 4·√2·trust at most, so pairs with more room than that
    are left out.
    """
    rows, room = _pair_rows(crowd, pairs, apart)
    near = room <= 6.0 * trust
    k = len(crowd.centre)
    walls, wall_room = _wall_rows(crowd, border)
    growth = trust / float(crowd.half.max())
    limits = [(-trust, trust)] * (2 * k) + [(-growth, growth)]
    objective = np.zeros(2 * k + 1)
    objective[-1] = -1.0
    found = linprog(
        objective, A_ub=vstack([rows[near], walls]), b_ub=np.concatenate([room[near], wall_room]), bounds=limits
    )
    if found.status != 0:
        return None
    return replace(crowd, centre=crowd.centre + found.x[:-1].reshape(k, 2), factor=crowd.factor + float(found.x[-1]))


def _pair_rows(crowd: Crowd, pairs: NDArray[np.int64], apart: float) -> tuple[csr_array, NDArray[np.float64]]:
    """Per pair of segments (p, 2): how much its distance shrinks with (x and y shifts, growth), and how much it may."""
    segments = crowd.segments()
    one, two = closest_points(segments[pairs[:, 0]], segments[pairs[:, 1]])
    distance = np.linalg.norm(two - one, axis=1)
    toward = (two - one) / np.maximum(distance, 1e-300)[:, None]
    first, second = crowd.chart[pairs].T
    spread = ((two - crowd.centre[second]) - (one - crowd.centre[first])) / crowd.factor
    number, last = np.arange(len(pairs)), 2 * len(crowd.centre)
    columns = [2 * first, 2 * first + 1, 2 * second, 2 * second + 1, np.full(len(pairs), last)]
    values = [toward[:, 0], toward[:, 1], -toward[:, 0], -toward[:, 1], -(toward * spread).sum(axis=1)]
    entries = (np.concatenate(values), (np.tile(number, 5), np.concatenate(columns)))
    return coo_array(entries, shape=(len(pairs), last + 1)).tocsr(), distance - apart


def _wall_rows(crowd: Crowd, border: float) -> tuple[csr_array, NDArray[np.float64]]:
    """The same for the four sides of the page: 4·k rows."""
    half, centre = crowd.half.reshape(-1), crowd.centre.reshape(-1)
    number, last = np.arange(len(half)), np.full(len(half), len(half))
    values = np.concatenate([np.ones(len(half)), -np.ones(len(half)), half, half])
    rows = np.concatenate([number, number + len(half), number, number + len(half)])
    columns = np.concatenate([number, number, last, last])
    far = np.tile(crowd.extent, len(crowd.centre))
    room = np.concatenate([far - border - centre - crowd.factor * half, centre - border - crowd.factor * half])
    return coo_array((values, (rows, columns))).tocsr(), room
