"""Borders straightened: charts keep their places, and the seams between them take the shortest way nearby.   f faces.

Splits and flaps leave teeth.  Within a few rings beside its border a face may change to the chart across, which hardly
changes what a chart can carry; each chart is then laid out from where it lay.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..search.labels import smooth_labels
from ..search.search import Search
from .carry import WALL, fragments_joined, laid_on, within_reach

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..search.labels import DualGraph


def straightened(search: Search, bands: tuple[int, ...]) -> Search:
    """The search with straighter borders where that lowers its objective: a pass in a band of so many rings each."""
    best, cost = search, search.objective()
    for rings in bands:
        if len(best.pieces) < 2:
            break
        keys, label = np.unique(best.label(), return_inverse=True)
        moved = shortest_borders(label.reshape(-1), best.graph, rings)
        joined = fragments_joined(moved, best.areas, best.graph, best.config.carry.islet)
        sources = [best.pieces[int(key)] for key in keys]
        found = laid_on(Search(best.surface, best.graph, best.config), joined, moved, sources)
        if len(found.pieces) <= len(best.pieces) and found.objective() < cost:
            best, cost = found, found.objective()
    return best


def shortest_borders(label: NDArray[np.int64], graph: DualGraph, rings: int) -> NDArray[np.int64]:
    """Labels (f,) of least border, where a face may take any label found within so many rings of it."""
    own = label[:, None] == np.arange(int(label.max()) + 1)
    doubt = np.where(within_reach(own, graph, rings), 1e-9, WALL)
    doubt[np.arange(len(label)), label] = 0.0  # of equal borders, the one that is there
    return smooth_labels(doubt, graph)
