"""Charts without a search: valid on whatever comes, all faces in one, and fewer once they are joined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.geometry.topology import boundary_loops, edge_table
from flexpara.runtime.mesh import Surface
from flexpara.train.charts.proof import verify
from flexpara.train.config import FinishConfig
from flexpara.train.swift.join import Joining
from flexpara.train.swift.nets import cut_to_nets
from flexpara.train.swift.settle import far_apart, settled, spread
from flexpara.train.swift.sheet import Sheet, batched
from flexpara.train.swift.swift import swift_pieces, swift_rest

CONFIG = FinishConfig()


def surface_of(*meshes: trimesh.Trimesh) -> Surface:
    begin = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [np.asarray(mesh.faces, dtype=np.int64) + first for mesh, first in zip(meshes, begin, strict=False)]
    return Surface(np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float64), np.concatenate(faces))


def noisy(surface: Surface, scale: float) -> Surface:
    moves = np.random.default_rng(1).normal(scale=scale, size=surface.vertices.shape)
    return Surface(surface.vertices + moves, surface.faces)


BALL = surface_of(trimesh.creation.icosphere(subdivisions=4))
TORUS = surface_of(trimesh.creation.torus(1.0, 0.4, major_sections=60, minor_sections=30))
CRUMBS = surface_of(
    *(trimesh.creation.icosahedron().apply_scale(0.1).apply_translation([n, 0, 0]) for n in range(3)),
    trimesh.creation.box(),
)


@pytest.mark.parametrize("surface", [BALL, TORUS, noisy(BALL, 0.01), noisy(TORUS, 0.03), CRUMBS])
def test_charts_are_valid_and_hold_each_face_once(surface: Surface) -> None:
    pieces = swift_pieces(surface, CONFIG)
    verify(pieces)
    assert np.array_equal(np.sort(np.concatenate([piece.ids for piece in pieces])), np.arange(len(surface.faces)))
    for piece in pieces:
        np.testing.assert_array_equal(piece.flat.surface.triangles, surface.triangles[piece.ids])


def test_a_ball_gets_few_charts_of_little_stretch() -> None:
    pieces = swift_pieces(BALL, CONFIG)
    assert len(pieces) <= 6
    assert sum(piece.energy for piece in pieces) < 0.05


def test_the_energy_is_that_which_metrics_measure() -> None:
    pieces = swift_pieces(TORUS, CONFIG)
    uv = np.zeros((len(TORUS.faces), 3, 2))
    chart = np.zeros(len(TORUS.faces), dtype=np.int64)
    for number, piece in enumerate(pieces):
        uv[piece.ids], chart[piece.ids] = piece.flat.uv[piece.flat.surface.faces], number
    found = measure(TORUS, uv, chart)
    assert found.symmetric_dirichlet_mean == pytest.approx(1.0 + sum(piece.energy for piece in pieces), abs=1e-3)


def test_edges_of_three_faces_are_cut() -> None:
    book = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.5], [-1.0, 0.5, 0.5], [-1.0, -0.5, 0.5]])
    pieces = swift_pieces(Surface(book, np.array([[0, 1, 2], [0, 1, 3], [0, 1, 4]])), CONFIG)
    verify(pieces)
    assert len(pieces) == 3


def test_small_closed_parts_are_nets_without_stretch() -> None:
    surface = cut_to_nets(CRUMBS, 60)
    assert edge_table(surface.faces).boundary.sum() == 3 * 22 + 14  # of 30 edges 19 stay, of 18 it is 11
    assert len(boundary_loops(surface.faces)) == 4
    assert sum(piece.energy for piece in swift_pieces(CRUMBS, CONFIG)) < 1e-9


def test_large_parts_are_no_nets() -> None:
    np.testing.assert_array_equal(cut_to_nets(TORUS, 60).faces, TORUS.faces)


def test_joining_lowers_the_objective_and_stays_valid() -> None:
    sheet = Sheet(BALL, replace(CONFIG, swift=replace(CONFIG.swift, reach=0.0, rings=(1, 1), votes=0, crumb=1)))
    settled(sheet)
    joining = Joining(sheet)
    before, count = joining.objective(), len(sheet.pieces())
    joining.run(lambda: np.inf)
    assert joining.objective() <= before
    assert len(sheet.pieces()) <= count
    verify(sheet.pieces())


def test_without_time_nothing_is_joined() -> None:
    sheet = Sheet(TORUS, CONFIG)
    settled(sheet)
    before = sheet.chart.copy()
    Joining(sheet).run(lambda: 0.0)
    np.testing.assert_array_equal(sheet.chart, before)


def test_the_rest_of_a_surface_is_what_no_piece_has() -> None:
    upper = np.flatnonzero(BALL.triangles.mean(axis=1)[:, 2] > 0.0)
    part, _ = BALL.part(upper)
    first = [replace(piece, ids=upper[piece.ids]) for piece in swift_pieces(part, CONFIG)]
    rest = swift_rest(BALL, first, CONFIG, lambda: 0.0)
    ids = np.concatenate([piece.ids for piece in [*first, *rest]])
    assert np.array_equal(np.sort(ids), np.arange(len(BALL.faces)))
    assert swift_rest(BALL, [*first, *rest], CONFIG, lambda: 0.0) == []


def test_faces_go_to_the_nearer_of_two() -> None:
    links = np.array([[n, n + 1] for n in range(5)])
    both = np.concatenate([links, links[:, ::-1]])
    np.testing.assert_array_equal(spread(both, np.array([[0, 5]]), 6), [0, 0, 0, 1, 1, 1])


def test_the_farthest_pair_that_overlaps_is_cut_apart() -> None:
    centre = np.array([[float(n), 0.0, 0.0] for n in range(6)])
    group = np.array([0, 0, 0, 0, 1, 1])
    np.testing.assert_array_equal(far_apart(centre, group, np.array([[0, 2], [1, 2]])), [[0, 2], [4, 5]])


def test_batches_hold_each_chart_once_the_largest_first() -> None:
    batches = batched(np.array([3, 50, 7, 60]), 64)
    assert [batch.tolist() for batch in batches] == [[3, 1], [2, 0]]
