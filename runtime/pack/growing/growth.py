"""Placed charts grow, move and turn until they are jammed: what a coarse grid left free becomes texels.

k charts · s outline segments · p pairs of segments that face each other.  All charts keep one common scale; distances
are those of the outlines themselves.  Each step is a linear program in the charts' shifts and turns and the growth of
the common scale: to first order, the distance of two outlines changes by the motion along the line of their closest
points (compaction of nested polygons, Li and Milenkovic 1995).  The padding is restored exactly after each round
(`padding`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.optimize import linprog
from scipy.sparse import coo_array, vstack

from ...errors import FinishError
from ...geometry.gaps import closest_points, facing_segments
from .outlines import hull_corners, rotation
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
    turning: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.float64], int]:
    """The placement (k, 2, 3) with charts shifted, turned and grown as far as the padding allows; never mirrored.

    Args:
        placement: (k, 2, 3) float64, chart coordinates → sides of the page, with the padding kept.
        outlines: per chart its outline segments (s, 2, 2) float64 in chart coordinates.
        page: texels.
        padding: texels.
        config: numbers.
        slack: what is kept free around each chart beyond the padding, sides of the page: rounding must not undercut it.
        turning: (k,) bool, charts that may be turned; None: none.

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
    turning = np.zeros(len(outlines), dtype=bool) if turning is None else turning
    crowd, angle, skipped = jammed(padded(crowd, border, apart, config), turning, border, apart, config)
    turn = np.array([rotation(one) for one in angle.tolist()])
    linear = turn @ placement[:, :, :2] * crowd.factor
    first = np.searchsorted(chart, np.arange(len(outlines)))
    at = np.concatenate(outlines)[first, 0]
    shift = crowd.segments()[first, 0] - (linear @ at[:, :, None])[:, :, 0]
    return np.concatenate([linear, shift[:, :, None]], axis=2), skipped


def jammed(
    crowd: Crowd, turning: NDArray[np.bool_], border: float, apart: float, config: GrowthConfig
) -> tuple[Crowd, NDArray[np.float64], int]:
    """The crowd after rounds of linear programs, each kept where charts really grew; else the next one turns none.

    Also by how much charts (k,) were turned, and how many programs had no solution.
    """
    k, skipped = len(crowd.centre), 0
    trust = config.trust / max(1.0, math.sqrt(k / config.crowd))
    corners = _corners(crowd)
    angle, turn = np.zeros(k), config.turn
    for _ in range(config.rounds if k <= config.few else 0):
        pairs = facing_segments(crowd.segments(), crowd.chart, spacing=config.sample, reach=config.reach)
        facing = _Facing(pairs, corners, np.where(turning, turn, 0.0))
        moved, turned = crowd, angle
        for step in range(config.steps):
            found = _step(moved, facing, border, apart, trust * config.calmer**step)
            if found is None:
                skipped += 1
            else:
                moved, turned = found[0], turned + found[1]
        try:
            moved = padded(moved, border, apart, config)
        except FinishError:  # charts in each other's bays went through each other: this round is undone
            moved = replace(crowd, factor=0.0)
        if moved.factor > crowd.factor:
            crowd, angle, trust, turn = moved, turned, trust * config.calmer**config.steps, config.turn
        elif turn > 0.0 and turning.any():
            turn = 0.0
        else:
            trust, turn = trust * config.smaller, config.turn
    return crowd, angle, skipped


class _Facing(NamedTuple):
    """What may come to touch: pairs (p, 2) of segments, corners (c,) of charts' hulls.

    turning: (k,) by how much charts may turn in a step, radians.
    """

    pairs: NDArray[np.int64]
    corners: NDArray[np.int64]
    turning: NDArray[np.float64]


def _corners(crowd: Crowd) -> NDArray[np.int64]:
    """(c,) which of the ends of segments, in their order, are corners of the convex hulls of charts."""
    points, owner = crowd.local.reshape(-1, 2), np.repeat(crowd.chart, 2)
    first = np.searchsorted(owner, np.arange(len(crowd.centre) + 1))
    return np.concatenate([a + hull_corners(points[a:b]) for a, b in itertools.pairwise(first.tolist())])


