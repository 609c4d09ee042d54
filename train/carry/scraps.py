"""Scraps: the few faces that folded or lay over others where a chart was laid out, put on to charts beside them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.topology import edge_table
from ...runtime.mesh import Surface
from ...runtime.process.deadline import Late, never
from ..finish.contact import excess_energy
from ..finish.flaps import attached
from ..finish.pieces import measured

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.topology import EdgeTable
    from ..config import FinishConfig
    from ..finish.pieces import Piece
    from ..finish.slits import Flat


def scraps_given(
    surface: Surface, charts: list[Piece], scraps: list[Piece], config: FinishConfig, late: Late = never
) -> list[Piece]:
    """The charts with each scrap laid beside the first that takes it, and the scraps that none takes.

    Those of longest common border are asked first, and take it where that border costs more than it stretches there.
    Its faces keep their size where they can, and nothing else moves.
    """
    if not scraps:
        return charts
    table, grown = edge_table(surface.faces), dict(enumerate(charts))
    owner = np.full(len(surface.faces), -1, dtype=np.int64)
    for number, chart in grown.items():
        owner[chart.ids] = number
    left, total = [], float(surface.face_areas().sum())
    for scrap in sorted(scraps, key=lambda scrap: (len(scrap.ids), int(scrap.ids[0]))):
        beside = neighbours(surface, table, owner, scrap.ids)
        if late() or len(scrap.ids) > config.fine.scrap:
            beside = {}
        for number, border in beside.items():
            found = attached(grown[number], surface, table, scrap.ids, replace(config.flaps, edges=1))
            if found is not None and dearer(found[1], scrap, total) < config.slit.price * border / total**0.5:
                ids, flat = found
                grown[number] = replace(grown[number], ids=ids, flat=flat)
                owner[scrap.ids] = number
                break
        else:
            left.append(scrap)
    return [*(remeasured(surface, charts[n], grown[n], total) for n in sorted(grown)), *left]


def neighbours(
    surface: Surface, table: EdgeTable, owner: NDArray[np.int64], ids: NDArray[np.int64]
) -> dict[int, float]:
    """Charts beside faces ids (m,), and how long the common border is, the longest first.

    owner: (f,) the chart of each face, or −1.
    """
    edges = table.face_edges[ids].reshape(-1)
    edges = edges[table.manifold[edges]]
    beside = owner[table.edge_faces[edges]].max(axis=1)  # the faces themselves have none
    ends = surface.vertices[table.edges[edges]]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    border = np.bincount(beside[beside >= 0], length[beside >= 0])
    order = np.argsort(-border, kind="stable")[: np.count_nonzero(border)].tolist()
    return {number: float(border[number]) for number in order}


def dearer(flat: Flat, scrap: Piece, total: float) -> float:
    """How much more energy, as a share of the area, a scrap has as the last faces of a flattening."""
    faces = flat.surface.faces[-len(scrap.ids) :]
    return excess_energy(Surface(flat.surface.vertices, faces), flat.uv) / total - scrap.energy


def remeasured(surface: Surface, before: Piece, after: Piece, total: float) -> Piece:
    """A chart that may have grown, with its energy and the length of its cuts."""
    if after is before:
        return before
    return replace(measured(surface, after.ids, after.flat, total, before.slits), resort=before.resort)
