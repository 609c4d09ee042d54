"""Experts: affine maps fitted to the samples of nodes, all nodes at once, in closed form.

n samples · d inputs · m outputs · k nodes.   float64.  Samples come node by node.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .sums import node_sums

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Lesson(NamedTuple):
    """What is learned.

    x (n, d), y (n, m): inputs and outputs.  label (n,) int64.  slope (n, m, d): how y changes with x along the surface.
    plane (n, d + 1): a gate that parts the samples around this one, NaN where none is known.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    label: NDArray[np.int64]
    slope: NDArray[np.float64]
    plane: NDArray[np.float64]

    def among(self, rows: NDArray[np.int64]) -> Lesson:
        """Those samples, in that order."""
        return Lesson(self.x[rows], self.y[rows], self.label[rows], self.slope[rows], self.plane[rows])


class Fitted(NamedTuple):
    """Affine maps of nodes: y = mean_y + slope · (x − mean_x).  mean_x (k, d), mean_y (k, m), slope (k, m, d)."""

    mean_x: NDArray[np.float64]
    mean_y: NDArray[np.float64]
    slope: NDArray[np.float64]


def fit_affine(lesson: Lesson, first: NDArray[np.int64], ridge: float) -> Fitted:
    """Ridge regressions of y on x, one a node; ``lesson`` comes node by node, first (k,): where each begins."""
    count = np.diff(first, append=len(lesson.x))
    owner = np.repeat(np.arange(len(first)), count)
    mean_x, mean_y = (node_sums(part, first) / count[:, None] for part in (lesson.x, lesson.y))
    x, y = lesson.x - mean_x[owner], lesson.y - mean_y[owner]
    gram = node_sums(x[:, :, None] * x[:, None, :], first)
    cross = node_sums(x[:, :, None] * y[:, None, :], first)
    prior = node_sums(lesson.slope, first) / count[:, None, None]
    pull = ridge * np.trace(gram, axis1=1, axis2=2) / x.shape[1] + np.finfo(np.float64).tiny
    pull = pull[:, None, None]
    slope = np.linalg.solve(gram + pull * np.eye(x.shape[1]), cross + pull * prior.transpose(0, 2, 1))
    return Fitted(mean_x, mean_y, slope.transpose(0, 2, 1))


def untorn(own: Lesson, first: NDArray[np.int64], fitted: Fitted, limit: float, steepest: float) -> Fitted:
    """The maps of nodes; where one misses its samples by more than ``limit`` (rms), that of a middle sample.

    Such a node holds both sides of a slit: the map between them would be right on neither.  If it has few samples, it
    shows by a map that is ``steepest`` times as steep as the surface is anywhere.
    """
    count = np.diff(first, append=len(own.x))
    owner = np.repeat(np.arange(len(first)), count)
    ahead = np.einsum("nmd,nd->nm", fitted.slope[owner], own.x - fitted.mean_x[owner])
    off = ((own.y - fitted.mean_y[owner] - ahead) ** 2).sum(axis=1)
    mean_x, mean_y, slope = (part.copy() for part in fitted)
    steep = np.maximum.reduceat(np.abs(own.slope).max(axis=(1, 2)), first)
    torn = (np.abs(slope).max(axis=(1, 2)) > steepest * steep) & (steep > 0.0)
    for node in np.flatnonzero((np.add.reduceat(off, first) > limit**2 * count) | torn):
        rows = slice(first[node], first[node] + count[node])
        middle = np.median(own.y[rows], axis=0)
        best = first[node] + int(np.linalg.norm(own.y[rows] - middle, axis=1).argmin())
        mean_x[node], mean_y[node], slope[node] = own.x[best], own.y[best], own.slope[best]
    return Fitted(mean_x, mean_y, slope)
