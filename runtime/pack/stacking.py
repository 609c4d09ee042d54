"""Congruent charts: which charts have the shape of another, and the motion that lays them on it.

k charts · s outline segments.  Two charts are congruent where a rotation and a shift, and a reflection where that is
allowed, bring the outline of one so near to that of the other that no point of either is farther away than a tolerance.
How they are triangulated doesn't matter.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ..geometry.triangles import signed_areas
from .growing.outlines import rotation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Charts
    from .config import StackConfig

MIRROR = np.diag([-1.0, 1.0])


@dataclass(frozen=True, eq=False)
class Stacks:
    """Which charts lie on which.

    on: (k,) int64, the first chart of the shape of each.  motion: (k, 2, 3), from the coordinates of each to its.
    """

    on: NDArray[np.int64]
    motion: NDArray[np.float64]

    @property
    def layer(self) -> NDArray[np.int64]:
        """(k,) int64: how many of its stack lie beneath each chart; two of a layer never overlap."""
        order = np.argsort(self.on, kind="stable")
        first = np.searchsorted(self.on[order], self.on[order], side="left")
        layer = np.zeros(len(self.on), dtype=np.int64)
        layer[order] = np.arange(len(order)) - first
        return layer


@dataclass(frozen=True, eq=False)
class _Shape:
    """An outline (s, 2, 2) about its chart's centre; spacing: of the points that stand for it.

    facts: (4,) lengths that congruent charts share: √area, the root mean square distances of its area's points along
    its two axes, the distance of the farthest point.
    """

    centre: NDArray[np.float64]
    outline: NDArray[np.float64]
    facts: NDArray[np.float64]
    spacing: float

    @cached_property
    def points(self) -> NDArray[np.float64]:
        """(n, 2) ends and middles of its segments."""
        return np.concatenate([self.outline.reshape(-1, 2), self.outline.mean(axis=1)])

    @cached_property
    def dense(self) -> KDTree:
        """Points all along it."""
        start, end = self.outline.transpose(1, 0, 2)
        count = np.ceil(np.linalg.norm(end - start, axis=1) / self.spacing).astype(np.int64) + 1
        owner = np.repeat(np.arange(len(start)), count)
        share = (np.arange(len(owner)) - np.repeat(np.cumsum(count) - count, count)) / count[owner]
        return KDTree(start[owner] + share[:, None] * (end - start)[owner])

    @property
    def radius(self) -> float:
        """From the centre to the farthest point."""
        return float(self.facts[3])


def find_stacks(
    charts: Charts, outlines: list[NDArray[np.float64]], config: StackConfig, *, mirrored: bool = False
) -> Stacks:
    """The stacks of charts with these outlines (s, 2, 2).  mirrored: whether mirror images count as congruent."""
    shapes = _shapes(charts, outlines, config)
    on, motion = np.arange(len(shapes)), np.zeros((len(shapes), 2, 3))
    first: list[int] = []
    for number, shape in enumerate(shapes):
        motion[number] = np.eye(2, 3)
        facts = np.array([shapes[other].facts for other in first]).reshape(-1, 4)
        near = np.abs(facts - shape.facts).max(axis=1) <= 2.0 * config.tolerance * shape.radius
        for other in np.array(first, dtype=np.int64)[near].tolist():
            found = _aligned(shape, shapes[other], config.tolerance, mirrored)
            if found is not None:
                on[number], motion[number] = other, found
                break
        else:
            first.append(number)
    return Stacks(on, motion)


def _shapes(charts: Charts, outlines: list[NDArray[np.float64]], config: StackConfig) -> list[_Shape]:
    area, k = np.abs(signed_areas(charts.corner_uv)), len(outlines)
    whole = np.maximum(np.bincount(charts.face_chart, area, minlength=k), np.finfo(np.float64).tiny)

    def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.stack([np.bincount(charts.face_chart, area * value, minlength=k) / whole for value in values.T], 1)

    centre = mean(charts.corner_uv.mean(axis=1))
    corner = charts.corner_uv - centre[charts.face_chart][:, None]
    both = np.concatenate([corner, corner.sum(axis=1, keepdims=True)], axis=1)  # ∫ x y over a triangle, exactly
    moment = np.stack([(both[..., i] * both[..., j]).sum(axis=1) / 12.0 for i, j in ((0, 0), (1, 1), (0, 1))], axis=1)
    xx, yy, xy = mean(moment).T
    half, apart = (xx + yy) / 2.0, np.hypot((xx - yy) / 2.0, xy)
    axes = np.sqrt(np.maximum([half + apart, half - apart], 0.0))
    return [
        _shape(outline - centre[number], centre[number], np.array([np.sqrt(whole[number]), *axes[:, number]]), config)
        for number, outline in enumerate(outlines)
    ]


def _shape(
    outline: NDArray[np.float64], centre: NDArray[np.float64], facts: NDArray[np.float64], config: StackConfig
) -> _Shape:
    radius = float(np.linalg.norm(outline, axis=2).max())
    spacing = max(config.tolerance * radius, np.finfo(np.float64).tiny)
    return _Shape(centre, outline, np.append(facts, radius), spacing)


def _aligned(shape: _Shape, other: _Shape, tolerance: float, mirrored: bool) -> NDArray[np.float64] | None:
    """The motion (2, 3) that lays a shape on another, None where none does: a farthest point goes to each in turn."""
    allowed = tolerance * shape.radius
    far = other.points[np.linalg.norm(other.points, axis=1) >= other.radius - 2.0 * allowed]
    angles = np.arctan2(far[:, 1], far[:, 0])
    for flip in (np.eye(2), MIRROR)[: 2 if mirrored else 1]:
        own = shape.points @ flip.T
        x, y = own[int(np.argmax(np.linalg.norm(own, axis=1)))]
        for angle in (angles - np.arctan2(y, x)).tolist():
            linear = rotation(angle) @ flip
            there = other.dense.query(shape.points @ linear.T, distance_upper_bound=allowed)[0]
            if not np.isfinite(there).all():
                continue
            back = shape.dense.query(other.points @ linear, distance_upper_bound=allowed)[0]
            if np.isfinite(back).all():
                return np.column_stack([linear, other.centre - linear @ shape.centre])
    return None
