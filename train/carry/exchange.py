"""Other places for seams: the edges that they leave, those that they take, and what that saves.   e edges."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.cutgraph import edge_costs
from ...runtime.geometry.straightpaths import Roads
from ..seams.closing import path_length

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..search.search import Search


@dataclass(frozen=True, eq=False)
class Arc:
    """A part of a chain that may take another way.

    old, new: edges (n,) of the table.  sides: keys of the pieces beside it.  saved: length by which the new way is
    shorter.
    """

    old: NDArray[np.int64]
    new: NDArray[np.int64]
    sides: tuple[int, ...]
    saved: float


def turned(search: Search, seam: NDArray[np.bool_], near: NDArray[np.int64] | None = None) -> float:
    """Σ (1 − cos) · mean length of the two edges in √A, over vertices of seams (e,) where just two of these meet.

    near: edges at whose ends it is looked for; None: everywhere.
    """
    table, points = search.table, search.surface.vertices
    at = np.zeros(len(points), dtype=bool)
    at[table.edges[near if near is not None else seam]] = True
    rows = np.flatnonzero(seam & at[table.edges].any(axis=1))
    end, other = np.concatenate([table.edges[rows], table.edges[rows][:, ::-1]]).T
    degree = np.bincount(end, minlength=len(points))
    chosen = at[end] & (degree[end] == 2)
    end, other = end[chosen], other[chosen]
    order = np.argsort(end, kind="stable")
    way = (points[other] - points[end])[order].reshape(-1, 2, 3)
    length = np.linalg.norm(way, axis=2)
    cosine = np.einsum("nc,nc->n", way[:, 0], way[:, 1]) / np.maximum(length.prod(axis=1), 1e-300)
    return float(((1.0 + cosine) * length.mean(axis=1)).sum() / search.unit)


def exchanged(
    search: Search, seam: NDArray[np.bool_], old: NDArray[np.int64], new: NDArray[np.int64], sides: tuple[int, ...]
) -> Arc:
    """The arc of seams (e,) that leaves edges for others."""
    changed = seam.copy()
    changed[old], changed[new] = False, True
    straighter = turned(search, seam, old) - turned(search, changed, new)
    shorter = path_length(search, old) - path_length(search, new)
    return Arc(old, new, sides, shorter + search.config.arcs.corner * straighter)


class Room:
    """Where seams (e,) of a search may go: no vertex of another, nor of one that went before, may be met."""

    def __init__(self, search: Search, seam: NDArray[np.bool_]) -> None:
        self.search, table = search, search.table
        self.barred = np.zeros(len(search.surface.vertices), dtype=bool)
        self.barred[table.edges[seam | ~table.manifold]] = True
        self.free = table.manifold & ~seam
        self.cost = edge_costs(search.surface, table, search.config.slit.seams)
        self.tree = KDTree(search.surface.vertices)

    def around(self, old: NDArray[np.int64], width: float) -> Roads:
        """The edges old (n,), and those that are free no farther off than so many of their mean length."""
        points, edges = self.search.surface.vertices, self.search.table.edges
        path = np.unique(edges[old])
        ends = points[edges[old]]
        reach = width * float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).mean())
        near = np.zeros(len(points), dtype=bool)
        near[np.concatenate(self.tree.query_ball_point(points[path], reach)).astype(np.int64)] = True
        near[self.barred] = False
        near[path] = True
        inside = np.append(np.flatnonzero(near[edges].all(axis=1) & self.free), old)
        return Roads(points, edges[inside], self.cost[inside])
