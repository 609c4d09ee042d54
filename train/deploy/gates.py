"""Gates that may halve a node, and the best of them.   n samples · d inputs · m outputs · k nodes.   float64.

A gate is a plane (normal, offset), (d + 1,): a point is on its second side where normal · x + offset > 0.  The best
gate leaves the least squared error behind when each of its sides gets an affine map of its own.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .sums import as_matrices, node_sums, products, twice

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray


TINY = 1e-100
"""Keeps what would be 0 / 0 at 0: far below any square of a length, far above what overflows."""


class Spread(NamedTuple):
    """Samples about the means of their nodes.

    x (n, d), y (n, m): minus the mean of the node.  plane (n, d + 1): a gate that parts the samples around this one, in
    the inputs' own coordinates; NaN where none is known.  first (k,): where the rows of each node begin.
    mean (k, d): of x.  inputs (n, d): x as given, by which samples are parted; x plus the mean would be rounded anew.
    """

    x: NDArray[np.float64]
    y: NDArray[np.float64]
    plane: NDArray[np.float64]
    first: NDArray[np.int64]
    mean: NDArray[np.float64]
    inputs: NDArray[np.float64]

    def each(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n, …) for each row the value (k, …) of its node."""
        return np.repeat(values, np.diff(self.first, append=len(self.x)), axis=0)

    def total(self, part: NDArray[np.float64]) -> NDArray[np.float64]:
        """Sums over the rows of each node, (k, …)."""
        return node_sums(part, self.first)

    def gram(self, part: NDArray[np.float64]) -> NDArray[np.float64]:
        """(k, d, d) sums of part partᵀ over the rows (n, d) of each node."""
        d = part.shape[1]
        return as_matrices(self.total(products(part, part, twice(d))), d)


class Chosen(NamedTuple):
    """The best gate of each node.

    plane (k, d + 1), of float32 values.  left (k,): the squared error it leaves; inf where no gate leaves samples on
    both sides.  before (k,): the squared error of the node's own affine map.  known (k,) bool: the plane of a seam.
    """

    plane: NDArray[np.float64]
    left: NDArray[np.float64]
    before: NDArray[np.float64]
    known: NDArray[np.bool_]


def principal_gates(spread: Spread) -> NDArray[np.float64]:
    """(k, d + 1) across the direction in which the samples extend most, through their mean."""
    return _through_mean(_first_axis(spread.gram(spread.x)), spread)


def fisher_gates(spread: Spread) -> NDArray[np.float64]:
    """(k, d + 1) Fisher's discriminant between the samples whose outputs lie above and below the mean output.

    Above and below: along the direction in which outputs vary most.  Outputs of two charts, or of the two sides of a
    slit, lie far apart: the gate is then the plane between two sheets, or one along the seam.
    """
    axis = _first_axis(spread.gram(spread.y))
    above = np.einsum("nm,nm->n", spread.y, spread.each(axis)) > 0.0
    means = []
    for side in (above, ~above):
        count = np.maximum(spread.total(side.astype(np.float64)), 1.0)
        means.append(spread.total(spread.x * side[:, None]) / count[:, None])
    rest = spread.x - np.where(above[:, None], spread.each(means[0]), spread.each(means[1]))
    within = spread.gram(rest)
    dims = spread.x.shape[1]
    floor = 1e-9 * spread.total(np.einsum("nd,nd->n", spread.x, spread.x)) + TINY
    normal = np.linalg.solve(within + floor[:, None, None] * np.eye(dims), (means[0] - means[1])[:, :, None])[:, :, 0]
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), TINY)
    middle = spread.mean + (means[0] + means[1]) / 2.0
    return np.concatenate([normal, -np.einsum("kd,kd->k", normal, middle)[:, None]], axis=1)


def known_gates(spread: Spread, picks: int, rng: np.random.Generator) -> Iterator[NDArray[np.float64]]:
    """``picks`` times: (k, d + 1) the plane of one random sample of each node, NaN where no sample has one."""
    has = np.flatnonzero(np.isfinite(spread.plane[:, 0]))
    begin = np.searchsorted(has, spread.first)
    count = np.diff(begin, append=len(has))
    for _ in range(picks if len(has) else 0):
        pick = has[np.minimum(begin + (rng.random(len(count)) * count).astype(np.int64), len(has) - 1)]
        yield np.where(count[:, None] > 0, spread.plane[pick], np.nan)