def _step(
    crowd: Crowd, facing: _Facing, border: float, apart: float, trust: float
) -> tuple[Crowd, NDArray[np.float64]] | None:
    """One linear program: the largest growth of the factor, shifts, turns and growth of a box within trust (uv units).

    The crowd and the turns (k,); None where there is no solution.  Two outlines come closer by (4·√2 + 2)·trust at
    most, so pairs with more room than that are left out.  A turn counts by how far it moves a corner of the box.
    """
    radius = crowd.factor * np.linalg.norm(crowd.half, axis=1)
    rows, room = _pair_rows(crowd, facing.pairs, radius, apart)
    near = room <= 8.0 * trust
    k = len(crowd.centre)
    walls, wall_room = _wall_rows(crowd, facing.corners, radius, border)
    close = wall_room <= 4.0 * trust
    growth = trust / float(crowd.half.max())
    turns = np.minimum(trust, facing.turning * radius)
    limits = [(-trust, trust)] * (2 * k) + [(-turn, turn) for turn in turns.tolist()] + [(-growth, growth)]
    objective = np.zeros(3 * k + 1)
    objective[-1] = -1.0
    found = linprog(
        objective,
        A_ub=vstack([rows[near], walls[close]]),
        b_ub=np.concatenate([room[near], wall_room[close]]),
        bounds=limits,
    )
    if found.status != 0:
        return None
    angle = found.x[2 * k : 3 * k] / np.maximum(radius, 1e-300)
    moved = replace(crowd, centre=crowd.centre + found.x[: 2 * k].reshape(k, 2))
    return replace(moved, factor=crowd.factor + float(found.x[-1])).turned(angle), angle


def _pair_rows(
    crowd: Crowd, pairs: NDArray[np.int64], radius: NDArray[np.float64], apart: float
) -> tuple[csr_array, NDArray[np.float64]]:
    """Per pair of segments (p, 2): how much its distance shrinks, and how much it may.

    Columns: x and y shifts of each chart, turns · radius of each, growth.
    """
    segments = crowd.segments()
    one, two = closest_points(segments[pairs[:, 0]], segments[pairs[:, 1]])
    distance = np.linalg.norm(two - one, axis=1)
    toward = (two - one) / np.maximum(distance, 1e-300)[:, None]
    first, second = crowd.chart[pairs].T
    arm, other = one - crowd.centre[first], two - crowd.centre[second]
    growth = -(toward * (other - arm)).sum(axis=1) / crowd.factor
    swing, against = (
        _across(part, toward) / np.maximum(radius[of], 1e-300) for part, of in ((arm, first), (other, second))
    )
    number, k = np.arange(len(pairs)), len(crowd.centre)
    columns = [2 * first, 2 * first + 1, 2 * second, 2 * second + 1, 2 * k + first, 2 * k + second]
    values = [toward[:, 0], toward[:, 1], -toward[:, 0], -toward[:, 1], swing, -against]
    columns, values = [*columns, np.full(len(pairs), 3 * k)], [*values, growth]
    entries = (np.concatenate(values), (np.tile(number, 7), np.concatenate(columns)))
    return coo_array(entries, shape=(len(pairs), 3 * k + 1)).tocsr(), distance - apart


def _across(arm: NDArray[np.float64], way: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n,) how fast the ends of arms (n, 2) go that way (n, 2) when they turn counter-clockwise."""
    return arm[:, 0] * way[:, 1] - arm[:, 1] * way[:, 0]


def _wall_rows(
    crowd: Crowd, corners: NDArray[np.int64], radius: NDArray[np.float64], border: float
) -> tuple[csr_array, NDArray[np.float64]]:
    """The same for the four sides of the page: 4·c rows."""
    local, chart = crowd.local.reshape(-1, 2)[corners], crowd.chart[corners // 2]
    arm, k, count = crowd.factor * local, len(crowd.centre), len(corners)
    place, reach = crowd.centre[chart] + arm, np.maximum(radius[chart], 1e-300)
    entries, room = [], []
    for side, (axis, sign) in enumerate(((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0))):
        way = np.zeros((count, 2))
        way[:, axis] = sign
        columns = [2 * chart + axis, 2 * k + chart, np.full(count, 3 * k)]
        values = [way[:, axis], _across(arm, way) / reach, sign * local[:, axis]]
        rows = np.tile(np.arange(count) + side * count, 3)
        entries.append((np.concatenate(values), rows, np.concatenate(columns)))
        end = crowd.extent[axis] if sign > 0.0 else 0.0
        room.append(sign * (end - place[:, axis]) - border)
    value, row, column = (np.concatenate(part) for part in zip(*entries, strict=True))
    return coo_array((value, (row, column)), shape=(4 * count, 3 * k + 1)).tocsr(), np.concatenate(room)
