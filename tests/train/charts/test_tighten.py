"""Charts of the proxy led back to the surface: one way after the other, and few charts are not given up for stretch."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.deadline import never
from flexpara.runtime.samples import make_sample
from flexpara.train.charts import tighten
from flexpara.train.charts.objective import search_cost, wasted
from flexpara.train.charts.tighten import Way, back_on, closed, held, opened_by_need, room_spent
from flexpara.train.config import FinishConfig, PageConfig
from flexpara.train.seams.closing import path_length
from flexpara.train.seams.growing import as_one_chart, grown
from flexpara.train.seams.network import seam_edges
from flexpara.train.search.labels import dual_graph
from flexpara.train.search.search import Search

CONFIG = FinishConfig(stretch=0.02)


def bowl(charts: int, energy: float = 0.01) -> Search:
    """A half sphere of area 1 in so many sectors, and a mean stretch to be told them by."""
    whole = Surface(*make_sample("sphere", resolution=16))
    faces = whole.faces[whole.triangles.mean(axis=1)[:, 2] > 0.0]
    used, index = np.unique(faces, return_inverse=True)
    part = Surface(whole.vertices[used], index.reshape(-1, 3))
    surface = Surface(part.vertices / np.sqrt(part.face_areas().sum()), part.faces)
    x, y, _ = surface.triangles.mean(axis=1).T
    label = ((np.arctan2(y, x) + np.pi) / (2.0 * np.pi) * charts).astype(np.int64)
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), CONFIG.labels.seams), CONFIG)
    search.add_all_valid([(np.flatnonzero(label == value), ()) for value in range(charts)])
    search.pieces = {key: replace(piece, energy=energy / charts) for key, piece in search.pieces.items()}
    return search


@pytest.fixture
def led(monkeypatch: pytest.MonkeyPatch) -> dict[float, Search | None]:
    """What comes of seams led back, by the freedom that they have; labels come back as four charts."""
    ways: dict[float, Search | None] = {}
    monkeypatch.setattr(tighten, "network_carried", lambda _surface, _found, winding: ways[winding])
    monkeypatch.setattr(tighten, "carried_back", lambda *_: bowl(4))
    return ways


def counts(found: Search, charts: int) -> list[int]:
    return [len(way.pieces) for way in back_on(found.surface, found.surface, found, charts, CONFIG)]


def test_seams_that_can_t_be_led_strictly_get_more_freedom(led: dict[float, Search | None]) -> None:
    first, second, third = CONFIG.carry.winding
    found = bowl(1)
    led |= {first: None, second: bowl(1)}
    assert third not in led
    assert counts(found, 1) == [1]


def test_of_ways_of_many_charts_and_of_much_stretch_both_are_settled(led: dict[float, Search | None]) -> None:
    found, one = bowl(1), bowl(1, energy=2.0 * CONFIG.stretch)
    led |= dict(zip(CONFIG.carry.winding, (bowl(3), bowl(2), one), strict=True))
    best, few = counts(found, 1)
    assert best > 1
    assert few == 1


def test_where_no_way_can_be_led_labels_are_what_is_left(led: dict[float, Search | None]) -> None:
    led |= dict.fromkeys(CONFIG.carry.winding)
    assert counts(bowl(1), 1) == [4]


def striped(charts: int, page: PageConfig) -> Search:
    """A torus of area 1 in sectors along its ring."""
    whole = Surface(*make_sample("torus", resolution=16))
    surface = Surface(whole.vertices / np.sqrt(whole.face_areas().sum()), whole.faces)
    config = FinishConfig(page=page)
    x, y, _ = surface.triangles.mean(axis=1).T
    label = ((np.arctan2(y, x) + np.pi) / (2.0 * np.pi) * charts).astype(np.int64)
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), config.labels.seams), config)
    search.add_all_valid([(np.flatnonzero(label == value), ()) for value in range(charts)])
    return search


def seam_length(search: Search) -> float:
    return path_length(search, np.flatnonzero(seam_edges(search)))


def sphere_in_one_chart(resolution: int, excess: float) -> Search:
    """A sphere of area 1, slit until its stretch is within this bound."""
    whole = Surface(*make_sample("sphere", resolution=resolution))
    surface = Surface(whole.vertices / np.sqrt(whole.face_areas().sum()), whole.faces)
    config = FinishConfig(stretch=excess)
    bare = Search(surface, dual_graph(surface, edge_table(surface.faces), config.labels.seams), config)
    (found,) = [way for cut in grown(surface, (excess,), held(bare).config) if (way := as_one_chart(held(bare), cut))]
    opened_by_need(found, excess, never)
    return found


def test_stretch_that_is_far_from_its_bound_is_spent_on_shorter_seams() -> None:
    found = sphere_in_one_chart(20, 0.01)
    assert found.energy() <= 0.01
    found.config = replace(found.config, stretch=0.04)
    spent = room_spent(found, Way(found, found), found.surface, 1, never)
    assert seam_length(spent) < seam_length(found)
    assert found.energy() < spent.energy() <= 0.04


def test_stretch_near_its_bound_and_a_late_hour_leave_a_search_as_it_is() -> None:
    found = sphere_in_one_chart(12, 0.02)
    found.config = replace(found.config, stretch=1.2 * found.energy())
    assert room_spent(found, Way(found, found), found.surface, 1, never) is found
    found.config = replace(found.config, stretch=0.1)
    assert room_spent(found, Way(found, found), found.surface, 1, lambda: True) is found


@pytest.mark.parametrize("page", [0.0, 0.01])
def test_a_higher_limit_on_charts_costs_no_more(page: float) -> None:
    search = striped(8, PageConfig(price=page))
    ways = [closed(search, charts, 16, never) for charts in (1, 2, 4, 8, 16)]
    assert all(len(way.found.pieces) <= charts for way, charts in zip(ways, (1, 2, 4, 8, 16), strict=True))
    cost = np.array([search_cost(way.found, search.config) for way in ways])
    assert (cost[1:] <= cost[:-1] * search.config.page.near).all()


def test_what_more_than_pays_is_closed_for_few_charts_alone() -> None:
    search = striped(8, PageConfig(price=0.2))
    assert len(closed(search, 8, 16, never).found.pieces) > 1
    one = closed(search, 1, 16, never)
    assert one.forced
    assert len(one.found.pieces) == 1


def test_a_free_page_costs_nothing_and_neither_does_it_where_stretch_is_bounded() -> None:
    pieces = list(striped(2, PageConfig()).pieces.values())
    assert wasted(pieces, FinishConfig()) > 0.0
    assert wasted(pieces, FinishConfig(page=PageConfig(price=0.0))) == 0.0
    assert wasted(pieces, FinishConfig(page=PageConfig(free=True))) == 0.0
    assert wasted(pieces, FinishConfig(stretch=0.02)) == 0.0
