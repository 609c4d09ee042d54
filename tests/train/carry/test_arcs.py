"""Arcs of seams made straight: teeth and slits on made surfaces, and what has to stay."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.overlap import flipped_triangles, overlaps_anywhere
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry.arcs import Straightening, parted, straighter_arcs, with_straight_arcs
from flexpara.train.config import FinishConfig
from flexpara.train.seams.network import seam_edges
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.search import Search

CONFIG = FinishConfig()


def bent_sheet(side: int) -> Search:
    """A grid of squares, two triangles each, bent like a saddle, in two charts parted by a border with teeth."""
    i, j = np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij")
    x, y = i / side - 0.5, j / side - 0.5
    vertices = np.stack([x, y, 0.3 * (x * x - y * y)], axis=-1).reshape(-1, 3)
    number = ((side + 1) * i + j)[:-1, :-1].reshape(-1)
    lower = np.stack([number, number + side + 1, number + side + 2], axis=1)
    upper = np.stack([number, number + side + 2, number + 1], axis=1)
    faces = np.concatenate([lower, upper])
    surface = Surface(vertices, faces)
    surface = Surface(vertices / np.sqrt(surface.face_areas().sum()), faces)
    search = Search(surface, dual_graph(surface, edge_table(faces), SeamPrices()), CONFIG)
    column = np.tile(number // (side + 1), 2)
    row = np.tile(number % (side + 1), 2)
    right = column >= side // 2 + (row // 2) % 2  # a tooth of one square in every other pair of rows
    for half in (False, True):
        search.add_valid(np.flatnonzero(right == half))
    search.place_loose()
    return search


def seam_length(search: Search) -> float:
    ends = search.surface.vertices[search.table.edges[seam_edges(search)]]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def test_a_border_with_teeth_becomes_straight_and_each_chart_stays_valid() -> None:
    search = bent_sheet(16)
    found = with_straight_arcs(search, CONFIG.arcs)
    assert seam_length(found) < 0.75 * seam_length(search)
    assert found.objective() < search.objective()
    assert sorted(np.concatenate([piece.ids for piece in found.pieces.values()]).tolist()) == list(
        range(len(search.surface.faces))
    )
    for piece in found.pieces.values():
        corners = piece.flat.uv[piece.flat.surface.faces]
        assert not flipped_triangles(corners).any()
        assert not overlaps_anywhere(corners)


def test_where_seams_cost_nothing_none_is_moved_for_its_length() -> None:
    config = replace(CONFIG, slit=replace(CONFIG.slit, price=1e-12), page=replace(CONFIG.page, price=0.0))
    search = bent_sheet(12)
    free = Search(search.surface, search.graph, config)
    for piece in search.pieces.values():
        free.add(piece)
    found = with_straight_arcs(free, CONFIG.arcs)
    assert found.energy() <= free.energy() + 1e-9


def test_an_arc_that_would_break_a_chart_is_put_back() -> None:
    search = bent_sheet(12)
    arcs = straighter_arcs(search, 2.0, 60, CONFIG.arcs, shifted=False)
    broken = [replace(arc, new=np.zeros(0, dtype=np.int64)) for arc in arcs]  # the seam opens: one chart for two
    assert arcs
    assert Straightening(search, broken).run(3) is search


def test_a_slit_inside_a_chart_is_straightened_too() -> None:
    surface = Surface(*make_sample("sphere", resolution=24))
    surface = Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), SeamPrices()), CONFIG)
    search.add_valid(np.arange(len(surface.faces)))
    assert len(search.pieces) == 1
    found = with_straight_arcs(search, CONFIG.arcs)
    assert len(found.pieces) == 1
    assert found.objective() <= search.objective()


def test_chains_are_parted_alike_and_closed_ones_in_three_at_least() -> None:
    path = np.arange(21)
    assert [len(part) - 1 for part in parted(path, 8, shifted=False)] == [6, 7, 7]
    assert [len(part) - 1 for part in parted(path, 8, shifted=True)] == [3, 7, 6, 4]
    ring = np.append(np.arange(9), 0)
    parts = parted(ring, 60, shifted=True)
    assert [len(part) - 1 for part in parts] == [3, 3, 3]
    assert parts[0][0] == parts[-1][-1] == 1
    assert parted(np.array([0, 1, 0]), 8, shifted=False) == []


def test_large_surfaces_and_late_searches_stay_as_they_are() -> None:
    search = bent_sheet(8)
    assert with_straight_arcs(search, replace(CONFIG.arcs, most_faces=10)) is search
    assert with_straight_arcs(search, CONFIG.arcs, lambda: True) is search
