"""Seams as chains, and closing them: a cylinder's two halves become one, a bound on stretch is kept."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry.network import network_carried, shared_out, stretches
from flexpara.train.config import FinishConfig
from flexpara.train.seams.closing import Bounds, Closing
from flexpara.train.seams.config import ClosingConfig
from flexpara.train.seams.network import chains, intervals, seam_edges
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.search import Search

CONFIG = FinishConfig()


def sheet(rows: int = 6, columns: int = 12, bend: float = 0.0) -> Surface:
    """A strip of quads of area 1, rolled up by the angle ``bend`` over its length."""
    x, y = np.meshgrid(np.linspace(0.0, 2.0, columns + 1), np.linspace(0.0, 1.0, rows + 1))
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    if bend:
        turn, radius = points[:, 0] * bend / 2.0, 2.0 / bend
        points = np.stack([radius * np.sin(turn), points[:, 1], radius * np.cos(turn)], axis=1)
    corner = np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    surface = Surface(points, faces)
    return Surface(points / np.sqrt(surface.face_areas().sum()), faces)


def searched(surface: Surface, label: np.ndarray) -> Search:
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), CONFIG.labels.seams), CONFIG)
    search.add_all_valid([(np.flatnonzero(label == value), ()) for value in np.unique(label)])
    return search


def halved(surface: Surface) -> Search:
    middle = np.median(surface.triangles.mean(axis=1)[:, 0])
    return searched(surface, surface.triangles.mean(axis=1)[:, 0] > middle)


def octants() -> Search:
    """A sphere of area 1 in eight pieces."""
    plain = Surface(*make_sample("sphere", resolution=24))
    surface = Surface(plain.vertices / np.sqrt(plain.face_areas().sum()), plain.faces)
    return searched(surface, (surface.triangles.mean(axis=1) > 0.0) @ [1, 2, 4])


def assert_valid(search: Search) -> None:
    ids = np.sort(np.concatenate([piece.ids for piece in search.pieces.values()]))
    assert np.array_equal(ids, np.arange(len(search.surface.faces)))
    for piece in search.pieces.values():
        uv = piece.flat.uv[piece.flat.surface.faces]
        assert np.array_equal(piece.flat.surface.triangles, search.surface.triangles[piece.ids])
        assert not flipped_triangles(uv).any()
        assert len(overlapping_pairs(uv)) == 0


def test_the_seam_between_two_halves_of_a_strip_is_one_chain_across_it() -> None:
    search = halved(sheet())
    (chain,) = chains(search, seam_edges(search))
    assert len(chain.sides) == 2
    assert not chain.loose
    assert chain.reach[-1] == pytest.approx(1.0 / np.sqrt(2.0))
    assert len(chain.path) == len(chain.edges) + 1


def test_runs_of_a_chain_are_its_whole_and_shares_at_both_ends_and_half_way() -> None:
    search = halved(sheet(rows=8))
    (chain,) = chains(search, seam_edges(search))
    runs = intervals(chain, (1.0, 0.25), 1)
    assert [len(run) for run in runs] == [8, 2, 2, 2]
    assert {int(run[0]) for run in runs[1:]} == {int(chain.edges[at]) for at in (0, 3, 6)}


def test_two_halves_of_a_rolled_strip_become_one_chart_without_stretch() -> None:
    search = halved(sheet(bend=2.0))
    Closing(search, Bounds(8, 0.05), ClosingConfig()).close(0.003, 16)
    (piece,) = search.pieces.values()
    assert piece.slit_length == 0.0
    assert piece.energy < 1e-3
    assert_valid(search)


def test_a_sphere_of_many_charts_becomes_one_within_the_stretch_asked_for_and_of_less_seam() -> None:
    search = octants()
    before = search.objective() - search.energy()
    Closing(search, Bounds(1, 0.04), ClosingConfig()).close(0.003, 100)
    assert len(search.pieces) == 1
    assert search.energy() <= 0.04
    assert search.objective() - search.energy() < before
    assert_valid(search)


def test_closing_stops_at_the_bound_on_stretch() -> None:
    search = octants()
    bound = search.energy() + 1e-3
    Closing(search, Bounds(1, bound), ClosingConfig()).close(10.0, 60)
    assert search.energy() <= bound


def test_closing_ends_where_too_many_charts_are_left_and_each_bridge_is_foretold_to_stretch_too_much() -> None:
    search = octants()
    Closing(search, Bounds(1, search.energy() - 1.0), ClosingConfig()).close(search.price, 12)
    assert len(search.pieces) == 8


def test_seams_are_carried_as_a_network_to_a_finer_mesh_with_as_many_charts() -> None:
    coarse, fine = halved(sheet(bend=2.0)), sheet(12, 24, bend=2.0)
    found = network_carried(fine, coarse, 1.4)
    assert found is not None
    assert len(found.pieces) == 2
    assert found.energy() < 1e-3
    assert_valid(found)


def test_a_winding_way_is_led_along_in_parts_and_a_straight_one_as_a_whole() -> None:
    angle = np.linspace(0.0, np.pi, 9)
    points = np.concatenate([np.stack([np.cos(angle), np.sin(angle)], 1), [[9.0, 9.0]]])
    path = np.arange(9)
    parts = stretches(path, points, 1.4)
    assert [part.tolist() for part in parts] == [[0, 1, 2, 3, 4], [4, 5, 6, 7, 8]]
    assert len(stretches(path[:3], points, 1.4)) == 1


def test_two_junctions_near_one_vertex_get_two() -> None:
    near = np.array([[5, 7], [5, 9]])
    assert shared_out([0, 1], near, np.array([[0.2, 0.3], [0.1, 0.4]])) == {1: 5, 0: 7}
    assert shared_out([0, 1], near[:, :1], np.array([[0.2], [0.1]])) == {1: 5}