def best_gates(spread: Spread, picks: int, ridge: float, rng: np.random.Generator) -> Chosen:
    """The best among the principal gate, Fisher's, and ``picks`` known ones.

    ridge: of the affine maps on either side, as a share of the node's squared extent.  It keeps a few samples from
    being explained by a map that bends away from the surface.
    """
    features = _features(spread)
    total = spread.total(features)
    pull = ridge * spread.total(np.einsum("nd,nd->n", spread.x, spread.x)) + TINY
    before = _squared_error(total, spread, pull)
    made = [principal_gates(spread), fisher_gates(spread)]
    best = Chosen(np.zeros_like(made[0]), np.full(len(before), np.inf), before, np.zeros(len(before), dtype=bool))
    for i, exact in enumerate((*made, *known_gates(spread, picks, rng))):
        plane = exact.astype(np.float32).astype(np.float64)
        left = _error_left(plane, features, (total, pull), spread)
        better = left < best.left
        best = Chosen(
            np.where(better[:, None], plane, best.plane),
            np.where(better, left, best.left),
            before,
            np.where(better, i >= len(made), best.known),
        )
    return best


def second_side(plane: NDArray[np.float64], x: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) True where points (n, d) are on the second side of their planes (n, d + 1)."""
    return np.einsum("nd,nd->n", x, plane[:, :-1]) + plane[:, -1] > 0.0


def _error_left(
    plane: NDArray[np.float64],
    features: NDArray[np.float64],
    whole: tuple[NDArray[np.float64], NDArray[np.float64]],
    spread: Spread,
) -> NDArray[np.float64]:
    """(k,) squared error behind gates (k, d + 1); inf where a side is empty or the gate is NaN.

    features: of each sample.  whole: sums of them over each node, and its ridge.
    """
    total, pull = whole
    known = np.flatnonzero(np.isfinite(plane[:, 0]))
    left = np.full(len(plane), np.inf)
    if len(known) == 0:
        return left
    second = second_side(spread.each(plane), spread.inputs)
    sums = node_sums(features, spread.first, np.flatnonzero(second))[known]
    rest = total[known] - sums
    error = _squared_error(sums, spread, pull[known]) + _squared_error(rest, spread, pull[known])
    left[known] = np.where((sums[:, 0] > 0.5) & (rest[:, 0] > 0.5), error, np.inf)
    return left


def _features(spread: Spread) -> NDArray[np.float64]:
    """(n, ·) what the squared error of an affine map is made of: 1, x, y, y · y, x yᵀ, x xᵀ; sums add up."""
    x, y, (d, m) = spread.x, spread.y, (spread.x.shape[1], spread.y.shape[1])
    crossed, doubled = list(np.ndindex(d, m)), twice(d)
    found = np.ones((len(x), 2 + d + m + len(crossed) + len(doubled)))
    _, here, there, square, cross, gram = np.split(found, np.cumsum([1, d, m, 1, len(crossed)]), axis=1)
    here[:], there[:], square[:, 0] = x, y, np.einsum("nm,nm->n", y, y)
    products(x, y, crossed, cross)
    products(x, x, doubled, gram)
    return found


def _squared_error(sums: NDArray[np.float64], spread: Spread, pull: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k,) squared error of the best affine map with ridges ``pull`` (k,), from sums (k, ·) of features."""
    d, m = spread.x.shape[1], spread.y.shape[1]
    count, x, y, square, cross, gram = np.split(sums, np.cumsum([1, d, m, 1, d * m]), axis=1)
    count = np.maximum(count, 1.0)
    gram = as_matrices(gram, d) - x[:, :, None] * x[:, None, :] / count[:, :, None]
    cross = cross.reshape(-1, d, m) - x[:, :, None] * y[:, None, :] / count[:, :, None]
    slope = np.linalg.solve(gram + pull[:, None, None] * np.eye(d), cross)
    error = square[:, 0] - np.einsum("km,km->k", y, y) / count[:, 0] - np.einsum("kdm,kdm->k", slope, cross)
    return np.maximum(error, 0.0)


def _first_axis(gram: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, d) the eigenvector of the largest eigenvalue of symmetric matrices (k, d, d)."""
    return np.linalg.eigh(gram)[1][:, :, -1]


def _through_mean(normal: NDArray[np.float64], spread: Spread) -> NDArray[np.float64]:
    """(k, d + 1) planes of these normals (k, d) through the nodes' means."""
    return np.concatenate([normal, -np.einsum("kd,kd->k", normal, spread.mean)[:, None]], axis=1)
