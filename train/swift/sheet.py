"""A surface and its charts on their way to validity: which faces have one, and what came of laying others flat.

f faces of the surface · k charts · m faces that are looked at.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.topology import edge_table, face_components, split_non_manifold_vertices
from ...runtime.mesh import Surface
from ..finish.pieces import Piece
from ..finish.projected import projected
from ..finish.slits import Flat
from ..search.labels import DualGraph
from ..workers import parallel_map
from .nets import cut_to_nets
from .together import Laid, laid_together

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..config import FinishConfig

OPEN = -1


class Batch(NamedTuple):
    """Faces ids (m,) that were laid flat together, their charts (m,) as numbers from 0, sorted, and what came of it."""

    ids: NDArray[np.int64]
    chart: NDArray[np.int64]
    laid: Laid


class Sheet:
    """The surface, its edges, and the valid charts that it has so far.

    chart: (f,) the number of each face's chart, or OPEN.  corner_uv: (f, 3, 2) of those that have one.  energy: (f,)
    area · (symmetric Dirichlet − 1).  projections: numbers of charts that are projections.
    """

    def __init__(self, surface: Surface, config: FinishConfig) -> None:
        self.surface, self.config = cut_to_nets(surface, config.swift.net), config
        surface = self.surface
        table = edge_table(surface.faces)
        pairs = table.edge_faces[table.manifold]
        ends = np.take(surface.vertices, table.edges[table.manifold], axis=0)
        length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
        self.graph = DualGraph(pairs, length, length)
        self.areas = surface.face_areas()
        self.total = float(self.areas.sum())
        self.chart = np.full(len(surface.faces), OPEN)
        self.corner_uv = np.zeros((len(surface.faces), 3, 2))
        self.energy = np.zeros(len(surface.faces))
        self.count = 0
        self.projections: set[int] = set()

    @property
    def stretch(self) -> float:
        """Mean excess energy."""
        return float(self.energy.sum() / self.total)

    def laid(self, ids: NDArray[np.int64], label: NDArray[np.int64]) -> Iterator[Batch]:
        """Faces ids (m,) laid flat as the charts (m,), numbers from 0, that they would be; in batches."""
        faces = self.surface.faces[ids]
        table = edge_table(faces)
        ends = table.edge_faces
        opened, old = split_non_manifold_vertices(faces, label[ends[:, 0]] != label[ends[:, 1]], table)
        order, size = np.argsort(label, kind="stable"), np.bincount(label)
        begin = np.cumsum(size) - size
        points = np.take(self.surface.vertices, old, axis=0)
        places, charts = [], []
        for numbers in batched(size, self.config.swift.batch):
            places.append(np.concatenate([order[begin[n] : begin[n] + size[n]] for n in numbers.tolist()]))
            charts.append(np.repeat(np.arange(len(numbers)), size[numbers]))

        def one(number: int) -> Laid:
            return laid_together(points, opened[places[number]], charts[number], self.config.swift)

        found = parallel_map(one, range(len(places)))
        return (Batch(ids[of], chart, laid) for of, chart, laid in zip(places, charts, found, strict=True))

    def keep(self, batch: Batch, rows: NDArray[np.int64]) -> None:
        """Take rows (n,) of a batch, that are valid: each group that hangs together in its chart is one."""
        if len(rows) == 0:
            return
        ids = batch.ids[rows]
        group = self.connected(ids, batch.chart[rows])
        self.chart[ids] = group + self.count
        self.corner_uv[ids] = batch.laid.corner_uv[rows]
        self.energy[ids] = batch.laid.energy[rows]
        self.count += int(group.max()) + 1

    def inside(self, ids: NDArray[np.int64]) -> NDArray[np.int64]:
        """(p, 2) places in ids (m,) of faces that share an edge."""
        table = edge_table(self.surface.faces[ids])
        return table.edge_faces[table.manifold]

    def connected(self, ids: NDArray[np.int64], label: NDArray[np.int64]) -> NDArray[np.int64]:
        """(m,) connected groups, numbered from 0, of equal label of faces ids (m,)."""
        pairs = self.inside(ids)
        return face_components(len(ids), pairs[label[pairs[:, 0]] == label[pairs[:, 1]]])

    def project(self, ids: NDArray[np.int64]) -> None:
        """Charts by projection for faces ids (m,)."""
        for piece in projected(self.surface, ids, self.total, self.config.project):
            share = self.areas[piece.ids] / self.areas[piece.ids].sum()
            self.chart[piece.ids], self.energy[piece.ids] = self.count, piece.energy * self.total * share
            self.corner_uv[piece.ids] = piece.flat.uv[piece.flat.surface.faces]
            self.projections.add(self.count)
            self.count += 1

    def pieces(self) -> list[Piece]:
        """The charts, once every face has one."""
        numbers, chart = np.unique(self.chart, return_inverse=True)
        table = edge_table(self.surface.faces)
        ends = table.edge_faces
        opened, old = split_non_manifold_vertices(self.surface.faces, chart[ends[:, 0]] != chart[ends[:, 1]], table)
        ids = np.argsort(chart, kind="stable")
        faces = opened[ids]
        owner, uv = np.zeros(len(old), dtype=np.int64), np.zeros((len(old), 2))
        owner[opened], uv[opened] = chart[:, None], self.corner_uv
        vertices = np.argsort(owner, kind="stable")
        first = np.cumsum(np.append(0, np.bincount(owner, minlength=len(numbers))))
        rank = np.zeros(len(old), dtype=np.int64)
        rank[vertices] = np.arange(len(old))
        faces, points, uv = rank[faces], self.surface.vertices[old[vertices]], uv[vertices]
        energy = np.bincount(chart, self.energy) / self.total
        end = np.cumsum(np.append(0, np.bincount(chart)))
        found = []
        for number in range(len(numbers)):
            own, named = slice(end[number], end[number + 1]), slice(first[number], first[number + 1])
            place = uv[named] - uv[named].min(axis=0)
            flat = Flat(Surface(points[named], faces[own] - first[number]), place, {})
            resort = "projection" if int(numbers[number]) in self.projections else ""
            found.append(Piece(ids[own], flat, float(energy[number]), 0.0, resort=resort))
        return found


def batched(size: NDArray[np.int64], most: int) -> list[NDArray[np.int64]]:
    """Numbers of charts of so many faces (k,), the largest first, in batches of about ``most`` faces."""
    order = np.argsort(-size, kind="stable")
    block = (np.cumsum(size[order]) - size[order]) // most
    return np.split(order, np.flatnonzero(np.diff(block)) + 1)
