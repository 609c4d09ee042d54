"""What charts of a surface cost, and which of two sets of them is better."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.topology import edge_table

if TYPE_CHECKING:
    from ...runtime.geometry.cutgraph import SeamPrices
    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.pieces import Piece


def objective(surface: Surface, pieces: list[Piece], price: float) -> float:
    """Σ energy + price · (seams + slits), lengths in √(area of the surface)."""
    label = np.zeros(len(surface.faces), dtype=np.int64)
    for number, piece in enumerate(pieces):
        label[piece.ids] = number
    table = edge_table(surface.faces)
    seam = table.manifold & (label[table.edge_faces[:, 0]] != label[table.edge_faces[:, 1]])
    ends = surface.vertices[table.edges[seam]]
    border = float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() / np.sqrt(surface.face_areas().sum()))
    return sum(piece.cost(price) for piece in pieces) + price * border


def rank(pieces: list[Piece], surface: Surface, charts: int, config: FinishConfig) -> tuple[bool, bool, float]:
    """What is better comes first: stretch within bounds, few enough charts, a low objective or short seams."""
    energy = sum(piece.energy for piece in pieces)
    cost = objective(surface, pieces, config.slit.price) - (energy if config.stretch else 0.0)
    return energy > (config.stretch or config.most_excess), len(pieces) > charts, cost


def priced(config: FinishConfig, seams: SeamPrices) -> FinishConfig:
    """The same with other prices of seams."""
    return replace(config, labels=replace(config.labels, seams=seams), slit=replace(config.slit, seams=seams))
