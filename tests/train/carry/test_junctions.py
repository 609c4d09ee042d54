"""Junctions of seams: where three arcs are shortest together, on a made surface."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.straightpaths import Roads
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.train.carry.arcs import Straightening
from flexpara.train.carry.exchange import turned
from flexpara.train.carry.junctions import shortest_star, stars, straighter_junctions
from flexpara.train.config import FinishConfig
from flexpara.train.seams.network import chains, seam_edges
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.search import Search

CONFIG = FinishConfig()
SIDE = 12


def sheet(label: np.ndarray) -> Search:
    """A flat grid of squares, two triangles each, in charts by the label (columns, rows) of each square."""
    side = len(label)
    i, j = np.meshgrid(np.arange(side + 1), np.arange(side + 1), indexing="ij")
    vertices = np.stack([i / side, j / side, np.zeros(i.shape)], axis=-1).reshape(-1, 3)
    number = ((side + 1) * i + j)[:-1, :-1].reshape(-1)
    lower = np.stack([number, number + side + 1, number + side + 2], axis=1)
    upper = np.stack([number, number + side + 2, number + 1], axis=1)
    surface = Surface(vertices, np.concatenate([lower, upper]))
    plain = SeamPrices(flat_price=1.0)
    config = replace(CONFIG, slit=replace(CONFIG.slit, seams=plain))
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), plain), config)
    chart = np.tile(label.reshape(-1), 2)
    for key in np.unique(chart):
        search.add_valid(np.flatnonzero(chart == key))
    search.place_loose()
    return search


def three_charts(tooth: int) -> np.ndarray:
    """One chart below two others; a tooth of it, one square wide, lies between these."""
    label = np.zeros((SIDE, SIDE), dtype=np.int64)
    label[: SIDE // 2, SIDE // 2 :] = 1
    label[SIDE // 2 :, SIDE // 2 :] = 2
    label[SIDE // 2, SIDE // 2 : SIDE // 2 + tooth] = 0
    return label


def test_a_tooth_between_two_charts_goes_with_its_junction() -> None:
    search = sheet(three_charts(3))
    arcs = straighter_junctions(search, 1.5, 8, CONFIG.arcs, shifted=False)
    assert len(arcs) == 1
    assert arcs[0].saved > 0.0
    found = Straightening(search, arcs).run(3)
    ends = found.surface.vertices[found.table.edges[seam_edges(found)]]
    # one square of the tooth is left at most: from there all ways are equally long
    assert np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum() == pytest.approx(1.5, abs=1.01 / SIDE)


def test_a_junction_where_its_arms_are_shortest_stays() -> None:
    assert straighter_junctions(sheet(three_charts(0)), 1.5, 8, CONFIG.arcs, shifted=False) == []


def test_junctions_have_an_arm_for_each_chain_and_border_ends_are_none() -> None:
    search = sheet(three_charts(0))
    seam = seam_edges(search)
    border = np.zeros(len(search.surface.vertices), dtype=bool)
    border[search.table.edges[~search.table.manifold]] = True
    (star,) = stars(chains(search, seam), border, 4)
    assert sorted(len(arm) for arm in star.arms) == [5, 5, 5]
    assert len({int(arm[0]) for arm in star.arms}) == 1
    assert len(star.sides) == 3


def test_a_junction_on_a_ring_moves_along_it() -> None:
    label = np.zeros((SIDE, SIDE), dtype=np.int64)
    label[3:9, 3:9] = 1
    search = sheet(label)
    seam = seam_edges(search)
    points, edges = search.surface.vertices * SIDE, search.table.edges
    # a cut from the ring's side outwards, a step aside and on
    for a, b in (((9, 5), (10, 5)), ((10, 5), (10, 6)), ((10, 6), (11, 6))):
        ends = [np.flatnonzero((points[:, 0].round() == i) & (points[:, 1].round() == j))[0] for i, j in (a, b)]
        seam[(np.sort(edges, axis=1) == np.sort(ends)).all(axis=1)] = True
    found = chains(search, seam)
    (star,) = stars(found, np.zeros(len(points), dtype=bool), 4)
    assert len(star.arms) == 3
    assert len(star.chains) == 2
    ways = shortest_star(Roads(points, edges, np.ones(len(edges))), star, 0.3)
    assert sum(len(way) - 1 for way in ways) < sum(len(arm) - 1 for arm in star.arms)


def test_a_staircase_turns_more_than_a_straight_border() -> None:
    straight = np.zeros((SIDE, SIDE), dtype=np.int64)
    straight[:, SIDE // 2 :] = 1
    stairs = straight.copy()
    stairs[SIDE // 2 :, SIDE // 2] = 0
    flat, bent = sheet(straight), sheet(stairs)
    assert turned(flat, seam_edges(flat)) == pytest.approx(0.0, abs=1e-12)
    # two right angles, each as long as an edge
    assert turned(bent, seam_edges(bent)) == pytest.approx(2.0 / SIDE)
