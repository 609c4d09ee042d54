"""From a middle mesh to the fine one: the same charts, laid out alike, valid, contacts held."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import boundary_loops, edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.carry import fine
from flexpara.train.carry.fine import bounded, laid_out, refined, rotations, weights_of, without_folds, wrong_faces
from flexpara.train.carry.layout import nearest_faces
from flexpara.train.carry.proxy import thinned
from flexpara.train.charts import charts
from flexpara.train.charts.charts import chart_surface
from flexpara.train.charts.objective import objective
from flexpara.train.config import FineConfig, FinishConfig
from flexpara.train.finish.arap import RigidSteps, nearest_rotations
from flexpara.train.finish.contact import boundary_edges, rim_faces
from flexpara.train.finish.flatten import jacobians
from flexpara.train.finish.pieces import Piece, make_piece
from flexpara.train.finish.slits import Flat

CONFIG = FinishConfig()
MIDDLE = FineConfig(faces=3000)


def unit(name: str, resolution: int) -> Surface:
    """A sample at area 1."""
    surface = Surface(*make_sample(name, resolution=resolution))
    return Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)


def halves(surface: Surface) -> list[Piece]:
    """Upper and lower half, each flattened."""
    up = surface.triangles.mean(axis=1)[:, 2] > 0.0
    found = [make_piece(surface, np.flatnonzero(side), 1.0, CONFIG) for side in (up, ~up)]
    return [piece for piece in found if piece is not None]


def wrong_of(flat: Flat) -> np.ndarray:
    faces = flat.surface.faces
    return wrong_faces(faces, rim_faces(faces, boundary_edges(faces)), flat.uv)


def assert_valid(piece: Piece) -> None:
    uv = piece.flat.uv[piece.flat.surface.faces]
    assert not flipped_triangles(uv).any()
    assert len(overlapping_pairs(uv)) == 0


def test_two_halves_of_a_sphere_come_back_valid_with_their_stretch_and_seam() -> None:
    surface = unit("sphere", 160)
    middle = thinned(surface, MIDDLE)
    pieces = halves(middle)
    found = refined(surface, middle, pieces, CONFIG)
    assert len(found) == 2
    assert np.array_equal(np.sort(np.concatenate([piece.ids for piece in found])), np.arange(len(surface.faces)))
    for piece in found:
        assert_valid(piece)
    assert sum(piece.energy for piece in found) < 1.05 * sum(piece.energy for piece in pieces)
    assert objective(surface, found, 0.003) < 1.05 * objective(middle, pieces, 0.003)


def test_a_hole_and_a_slit_come_back() -> None:
    surface = unit("sphere", 120)
    height = surface.triangles.mean(axis=1)[:, 2]
    keep = np.flatnonzero(height < height.max() * 0.8)
    used, faces = np.unique(surface.faces[keep], return_inverse=True)
    cup = Surface(surface.vertices[used], faces.reshape(-1, 3))
    cup = Surface(cup.vertices / np.sqrt(cup.face_areas().sum()), cup.faces)
    middle = thinned(cup, MIDDLE)
    piece = make_piece(middle, np.arange(len(middle.faces)), 1.0, CONFIG)
    assert piece is not None
    (found,) = refined(cup, middle, [piece], CONFIG)
    assert_valid(found)
    assert len(boundary_loops(found.flat.surface.faces)) == len(boundary_loops(piece.flat.surface.faces))
    assert found.slit_length == pytest.approx(piece.slit_length, rel=0.2)
    assert found.energy < 1.1 * piece.energy


def test_what_can_not_be_laid_out_is_flattened_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = unit("sphere", 64)
    middle = thinned(surface, MIDDLE)

    def all_wrong(disk: Surface, *_: object) -> tuple[np.ndarray, np.ndarray]:
        return np.zeros((len(disk.vertices), 2)), np.ones(len(disk.faces), dtype=bool)

    monkeypatch.setattr(fine, "laid_out", all_wrong)
    found = refined(surface, middle, halves(middle), CONFIG)
    assert len(found) >= 2
    for piece in found:
        assert_valid(piece)


def test_late_a_layout_worse_than_its_source_is_kept(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    surface = unit("sphere", 64)
    middle = thinned(surface, MIDDLE)
    demanding = replace(CONFIG, carry=replace(CONFIG.carry, worse=0.0, slack=0.0))
    monkeypatch.setattr(fine, "State", None)  # flattening anew would need it
    found = refined(surface, middle, halves(middle), demanding, lambda: True)
    assert len(found) == 2
    for piece in found:
        assert_valid(piece)
    with pytest.raises(TypeError):
        refined(surface, middle, halves(middle), demanding)


def test_a_valid_layout_of_very_many_faces_is_kept_though_it_stretches_more(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = unit("sphere", 64)
    middle = thinned(surface, MIDDLE)
    demanding = replace(CONFIG, carry=replace(CONFIG.carry, worse=0.0, slack=0.0))
    monkeypatch.setattr(fine, "State", None)  # flattening anew would need it
    found = refined(surface, middle, halves(middle), replace(demanding, fine=replace(demanding.fine, largest=0)))
    assert len(found) == 2
    for piece in found:
        assert_valid(piece)


def test_late_what_can_not_be_laid_out_is_projected(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = unit("sphere", 64)
    middle = thinned(surface, MIDDLE)
    monkeypatch.setattr(fine, "refined_piece", lambda *_: [])
    found = refined(surface, middle, halves(middle), CONFIG, lambda: True)
    assert {piece.method for piece in found} == {"projection"}
    assert np.array_equal(np.sort(np.concatenate([piece.ids for piece in found])), np.arange(len(surface.faces)))


def test_weights_are_a_partition_and_hold_the_place() -> None:
    surface = unit("cloth", 40)
    middle = unit("cloth", 10)
    nearest = nearest_faces(surface, middle, CONFIG.carry)
    weight = weights_of(surface, middle, nearest)
    assert weight.sum(axis=1) == pytest.approx(1.0)
    assert weight.data.min() >= 0.0
    spacing = np.sqrt(middle.face_areas().max())
    assert np.linalg.norm(weight @ middle.vertices - surface.vertices, axis=1).max() < 2.0 * spacing


def test_the_stretch_of_a_sliver_is_not_taken_over() -> None:
    jacobian = np.stack([np.diag([1.5, 0.9]), np.diag([9.0, 1.0]), np.diag([1.0, 0.1])])
    np.testing.assert_allclose(bounded(jacobian, 2.0), [np.diag([1.5, 0.9]), np.eye(2), np.eye(2)])


def test_a_border_that_crosses_itself_and_flips_are_named() -> None:
    surface = unit("cloth", 12)
    uv = surface.vertices[:, :2].copy()
    assert not wrong_of(Flat(surface, uv, {})).any()
    turn = 2.4 * np.pi * uv / np.ptp(uv[:, 0])
    rolled = np.stack([(4.0 + turn[:, 1]) * np.cos(turn[:, 0]), (4.0 + turn[:, 1]) * np.sin(turn[:, 0])], axis=1)
    found = wrong_of(Flat(surface, rolled, {}))
    assert found.any()
    mirrored = wrong_of(Flat(surface, uv * [-1.0, 1.0], {}))
    assert mirrored.all()


def test_a_fold_that_stays_is_cut_off_as_a_chart_of_its_own() -> None:
    surface = unit("cloth", 60)
    flat = Flat(surface, surface.vertices[:, :2].copy(), {})
    flat = flat if not wrong_of(flat).all() else Flat(surface, surface.vertices[:, 1::-1].copy(), {})
    corner = int((surface.vertices @ [1.0, 1.0, 0.0]).argmax())
    flat.uv[corner] -= 0.2
    wrong = wrong_of(flat)
    assert wrong.any()
    found = without_folds(surface, np.arange(len(surface.faces)), flat, wrong, 1.0, CONFIG)
    assert len(found) == 2
    assert np.array_equal(np.sort(np.concatenate([piece.ids for piece in found])), np.arange(len(surface.faces)))
    for piece in found:
        assert_valid(piece)


def test_a_border_that_runs_over_faces_farther_in_takes_them_all_out_at_once() -> None:
    """A strip rolled up more than once around: its end lies a whole strip's width over its beginning."""
    angle, across = np.meshgrid(np.linspace(0.0, 1.0, 400), np.linspace(0.0, 0.1, 16), indexing="ij")
    turn = 2.0 * np.pi * 1.02 * angle
    uv = np.stack([(1.0 + across) * np.cos(turn), (1.0 + across) * np.sin(turn)], axis=2).reshape(-1, 2)
    index = np.arange(angle.size).reshape(angle.shape)
    a, b, c, d = (part.reshape(-1) for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([a, d, c], axis=1), np.stack([a, c, b], axis=1)])
    faces = faces if not flipped_triangles(uv[faces]).any() else faces[:, [0, 2, 1]]
    surface = Surface(np.concatenate([uv, angle.reshape(-1, 1)], axis=1), faces)
    flat = Flat(surface, uv, {})
    config = replace(CONFIG, fine=FineConfig(most_off=0.05))
    found = without_folds(surface, np.arange(len(faces)), flat, wrong_of(flat), 1.0, config)
    assert len(found[0].ids) > 0.97 * len(faces)
    assert np.array_equal(np.sort(np.concatenate([piece.ids for piece in found])), np.arange(len(faces)))
    for piece in found:
        assert_valid(piece)


