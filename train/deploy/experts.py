"""Experts: affine maps fitted to the samples of nodes, all nodes at once, in closed form.

n samples · d inputs · m outputs · k nodes.   float64.  Samples come node by node.
"""

from __future__ import annotations

from functools import reduce
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .sums import as_matrices, node_sums, products, squares, twice

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
        x, y, slope, plane = (np.take(part, rows, axis=0) for part in (self.x, self.y, self.slope, self.plane))
        return Lesson(x, y, np.take(self.label, rows), slope, plane)  # a quarter of the time of x[rows]


class Fitted(NamedTuple):
    """Affine maps of nodes: y = mean_y + slope · (x − mean_x).  mean_x (k, d), mean_y (k, m), slope (k, m, d)."""

    mean_x: NDArray[np.float64]
    mean_y: NDArray[np.float64]
    slope: NDArray[np.float64]


def fit_affine(lesson: Lesson, first: NDArray[np.int64], ridge: float) -> Fitted:
    """Ridge regressions of y on x, one a node; ``lesson`` comes node by node, first (k,): where each begins."""
    count = np.diff(first, append=len(lesson.x))
    mean_x, mean_y = (node_sums(part, first) / count[:, None] for part in (lesson.x, lesson.y))
    x, y = lesson.x - np.repeat(mean_x, count, axis=0), lesson.y - np.repeat(mean_y, count, axis=0)
    d, m = x.shape[1], y.shape[1]
    gram = as_matrices(node_sums(products(x, x, twice(d)), first), d)
    cross = node_sums(products(x, y, list(np.ndindex(d, m))), first).reshape(-1, d, m)
    prior = node_sums(lesson.slope, first) / count[:, None, None]
    pull = ridge * np.trace(gram, axis1=1, axis2=2) / x.shape[1] + np.finfo(np.float64).tiny
    pull = pull[:, None, None]
    slope = np.linalg.solve(gram + pull * np.eye(x.shape[1]), cross + pull * prior.transpose(0, 2, 1))
    return Fitted(mean_x, mean_y, slope.transpose(0, 2, 1))


def misses(own: Lesson, first: NDArray[np.int64], fitted: Fitted) -> NDArray[np.float64]:
    """(n, m) by how much the map of its node misses each sample."""
    count = np.diff(first, append=len(own.x))
    slope, mean_x, mean_y = (np.repeat(part, count, axis=0) for part in (fitted.slope, fitted.mean_x, fitted.mean_y))
    return own.y - mean_y - np.einsum("nmd,nd->nm", slope, own.x - mean_x)


def untorn(own: Lesson, first: NDArray[np.int64], fitted: Fitted, limit: float, steepest: float) -> Fitted:
    """The maps of nodes; where one misses its samples by more than ``limit`` (rms), that of a middle sample.

    Such a node holds both sides of a slit: the map between them would be right on neither.  If it has few samples, it
    shows by a map that is ``steepest`` times as steep as the surface is anywhere.
    """
    count = np.diff(first, append=len(own.x))
    off = squares(misses(own, first, fitted))
    mean_x, mean_y, slope = (part.copy() for part in fitted)
    steepness = reduce(np.maximum, np.abs(own.slope).reshape(len(own.x), -1).T)
    steep = np.maximum.reduceat(steepness, first)
    torn = (np.abs(slope).max(axis=(1, 2)) > steepest * steep) & (steep > 0.0)
    for node in np.flatnonzero((np.add.reduceat(off, first) > limit**2 * count) | torn):
        rows = slice(first[node], first[node] + count[node])
        middle = np.median(own.y[rows], axis=0)
        best = first[node] + int(np.linalg.norm(own.y[rows] - middle, axis=1).argmin())
        mean_x[node], mean_y[node], slope[node] = own.x[best], own.y[best], own.slope[best]
    return Fitted(mean_x, mean_y, slope)
