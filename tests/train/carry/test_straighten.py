"""Borders between charts are made straight where that pays."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry.straighten import shortest_borders, straightened
from flexpara.train.config import FinishConfig
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.search import Search


def halves_with_teeth() -> tuple[Search, np.ndarray]:
    """Two halves of a sphere of area 1, every fifth face beside the equator on the wrong side."""
    surface = Surface(*make_sample("sphere", resolution=32))
    surface = Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)
    graph = dual_graph(surface, edge_table(surface.faces), SeamPrices())
    height = surface.triangles.mean(axis=1)[:, 2]
    label = (height > 0.0).astype(np.int64)
    rim = np.flatnonzero(label[graph.pairs[:, 0]] != label[graph.pairs[:, 1]])
    teeth = graph.pairs[rim[::5], 0]
    label[teeth] = 1 - label[teeth]
    search = Search(surface, graph, FinishConfig())
    for side in (0, 1):
        search.add_valid(np.flatnonzero(label == side))
    search.place_loose()
    return search, label


def seam(search: Search, label: np.ndarray) -> float:
    i, j = search.graph.pairs.T
    return float(search.graph.length[label[i] != label[j]].sum())


def test_the_shortest_border_nearby_has_no_teeth_and_moves_no_farther_than_its_band() -> None:
    search, label = halves_with_teeth()
    moved = shortest_borders(label, search.graph, 2)
    assert seam(search, moved) < 0.8 * seam(search, label)
    height = np.abs(search.centroids[:, 2])
    assert np.array_equal(moved[height > 0.15], label[height > 0.15])
    assert np.array_equal(shortest_borders(label, search.graph, 0), label)


def test_straightening_lowers_the_objective_and_keeps_every_face_in_a_valid_chart() -> None:
    search, _ = halves_with_teeth()
    found = straightened(search, (2, 1))
    assert found.objective() < search.objective()
    assert len(found.pieces) <= len(search.pieces)
    assert sorted(np.concatenate([piece.ids for piece in found.pieces.values()]).tolist()) == list(
        range(len(search.surface.faces))
    )
    assert straightened(search, ()) is search