def test_faces_around_a_flip_turn_as_those_beside_them() -> None:
    surface = unit("cloth", 30)
    flat = Surface(surface.vertices * [1.0, 1.0, 0.0], surface.faces)
    uv = flat.vertices[:, :2].copy()
    plain = nearest_rotations(jacobians(flat, uv))
    uv[int((flat.vertices @ [1.0, 1.0, 0.0]).argmax())] -= 0.3
    np.testing.assert_allclose(rotations(RigidSteps(flat), uv, 3), plain, atol=1e-6)


def test_a_chart_that_touches_itself_stays_apart() -> None:
    """A strip rolled up once around, nearly closed: laid out rigidly it overlaps where its source is held apart."""
    angle = np.linspace(0.0, 1.0, 200)
    across = np.linspace(0.0, 0.1, 8)
    x, y = np.meshgrid(angle, across, indexing="ij")
    turn = 2.0 * np.pi * 1.004 * x
    flat = np.stack([(1.0 + y) * np.cos(turn), (1.0 + y) * np.sin(turn)], axis=2)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.reshape(-1) for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    faces = np.concatenate([np.stack([a, d, c], axis=1), np.stack([a, c, b], axis=1)])
    points = np.concatenate([flat.reshape(-1, 2), 0.02 * x.reshape(-1, 1)], axis=1)
    surface = Surface(points, faces)
    closed = np.stack([(1.0 + y) * np.cos(turn / 1.02), (1.0 + y) * np.sin(turn / 1.02)], axis=2).reshape(-1, 2)
    if flipped_triangles(closed[faces]).all():
        faces = faces[:, [0, 2, 1]]
        surface = Surface(points, faces)
    found, wrong = laid_out(surface, Flat(surface, closed, {}), CONFIG)
    assert not wrong.any()
    assert not wrong_of(Flat(surface, found, {})).any()


def test_a_large_part_is_searched_on_its_middle_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    surface = unit("torus", 64)
    seen: list[int] = []
    plain = charts.refined

    def looked_at(mesh: Surface, middle: Surface, *rest: Any) -> list[Piece]:
        seen.append(len(middle.faces))
        return plain(mesh, middle, *rest)

    monkeypatch.setattr(charts, "refined", looked_at)
    config = replace(CONFIG, fine=FineConfig(faces=2000), proxy_faces=600)
    found = chart_surface(surface, 4, config, 0, Stages())
    assert seen[0] < 2100 < len(surface.faces)
    label = np.zeros(len(surface.faces), dtype=np.int64)
    for number, piece in enumerate(found.pieces):
        label[piece.ids] = number
    table = edge_table(surface.faces)
    assert (label[table.edge_faces[:, 0]] != label[table.edge_faces[:, 1]]).any()
