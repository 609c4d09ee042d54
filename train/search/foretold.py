"""What a merge of two pieces is foretold to gain, from curvature and common borders alone.   Lengths in √area."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.cutgraph import counted_lengths
from ...runtime.geometry.topology import face_components
from ..finish.curvature import Curvature, foretold_energies

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.topology import EdgeTable
    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.pieces import Piece


class Foretold:
    """Costs and gains of merges on one surface."""

    def __init__(self, surface: Surface, table: EdgeTable, config: FinishConfig) -> None:
        self.surface, self.table, self.config = surface, table, config
        self.areas = surface.face_areas()
        self.area = float(self.areas.sum())
        self.unit = float(np.sqrt(self.area))
        self.curvature = Curvature.of(surface, config.slit.contact.cotangents)

    def cost(self, first: Piece, second: Piece) -> float:
        """Cost of two pieces as one, by curvature: no more slits than both have."""
        ids = np.concatenate([first.ids, second.ids])
        rim = self.outer_vertices(ids)
        for piece in (first, second):
            slit = piece.rim(self.surface)
            rim[slit[~self.outer_vertices(piece.ids)[slit]]] = True
        energy = foretold_energies(self.surface.faces[ids], self.areas[ids], self.curvature.factor(rim)).sum()
        slits = self.config.slit.price * (first.slit_length + second.slit_length)
        return float(energy) / self.area * self.config.foretold + slits

    def outer_vertices(self, ids: NDArray[np.int64]) -> NDArray[np.bool_]:
        """(v,) bool: not all faces around the vertex are among ids."""
        inside = np.bincount(self.surface.faces[ids].reshape(-1), minlength=len(self.surface.vertices))
        return inside < self.curvature.fan

    def longest_chain(self, first: Piece, second: Piece) -> float:
        """Length of the longest connected run of edges that two pieces share: what a merge is sure to save.

        Joined along a second run too, they would be a tube or a handle, which has to be cut open again.
        """
        one, two = (self.table.face_edges[piece.ids].reshape(-1) for piece in (first, second))
        shared = np.intersect1d(one, two)
        shared = shared[self.table.manifold[shared]]
        ends = self.table.edges[shared]
        used, index = np.unique(ends, return_inverse=True)
        index = index.reshape(-1, 2)
        run = face_components(len(used), index)[index[:, 0]]
        length = counted_lengths(self.surface.vertices[ends], self.config.slit.seams)
        return float(np.bincount(run, length).max(initial=0.0)) / self.unit
