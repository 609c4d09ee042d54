"""Seams grown: to where a surface is pointed, as far as is foretold and then as far as a flattening needs it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import overlaps_anywhere
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.tighten import held, tightened
from flexpara.train.config import FinishConfig
from flexpara.train.finish.flatten import fill_holes, sorted_loops
from flexpara.train.finish.pieces import Piece
from flexpara.train.finish.slits import Flat
from flexpara.train.seams.growing import Growing, as_one_chart, grown, opened_to
from flexpara.train.seams.held import sewn_up
from flexpara.train.seams.network import chains, intervals, seam_edges
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.search import Search

CONFIG = FinishConfig(stretch=0.025)


def sample(name: str, resolution: int = 20) -> Surface:
    """A sample of area 1."""
    surface = Surface(*make_sample(name, resolution=resolution))
    return Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)


def bare(surface: Surface) -> Search:
    return held(Search(surface, dual_graph(surface, edge_table(surface.faces), CONFIG.labels.seams), CONFIG))


def length(surface: Surface, cut: np.ndarray) -> float:
    ends = surface.vertices[edge_table(surface.faces).edges[cut]]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def cone() -> Surface:
    """A cone without its base, steep and of area 1."""
    turn, rings = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False), np.linspace(0.1, 1.0, 10)
    around = [np.stack([r * np.cos(turn), r * np.sin(turn), np.full(24, 1.0 - r)], axis=1) for r in rings]
    points = np.concatenate([[[0.0, 0.0, 1.0]], *around])
    place = 1 + np.arange(240).reshape(10, 24)
    ahead = np.roll(place, -1, axis=1)
    tip = np.stack([np.zeros(24, dtype=np.int64), place[0], ahead[0]], axis=1)
    one = np.stack([place[:-1], place[1:], ahead[:-1]], axis=-1).reshape(-1, 3)
    other = np.stack([ahead[:-1], place[1:], ahead[1:]], axis=-1).reshape(-1, 3)
    surface = Surface(points, np.concatenate([tip, one, other]))
    return Surface(points / np.sqrt(surface.face_areas().sum()), surface.faces)


def test_a_cone_is_slit_once_up_to_its_tip_and_lies_flat() -> None:
    surface = cone()
    (cut,) = grown(surface, (0.01,), CONFIG)
    touched = edge_table(surface.faces).edges[cut]
    assert (touched <= 24).any()  # the tip, or a vertex beside it
    assert len(touched) in (9, 10)
    chart = as_one_chart(bare(surface), cut)
    assert chart is not None
    assert chart.energy() < 0.005


def test_less_energy_asked_for_takes_longer_seams() -> None:
    surface = sample("sphere")
    loose, strict = grown(surface, (0.02, 0.06), CONFIG)
    assert 0.0 < length(surface, loose) < length(surface, strict)


@pytest.mark.parametrize("name", ["sphere", "torus"])
def test_a_closed_surface_becomes_one_valid_chart(name: str) -> None:
    surface = sample(name)
    for cut in grown(surface, (0.05,), CONFIG):
        chart = as_one_chart(bare(surface), cut)
        assert chart is not None
        (piece,) = chart.pieces.values()
        assert len(piece.ids) == len(surface.faces)
        assert not overlaps_anywhere(piece.flat.uv[piece.flat.surface.faces])


def test_a_chart_is_opened_until_its_energy_is_what_is_asked_for_and_counts_its_slits() -> None:
    surface = sample("sphere")
    search = as_one_chart(bare(surface), Growing(surface, 1.0, CONFIG).begun().cut)
    assert search is not None
    (piece,) = search.pieces.values()
    opened = opened_to(piece, search.area, 0.6 * piece.energy, search.config, lambda: False)
    assert opened.energy <= 0.6 * piece.energy
    search.pieces = {0: opened}
    assert opened.slit_length == pytest.approx(length(surface, seam_edges(search)))
    assert not overlaps_anywhere(opened.flat.uv[opened.flat.surface.faces])


def test_a_chart_sewn_up_has_its_vertices_half_way_and_the_middles_of_filled_holes_in_the_middle_of_them() -> None:
    """A ring of four quads around a hole."""
    place = np.array([[0, 0], [3, 0], [3, 3], [0, 3], [1, 1], [2, 1], [2, 2], [1, 2]], dtype=np.float64)
    ring = np.array([[0, 1, 5], [0, 5, 4], [1, 2, 6], [1, 6, 5], [2, 3, 7], [2, 7, 6], [3, 0, 4], [3, 4, 7]])
    surface = Surface(np.concatenate([place, np.zeros((8, 1))], axis=1), ring)
    piece = Piece(np.arange(8), Flat(surface, place, {}), 0.0, 0.0)
    filled = fill_holes(surface, sorted_loops(surface)[1:])
    uv = sewn_up(piece, filled)
    assert np.array_equal(uv[:8], place)
    assert uv[8] == pytest.approx([1.5, 1.5])


def test_a_seam_with_two_ends_inside_its_chart_can_be_closed_from_both() -> None:
    surface = sample("sphere")
    search = as_one_chart(bare(surface), Growing(surface, 1.0, CONFIG).begun().cut)
    assert search is not None
    (chain,) = chains(search, seam_edges(search))
    assert chain.free
    runs = intervals(chain, (0.25,), 1, both=True)
    assert {int(run[0]) for run in runs} >= {int(chain.edges[0])}
    assert {int(run[-1]) for run in runs} >= {int(chain.edges[-1])}


def test_a_sphere_is_one_chart_within_the_stretch_asked_for_and_with_shorter_seams_than_without_any_grown() -> None:
    surface = sample("sphere", resolution=12)
    search = bare(surface)
    search.config = CONFIG
    label = (surface.triangles.mean(axis=1) > 0.0) @ [1, 2, 4]
    search.add_all_valid([(np.flatnonzero(label == value), ()) for value in range(8)])
    found = tightened(search, 1, CONFIG)
    none = replace(CONFIG, closing=replace(CONFIG.closing, growing=replace(CONFIG.closing.growing, hopeful=0.0)))
    plain = tightened(search, 1, none)
    assert len(found.pieces) == 1
    assert found.energy() <= CONFIG.stretch
    assert length(surface, seam_edges(found)) <= length(surface, seam_edges(plain))
