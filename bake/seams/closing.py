"""Seams closed: texels at the borders of charts moved so that both sides of a seam give one value.

s samples on seams · g texels that may move · c channels.  Bilinear filtering on a seam mixes texels inside the chart
with texels beside it.  Those beside it are extrapolated and free to choose; those inside are right, but for what rays
estimate, where each carries noise of its own.  The changes x minimise

    Σ (difference of the two sides of a sample)² + Σ weight · x²

within bounds: no texel may leave the range of its neighbours, which are the texels inside charts that share a sample
with it, on both sides of the seam.  So noise is shared out, never amplified.  What is measured, not looked at
(positions, vectors), may go on beyond that range by twice its width, since a slope continues beside the chart.
Solved by accelerated projected gradients (Beck and Teboulle 2009, FISTA, with the restart of O'Donoghue and Candès).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .seamcheck import SeamSamples


@dataclass(frozen=True)
class ClosingConfig:
    """What decides how seams are closed.

    visible: difference of the sides, as a share of a map's range, up to which a map stays as it is.
    beside, inside: weights of staying, of texels beside charts and of estimated ones inside, against 1 of a sample.
    reach: widths of the neighbours' range by which measured values may go beyond it.
    steps, accuracy: most steps of the solver, and the largest change, as a share of the map's range, that ends it.
    """

    visible: float = 0.5 / 255.0
    beside: float = 1e-3
    inside: float = 0.1
    reach: float = 2.0
    steps: int = 100
    accuracy: float = 1e-6


def closed_seams(
    pixels: NDArray[np.float32],
    samples: SeamSamples,
    inside: NDArray[np.bool_],
    config: ClosingConfig | None = None,
    *,
    estimated: bool = False,
    measured: bool = False,
) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
    """New values of the texels at seams.

    Args:
        pixels: (h, w, c), gutters filled.
        samples: of the seams in an image of that size.
        inside: (h, w) bool, the texels whose centres lie in a chart.
        config: weights and bounds.
        estimated: whether texels inside charts carry noise, so that they may move too.
        measured: whether values may go beyond their neighbours' range.

    Returns: flat texels (g,) and their values (g, c).
    """
    config = config or ClosingConfig()
    texel, column = np.unique(samples.texel, return_inverse=True)
    column = column.reshape(-1, 8).astype(np.int64)
    own = inside.reshape(-1)[texel]
    free = np.flatnonzero(np.ones(len(texel), np.bool_) if estimated else ~own)
    value = pixels.reshape(-1, pixels.shape[2])[texel].astype(np.float64)
    if len(free) == 0:
        return texel[free], value[free].astype(np.float32)
    low, high = neighbour_range(value, column, own)
    more = (config.reach if measured else 0.0) * (high - low)
    row = np.repeat(np.arange(len(column)), 8)
    entries = (samples.weight.reshape(-1), (row, column.reshape(-1)))
    matrix = sparse.csr_matrix(entries, shape=(len(column), len(texel)))
    moving = matrix[:, free].tocsr()
    system = moving.T @ moving + sparse.diags(np.where(own[free], config.inside, config.beside))
    bounds = (low - more - value)[free], (high + more - value)[free]
    change = bounded_least_squares(system.tocsr(), -(moving.T @ (matrix @ value)), bounds, config)
    return texel[free], (value[free] + change).astype(np.float32)


def neighbour_range(
    value: NDArray[np.float64], column: NDArray[np.int64], own: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Least and largest value (g, c) among the neighbours of each texel: those inside that share a sample with it.

    value: (g, c).  column: (s, 8) texels of each sample.  own: (g,) bool, which texels lie inside.  Where a sample has
    none inside (charts thinner than a texel), all its texels count.
    """
    held = own[column] | ~own[column].any(axis=1, keepdims=True)
    low, high = np.full_like(value, np.inf), np.full_like(value, -np.inf)
    least = np.where(held[..., None], value[column], np.inf).min(axis=1)
    most = np.where(held[..., None], value[column], -np.inf).max(axis=1)
    for corner in column.T:
        np.minimum.at(low, corner, least)
        np.maximum.at(high, corner, most)
    return low, high


def bounded_least_squares(
    system: sparse.csr_matrix,
    right: NDArray[np.float64],
    bounds: tuple[NDArray[np.float64], NDArray[np.float64]],
    config: ClosingConfig,
) -> NDArray[np.float64]:
    """X (g, c) within bounds (g, c) that minimises ½ x · system · x − right · x, for each column of right (g, c).

    system: symmetric, positive definite.  Variables are scaled so that its diagonal is 1.
    """
    scale = 1.0 / np.sqrt(np.asarray(system.diagonal(), np.float64))
    scaled = (sparse.diags(scale) @ system @ sparse.diags(scale)).tocsr()
    step = 1.0 / float(np.asarray(abs(scaled).sum(axis=1)).max())  # Gershgorin bounds the largest eigenvalue
    right, low, high = scale[:, None] * right, bounds[0] / scale[:, None], bounds[1] / scale[:, None]
    enough = config.accuracy * max(float(np.ptp(low)), float(np.ptp(high)), float(np.finfo(np.float64).tiny))
    x = np.clip(np.zeros_like(right), low, high)
    ahead, momentum = x, 1.0
    for _ in range(config.steps):
        following = np.clip(ahead - step * (scaled @ ahead - right), low, high)
        change = following - x
        if np.abs(change).max() <= enough:
            x = following
            break
        grown = (1.0 + np.sqrt(1.0 + 4.0 * momentum * momentum)) / 2.0
        if float(((ahead - following) * change).sum()) > 0.0:  # the momentum points uphill: start it anew
            ahead, momentum = following, 1.0
        else:
            ahead, momentum = following + (momentum - 1.0) / grown * change, grown
        x = following
    return np.clip(scale[:, None] * x, *bounds)
