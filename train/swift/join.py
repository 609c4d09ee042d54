"""Valid charts joined to those beside them, many at once, where the border between them costs more than the stretch.

In one round each chart is the centre of a star, or one of the leaves that join one, or takes no part.  All stars are
laid flat together.  A leaf that folds, or lies over others, stays what it was; so do all of a star that does not pay.
f faces · k charts.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

import numpy as np

from ..search.labels import contracted

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .sheet import Batch, Sheet


class Joining:
    """Rounds of joining the charts of a sheet; tried: pairs of charts that were refused."""

    def __init__(self, sheet: Sheet) -> None:
        self.sheet = sheet
        self.config = sheet.config.swift
        self.price = sheet.config.slit.price * np.sqrt(sheet.total)
        """Of a length, in the unit of energies."""
        self.refused: set[tuple[int, int]] = set()
        self.room: dict[int, int] = {}
        """Leaves that a chart takes at once, where that is fewer than usual."""

    def run(self, left: Callable[[], float]) -> None:
        """Rounds until one hardly pays, or until the next would take longer than is ``left``."""
        pace = self.config.pace * len(self.sheet.chart)
        for _ in range(self.config.joins):
            before, start = self.objective(), time.monotonic()
            leaf, centre, border = self.stars()
            if len(leaf) == 0 or left() < pace:
                return
            self.round(leaf, centre, border)
            pace = time.monotonic() - start
            if before - self.objective() < self.config.worth * before:
                return

    def objective(self) -> float:
        """Stretch and seams of the sheet, in the unit of energies."""
        chart, graph = self.sheet.chart, self.sheet.graph
        seam = chart[graph.pairs[:, 0]] != chart[graph.pairs[:, 1]]
        return float(self.sheet.energy.sum() + self.price * graph.length[seam].sum())

    def stars(self) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
        """Charts (n,) that are to join others (n,), and how long the borders between them are."""
        sheet = self.sheet
        between = contracted(sheet.chart, sheet.graph)
        size = np.bincount(sheet.chart)
        around = np.bincount(between.pairs.reshape(-1), np.repeat(between.length, 2), minlength=len(size))
        small = np.where(size[between.pairs[:, 0]] <= size[between.pairs[:, 1]], 0, 1)
        row = np.arange(len(small))
        leaf, centre = between.pairs[row, small], between.pairs[row, 1 - small]
        share = between.length / np.maximum(around[leaf], 1e-300)
        leaves: dict[int, int] = {}
        taken: set[int] = set()
        found = []
        for n in np.argsort(-share, kind="stable").tolist():
            one, other = int(leaf[n]), int(centre[n])
            if share[n] < self.config.shared:
                break
            if one in taken or one in leaves or other in taken or (one, other) in self.refused:
                continue
            if leaves.get(other, 0) >= self.room.get(other, self.config.leaves):
                continue
            leaves[other] = leaves.get(other, 0) + 1
            taken.add(one)
            found.append(n)
        return leaf[found], centre[found], between.length[found]

    def round(self, leaf: NDArray[np.int64], centre: NDArray[np.int64], border: NDArray[np.float64]) -> None:
        """Try stars, and take those that are better."""
        sheet = self.sheet
        star, length = np.full(int(sheet.chart.max()) + 1, -1), np.zeros(int(sheet.chart.max()) + 1)
        star[centre], star[leaf], length[leaf] = centre, centre, border
        ids = np.flatnonzero(star[sheet.chart] >= 0)
        label = np.unique(star[sheet.chart[ids]], return_inverse=True)[1].reshape(-1)
        for batch in sheet.laid(ids, label):
            self.take(batch, star, length)

    def take(self, batch: Batch, star: NDArray[np.int64], border: NDArray[np.float64]) -> None:
        """Take what is better of a batch of stars; star, border: of charts, the centre and how long the border is."""
        sheet, chart = self.sheet, self.sheet.chart[batch.ids]
        out = spoilt(batch, chart, star)
        number, first = np.unique(chart, return_index=True)
        of, joins = batch.chart[first], (star[number] != number) & ~out[number]
        gain = np.where(out[chart], 0.0, sheet.energy[batch.ids] - batch.laid.energy)
        saved = np.bincount(of[joins], self.price * border[number[joins]], minlength=int(of.max()) + 1)
        failed = np.bincount(batch.chart, gain) + saved <= 0.0
        failed[of[(star[number] == number) & out[number]]] = True
        self.remember(number, star[number], out[number], failed[of])
        taken = ~out[chart] & ~failed[batch.chart]
        ids = batch.ids[taken]
        sheet.chart[ids] = star[chart[taken]]
        sheet.corner_uv[ids] = batch.laid.corner_uv[taken]
        sheet.energy[ids] = batch.laid.energy[taken]

    def remember(
        self, number: NDArray[np.int64], centre: NDArray[np.int64], out: NDArray[np.bool_], failed: NDArray[np.bool_]
    ) -> None:
        """Which charts (n,) are not to join theirs again: those that were out, and the only leaf of a star that failed.

        A star of many that failed gets fewer next time.
        """
        leaves = np.bincount(centre, number != centre)
        alone = leaves[centre] == 1
        refused = (number != centre) & (out | (failed & alone))
        self.refused.update(zip(number[refused].tolist(), centre[refused].tolist(), strict=True))
        fewer = number[(number == centre) & failed & ~alone]
        self.room.update(zip(fewer.tolist(), np.maximum(leaves[fewer].astype(np.int64) // 4, 1).tolist(), strict=True))


def spoilt(batch: Batch, chart: NDArray[np.int64], star: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(k,) bool: charts of faces (m,) that fold in a star or lie over others; of a leaf and its centre, the leaf."""
    laid, leaf = batch.laid, star[chart] != chart
    found = np.zeros(len(star), dtype=np.bool_)
    found[chart[laid.flipped]] = True
    leaves = leaf[laid.pairs]
    found[chart[laid.pairs[leaves]]] = True
    found[chart[laid.pairs[~leaves.any(axis=1)].reshape(-1)]] = True
    return found
