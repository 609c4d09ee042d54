"""A gated network of affine experts: what is deployed.   n points · d inputs · m outputs · e experts · g gates.

The input space is divided coarse to fine: a grid of cells, and where one cell is not enough, gates: planes that send a
point to one of two sides.  At the end of the way stands one expert, an affine map.  This is a hierarchical mixture of
experts (Jordan & Jacobs 1994) with hard gates.  Like a network of ReLUs it is affine on each of many polytopes, but a
point visits its own few gates and one expert only, and all weights are solved for (grow.py).

Codes: an int32 below g names a gate, g + i names expert i.  All arithmetic is float32, as onnxruntime has it: this is
the truth that an exported graph is compared with.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.brief import Brief

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Answer(NamedTuple):
    """What the network says at n points: value (n, m) float32, label (n,) int64, score (n,) float32 in [0, 1]."""

    value: NDArray[np.float32]
    label: NDArray[np.int64]
    score: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Grid:
    """Cells that cover the inputs.

    low (d,), cell (d,) float32: the corner, and the sides of a cell.  shape (d,) int64: cells along each axis; the last
    axis runs fastest; fewer than 2²⁴ in all, so that float32 can number them.
    """

    low: NDArray[np.float32]
    cell: NDArray[np.float32]
    shape: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of cells."""
        return int(self.shape.prod())

    @property
    def strides(self) -> NDArray[np.float32]:
        """(d,) what a step along each axis adds to a cell's number."""
        return np.append(np.cumprod(self.shape[:0:-1])[::-1], 1).astype(np.float32)

    def margin(self, x: NDArray[np.float32]) -> NDArray[np.float32]:
        """(n,) distance of points (n, d) from the nearest side between two cells."""
        place = (x - self.low) / self.cell
        inside = (place > 0.5) & (place < self.shape.astype(np.float32) - 0.5)
        away = np.where(inside, np.abs(place - np.round(place)) * self.cell, np.float32(np.inf))
        return away.min(axis=1)

    def number(self, x: NDArray[np.float32]) -> NDArray[np.int64]:
        """The cell (n,) of points (n, d): the nearest one for points outside."""
        place = np.clip(np.floor((x - self.low) / self.cell), np.float32(0.0), (self.shape - 1).astype(np.float32))
        return (place @ self.strides).astype(np.int64)


@dataclass(frozen=True, eq=False, repr=False)
class GatedExperts(Brief):
    """The network.

    grid: its cells; start (cells,) int32: the code each cell begins with.
    gates (g, d + 1) float32: a point goes to the second side where gate · (x, 1) > 0.  sides (g, 2) int32: codes.
    depth: the most gates on any way.
    weights (e, m, d + 1) float32: value = weights · (x, 1).  label (e,) int64: what an expert stands for, its chart.
    centre (e, d), radius (e,) float32: a ball around the samples that an expert was fitted to.
    share (e,) float32: of the samples that come to an expert, the share that has its label.
    """

    grid: Grid
    start: NDArray[np.int32]
    gates: NDArray[np.float32]
    sides: NDArray[np.int32]
    depth: int
    weights: NDArray[np.float32]
    label: NDArray[np.int64]
    centre: NDArray[np.float32]
    radius: NDArray[np.float32]
    share: NDArray[np.float32]

    def route(self, x: NDArray[np.float32]) -> tuple[NDArray[np.int64], NDArray[np.float32]]:
        """The expert (n,) that answers for points (n, d), and their least distance (n,) from a gate on the way."""
        code, count = self.start[self.grid.number(x)], len(self.gates)
        margin = np.full(len(x), np.inf, dtype=np.float32)
        for _ in range(self.depth):
            rows = np.flatnonzero(code < count)
            plane = self.gates[code[rows]]
            away = (x[rows] * plane[:, :-1]).sum(axis=1) + plane[:, -1]
            margin[rows] = np.minimum(margin[rows], np.abs(away))
            code[rows] = self.sides[code[rows], (away > 0.0).astype(np.int64)]
        return code.astype(np.int64) - count, margin

    def __call__(self, x: NDArray[np.float32]) -> Answer:
        """The answer at points (n, d) float32."""
        return self.answer(x, self.route(x)[0])

    def answer(self, x: NDArray[np.float32], expert: NDArray[np.int64]) -> Answer:
        """What the experts (n,) say at points (n, d).

        score: the expert's share; outside its ball times (radius / distance)².
        """
        weights = self.weights[expert]
        value = (weights[:, :, :-1] * x[:, None, :]).sum(axis=2) + weights[:, :, -1]
        away = ((x - self.centre[expert]) ** 2).sum(axis=1)
        reach = self.radius[expert] ** 2
        score = self.share[expert] * (reach / np.maximum(away, reach))
        return Answer(value, self.label[expert], score.astype(np.float32))
