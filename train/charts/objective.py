"""What charts of a surface cost, and which of two sets of them is better."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.cutgraph import PLAIN, counted_length
from ...runtime.geometry.topology import edge_table
from ...runtime.geometry.triangles import signed_areas
from ...runtime.pack.layouts.foreseen import foreseen, silhouette
from ..finish.contact import boundary_edges

if TYPE_CHECKING:
    from ...runtime.geometry.cutgraph import SeamPrices
    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.pieces import Piece
    from ..search.search import Search


def objective(surface: Surface, pieces: list[Piece], price: float, seams: SeamPrices = PLAIN) -> float:
    """Σ energy + price · (seams + slits), lengths in √(area of the surface), counted by where they lie."""
    label = np.zeros(len(surface.faces), dtype=np.int64)
    for number, piece in enumerate(pieces):
        label[piece.ids] = number
    table = edge_table(surface.faces)
    seam = table.manifold & (label[table.edge_faces[:, 0]] != label[table.edge_faces[:, 1]])
    ends = surface.vertices[table.edges[seam]]
    border = counted_length(ends, seams) / float(np.sqrt(surface.face_areas().sum()))
    return sum(piece.cost(price) for piece in pieces) + price * border


def wasted(pieces: list[Piece], config: FinishConfig) -> float:
    """What the share of a page costs that charts are foreseen to leave empty: up to the price of the page."""
    if not config.page_price:
        return 0.0
    page = config.page.foreseen
    areas = [float(np.abs(signed_areas(piece.flat.uv[piece.flat.surface.faces])).sum()) for piece in pieces]
    whole = sum(areas)
    shapes = [
        silhouette(piece.flat.uv[boundary_edges(piece.flat.surface.faces)], area, whole, page, alone=len(pieces) == 1)
        for piece, area in zip(pieces, areas, strict=True)
    ]
    return config.page_price * (1.0 - foreseen(shapes, page))


def search_cost(search: Search, config: FinishConfig) -> float:
    """The objective of a search, page included."""
    pieces = list(search.pieces.values())
    plain = sum(piece.cost(search.price) for piece in pieces) + search.price * sum(search.borders().values())
    return plain + wasted(pieces, config)


def rank(pieces: list[Piece], surface: Surface, charts: int, config: FinishConfig) -> tuple[bool, bool, float]:
    """What is better comes first: stretch within bounds, few enough charts, a low objective with the page, or seams."""
    energy = sum(piece.energy for piece in pieces)
    cost = objective(surface, pieces, config.slit.price, config.slit.seams) - (energy if config.stretch else 0.0)
    cost += wasted(pieces, config)
    return energy > (config.stretch or config.most_excess), len(pieces) > charts, cost


def priced(config: FinishConfig, seams: SeamPrices) -> FinishConfig:
    """The same with other prices of seams."""
    return replace(config, labels=replace(config.labels, seams=seams), slit=replace(config.slit, seams=seams))
