"""The search: objective by hand, merges and splits on a tube and a sphere, limits kept, every state valid."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FinishConfig
from flexpara.train.finish.flaps import Trimmed
from flexpara.train.search import state as module
from flexpara.train.search.labels import connected_pieces, dual_graph
from flexpara.train.search.search import Search

CONFIG = FinishConfig()


def unit(name: str, resolution: int) -> Surface:
    """A sample at area 1."""
    surface = Surface(*make_sample(name, resolution=resolution))
    return Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)


def search_of(surface: Surface, label: np.ndarray | None = None, config: FinishConfig = CONFIG) -> Search:
    """A search that begins with one piece for each connected part of a label."""
    search = Search(surface, dual_graph(surface, edge_table(surface.faces), SeamPrices()), config)
    if label is not None:
        piece = connected_pieces(label, search.graph)
        for number in range(int(piece.max()) + 1):
            search.add_valid(np.flatnonzero(piece == number))
    return search


def bands(surface: Surface, count: int) -> np.ndarray:
    """(f,) about equal bands across z."""
    height = surface.triangles.mean(axis=1)[:, 2]
    edges = np.linspace(height.min(), height.max(), count + 1)[1:-1]
    return np.searchsorted(edges, height)


def assert_valid(search: Search) -> None:
    covered = np.sort(np.concatenate([piece.ids for piece in search.pieces.values()]))
    assert np.array_equal(covered, np.arange(len(search.surface.faces)))
    for piece in search.pieces.values():
        uv = piece.flat.uv[piece.flat.surface.faces]
        assert not flipped_triangles(uv).any()
        assert len(overlapping_pairs(uv)) == 0


def with_crumb(faces: int) -> Search:
    """A tube in two halves, so many connected faces of which are a piece of their own."""
    tube = unit("tube", 25)
    label = bands(tube, 2)
    graph = dual_graph(tube, edge_table(tube.faces), SeamPrices())
    inside = {int(np.argmin(tube.triangles.mean(axis=1)[:, 2]))}
    while len(inside) < faces:
        inside |= set(graph.pairs[np.isin(graph.pairs, sorted(inside)).any(axis=1)].reshape(-1).tolist())
    label[sorted(inside)[:faces]] = 2
    return search_of(tube, label)


def test_a_crumb_joins_the_piece_around_it() -> None:
    search = with_crumb(1)
    before = search.objective()
    search.join_crumbs()
    assert len(search.pieces) == 2
    assert search.objective() < before
    assert_valid(search)


def test_two_crumbs_side_by_side_become_no_third_one() -> None:
    search = with_crumb(2)
    (key,) = (key for key, piece in search.pieces.items() if len(piece.ids) == 2)
    pair = search.pieces.pop(key).ids
    search.add_all_valid([(pair[:1], ()), (pair[1:], ())])
    search.join_crumbs()
    assert sorted(len(piece.ids) for piece in search.pieces.values())[0] > 2
    assert_valid(search)


def test_a_piece_that_is_no_crumb_stays_a_chart() -> None:
    search = with_crumb(1)
    share = float(search.areas.min()) / search.area
    search.config = replace(CONFIG, crumbs=replace(CONFIG.crumbs, share=0.5 * share))
    search.join_crumbs()
    assert len(search.pieces) == 3


def test_no_crumb_joins_another_piece_once_it_is_late() -> None:
    search = with_crumb(1)
    search.join_crumbs(lambda: True)
    assert len(search.pieces) == 3


def test_the_objective_of_a_tube_in_two_halves_is_the_price_of_its_seams() -> None:
    tube = unit("tube", 25)  # 16 rows: the halves meet along a circle
    search = search_of(tube, bands(tube, 2))
    around = 25 * 2.0 * 0.5 * np.sin(np.pi / 25)
    scale = 1.0 / np.sqrt(around * 2.0)
    (border,) = search.borders().values()
    assert border == pytest.approx(around * scale, rel=1e-6)
    slits = sum(piece.slit_length for piece in search.pieces.values())
    assert slits == pytest.approx(2.0 * scale, rel=1e-6)
    assert search.objective() == pytest.approx(search.energy() + CONFIG.slit.price * (border + slits))
    assert search.energy() < 1e-4


def test_labels_name_the_piece_of_each_face() -> None:
    tube = unit("tube", 24)
    search = search_of(tube, bands(tube, 3))
    for key, piece in search.pieces.items():
        assert (search.label()[piece.ids] == key).all()


def test_merging_the_bands_of_a_tube_leaves_one_piece_and_saves_the_seams() -> None:
    tube = unit("tube", 24)
    search = search_of(tube, bands(tube, 4))
    before = search.objective()
    search.merge(0.0, 0)
    assert len(search.pieces) == 1
    assert search.objective() < before
    assert_valid(search)


def test_a_merge_gains_what_the_objective_says() -> None:
    sphere = unit("sphere", 24)
    search = search_of(sphere, bands(sphere, 4))
    before, merge = search.objective(), search.best_merge(-np.inf)
    assert merge is not None
    assert search.apply_merge(merge, -np.inf)
    assert before - search.objective() == pytest.approx(merge.gain, abs=1e-9)
    assert_valid(search)


def test_a_split_gains_what_the_objective_says() -> None:
    sphere = unit("sphere", 24)
    search = search_of(sphere, np.zeros(len(sphere.faces), dtype=np.int64))
    key, piece = next(iter(search.pieces.items()))
    before, split = search.objective(), search.best_split(piece)
    assert split is not None
    assert search.exchange([key], split.parts, -np.inf, 9)
    assert before - search.objective() == pytest.approx(split.gain, abs=1e-9)
    assert_valid(search)


def test_a_chart_costs_the_room_between_it_and_its_convex_hull() -> None:
    corner = np.array([[x, y, 0.0] for y in range(3) for x in range(3)], dtype=np.float64)
    square = np.array([[0, 1, 4], [0, 4, 3], [1, 2, 5], [1, 5, 4], [3, 4, 7], [3, 7, 6]])  # three of four: an L
    surface = Surface(corner[:8] / np.sqrt(3.0), square)
    search = search_of(surface, np.zeros(6, dtype=np.int64))
    (piece,) = search.pieces.values()
    hull = CONFIG.page.price * CONFIG.page.hull
    assert search.cost_of(piece) - piece.cost(search.price) == pytest.approx(hull * 0.5 / 3.0, rel=1e-4)


def test_a_pair_is_flattened_once(monkeypatch: pytest.MonkeyPatch) -> None:
    tube = unit("tube", 24)
    search = search_of(tube, bands(tube, 3))
    search.best_merge(-np.inf)
    monkeypatch.setattr(module, "try_piece", None)
    assert search.best_merge(-np.inf) is not None


def test_an_excluded_piece_takes_no_part_in_a_merge() -> None:
    tube = unit("tube", 24)
    search = search_of(tube, bands(tube, 3))
    middle = int(search.label()[bands(tube, 3) == 1][0])
    assert search.best_merge(-np.inf, frozenset({middle})) is None


def test_what_curvature_foretells_of_a_merge_orders_what_flattening_finds() -> None:
    sphere = unit("sphere", 48)
    search = search_of(sphere, bands(sphere, 6))
    pairs = list(search.borders())
    search.try_merges(pairs)
    merged = [(pair, search.tried[pair]) for pair in pairs]
    found = [(search.foretell(pair)[0], each.piece.cost(search.price)) for pair, each in merged if each is not None]
    foretold, cost = np.array(found).T
    assert np.corrcoef(np.argsort(np.argsort(foretold)), np.argsort(np.argsort(cost)))[0, 1] > 0.5


@pytest.mark.parametrize(("name", "most"), [("sphere", 1), ("torus", 3), ("cube", 8), ("cloth", 8)])
def test_a_search_ends_valid_within_its_limit_and_no_dearer_than_it_began(name: str, most: int) -> None:
    surface = unit(name, 16)
    search = search_of(surface, bands(surface, 4))
    before = search.objective()
    search.begin()
    search.finish(most, 2)
    assert_valid(search)
    assert len(search.pieces) <= most or search.energy() <= CONFIG.most_excess
    if most == 8:
        assert search.objective() <= before + 1e-9


def test_a_piece_of_too_much_stretch_is_split_whatever_the_limit() -> None:
    sphere = unit("sphere", 24)
    config = replace(CONFIG, most_excess=1e-4)
    search = search_of(sphere, bands(sphere, 2), config)
    search.begin()
    search.finish(2, 2)
    assert len(search.pieces) > 2
    assert_valid(search)


def test_faces_that_overlap_as_one_piece_are_cut_until_they_do_not() -> None:
    cube = unit("cube", 20)
    search = search_of(cube, np.zeros(len(cube.faces), dtype=np.int64))
    assert len(search.pieces) > 1
    assert_valid(search)
    assert {piece.method for piece in search.pieces.values()} <= {"slim", "slit"}


def test_what_no_flattening_makes_valid_goes_to_xatlas(monkeypatch: pytest.MonkeyPatch) -> None:
    sphere = unit("sphere", 12)
    monkeypatch.setattr(module, "try_piece", lambda *_args, **_more: None)
    search = search_of(sphere, np.zeros(len(sphere.faces), dtype=np.int64), replace(CONFIG, halvings=1))
    assert_valid(search)
    assert {piece.method for piece in search.pieces.values()} == {"xatlas"}


def test_a_piece_that_stretches_too_much_is_split_before_others_are_merged() -> None:
    sphere = unit("sphere", 24)
    search = search_of(
        sphere,
        np.zeros(len(sphere.faces), dtype=np.int64),
        replace(CONFIG, stretched=1e-4, slit=replace(CONFIG.slit, price=1e-5)),
    )
    (whole,) = search.pieces.values()
    assert search.is_stretched(whole)
    before = search.objective()
    search.split_stretched()
    assert len(search.pieces) > 1
    assert search.objective() < before
    assert_valid(search)


def test_a_part_of_a_piece_is_valid_and_no_dearer_than_as_it_lies_there() -> None:
    sphere = unit("sphere", 24)
    search = search_of(sphere, np.zeros(len(sphere.faces), dtype=np.int64))
    (whole,) = search.pieces.values()
    ids = np.flatnonzero(sphere.triangles.mean(axis=1)[:, 2] > 0.0)
    part = search.part(whole, ids)
    assert sorted(part.piece.ids.tolist()) == ids.tolist()
    assert part.piece.energy < whole.energy


def test_an_exchange_that_does_not_pay_changes_nothing() -> None:
    tube = unit("tube", 24)
    search = search_of(tube, bands(tube, 3))
    before = dict(search.pieces)
    key, piece = next(iter(search.pieces.items()))
    assert not search.exchange([key], [Trimmed(piece, (), 0.0)], 1e-9, 9)
    assert search.pieces == before
    assert not search.exchange([key], [Trimmed(piece, (), 0.0)], -1.0, 2)
    assert search.pieces == before


def test_a_flap_finds_a_place_beside_it() -> None:
    sphere = unit("sphere", 24)
    search = search_of(sphere, bands(sphere, 2))
    label = search.label()
    owner = int(label[0])
    pairs = search.graph.pairs
    rim = pairs[(label[pairs[:, 0]] != label[pairs[:, 1]])].reshape(-1)
    flap = rim[label[rim] == owner][:1]
    piece = search.pieces.pop(owner)
    rest = piece.ids[~np.isin(piece.ids, flap)]
    search.add_trimmed(Trimmed(search.part(piece, rest).piece, (flap,), 0.0))
    search.place_loose()
    assert len(search.pieces) == 2
    assert_valid(search)


def test_slits_are_made_where_they_pay_and_only_in_dear_pieces() -> None:
    cone = unit("cone", 32)
    config = replace(CONFIG, slit=replace(CONFIG.slit, foreseen=0))
    search = search_of(cone, np.zeros(len(cone.faces), dtype=np.int64), config)
    (before,) = search.pieces.values()
    assert before.slit_length == 0.0
    search.slit_all(2.0 * before.energy)
    assert next(iter(search.pieces.values())) is before
    search.slit_all(0.0)
    (after,) = search.pieces.values()
    assert after.cost(search.price) < before.cost(search.price)
    assert_valid(search)


def test_a_flap_that_loses_a_flap_of_its_own_leaves_no_face_without_a_piece(monkeypatch: pytest.MonkeyPatch) -> None:
    tube = unit("tube", 12)
    search = search_of(tube)
    count = len(tube.faces)
    search.add_valid(np.arange(count - 4))
    search.loose.append(module.Loose(np.arange(count - 4, count), 0))
    add_valid = search.add_valid

    def sheds(ids: np.ndarray, *_: object) -> None:
        if len(ids) > 1:
            search.loose.append(module.Loose(ids[1:], int(ids[0])))
        add_valid(ids[:1])

    monkeypatch.setattr(search, "add_valid", sheds)
    monkeypatch.setattr(search, "give_away", lambda *_: False)
    search.place_loose()
    assert (search.label() >= 0).all()
