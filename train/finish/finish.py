"""Finishing: from chart probabilities to valid charts.   f faces · unit ball.

labels (α-expansion) → split and merge on a simplified twin → labels and slits carried back → exact check.
Valid means: each chart a flattened disk (holes allowed), no flipped triangle, no overlap, by exact tests.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.errors import FinishError
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.topology import components, edge_table, split_non_manifold_vertices
from .labels import connected_pieces, dual_graph, merge_pieces, smooth_labels
from .pieces import Piece
from .regroup import Regrouping
from .surrogate import carry_labels, simplified

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from .labels import DualGraph

    LogProbability = Callable[[NDArray[np.float64]], NDArray[np.float64]]
    Stage = Callable[[str], None]


class Finished(NamedTuple):
    """Valid charts in the order of their first face.  pieces: by chart; objective: what the search lowered."""

    pieces: list[Piece]
    objective: float


def finish(
    surface: Surface, log_probability: LogProbability, charts: int, config: FinishConfig, stage: Stage
) -> Finished:
    """Valid charts of a surface in the unit ball.

    Args:
        surface: welded; non-manifold edges are cut.
        log_probability: (n, 3) points → (n, k) log chart probabilities.
        charts: K; each connected component beyond the first raises the limit by one.
        config: numbers.
        stage: called with the name of each stage as it begins.

    Raises:
        FinishError: the result failed the exact check (a defect).
    """
    charts = max(charts - pinched(surface), 1)
    stage("split and merge")
    coarse = simplified(surface, config.surrogate_faces)
    search = regrouped(coarse, log_probability, charts, config)
    if coarse is not surface:
        stage("carry labels back")
        search = carried_back(surface, coarse, search, charts, config)
    stage("slit")
    search.relieve_all(config.dear, contacts=True)
    pieces = sorted(search.pieces.values(), key=lambda piece: int(piece.ids.min()))
    stage("exact check")
    verify(pieces)
    return Finished(pieces, search.objective())


def regrouped(surface: Surface, log_probability: LogProbability, charts: int, config: FinishConfig) -> Regrouping:
    """Labels from probabilities, then split and merge."""
    graph = dual_graph(surface, edge_table(surface.faces), config.labels.crease_discount)
    areas = surface.face_areas()
    unlikely = -log_probability(surface.triangles.mean(axis=1))
    label = smooth_labels(unlikely * areas[:, None] / config.labels.smoothing, graph)
    pieces = merge_pieces(label, areas, graph, len(label), config.labels)
    search = Regrouping(surface, graph, config)
    for number in range(int(pieces.max()) + 1):
        search.add_valid(np.flatnonzero(pieces == number))
    search.relieve_all(0.0)
    search.search(charts + component_count(graph, len(label)) - 1)
    return search


def carried_back(surface: Surface, coarse: Surface, found: Regrouping, charts: int, config: FinishConfig) -> Regrouping:
    """The pieces and slits of the coarse twin, on the surface itself; merged where validity asked for more pieces."""
    keys, label = np.unique(found.label(), return_inverse=True)
    graph = dual_graph(surface, edge_table(surface.faces), config.labels.crease_discount)
    areas = surface.face_areas()
    unlikely = -np.log(np.maximum(carry_labels(coarse, label, surface), 1e-3))
    smooth = smooth_labels(unlikely * areas[:, None] / config.labels.smoothing, graph)
    limit = charts + component_count(graph, len(areas)) - 1
    piece = merge_pieces(smooth, areas, graph, limit, config.labels)
    search = Regrouping(surface, graph, replace(config, rounds=0))
    for number in range(int(piece.max()) + 1):
        ids = np.flatnonzero(piece == number)
        source = found.pieces[int(keys[np.bincount(smooth[ids]).argmax()])]
        search.add_valid(ids, source.relief)
    search.search(limit)
    return search


def pinched(surface: Surface) -> int:
    """Parts that only non-manifold edges join to the rest: pieces of their own that don't raise the limit on charts."""
    apart = components(split_non_manifold_vertices(surface.faces)[0])
    return int(apart.max() - components(surface.faces).max())


def component_count(graph: DualGraph, faces: int) -> int:
    """Connected components across manifold edges."""
    return int(connected_pieces(np.zeros(faces, dtype=np.int64), graph).max()) + 1


def verify(pieces: list[Piece]) -> None:
    """The exact check of each piece: raises FinishError where a triangle is flipped or two overlap."""
    for number, piece in enumerate(pieces):
        uv = piece.flat.uv[piece.flat.surface.faces]
        flips, overlaps = int(flipped_triangles(uv).sum()), len(overlapping_pairs(uv))
        if flips or overlaps:
            raise FinishError(
                f"chart {number} of {len(piece.ids)} faces has {flips} flipped triangles and {overlaps} overlapping "
                "pairs, expected none; please report the mesh"
            )
