"""Charts by projection: whatever the faces, valid pieces come back at the scale of the surface, few of a smooth one."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.config import ProjectConfig
from flexpara.train.finish.pieces import Piece
from flexpara.train.finish.projected import projected

CONFIG = ProjectConfig()


def assert_valid(pieces: list[Piece], ids: np.ndarray) -> None:
    np.testing.assert_array_equal(np.sort(np.concatenate([piece.ids for piece in pieces])), ids)
    for piece in pieces:
        uv = piece.flat.uv[piece.flat.surface.faces]
        assert not flipped_triangles(uv).any()
        assert len(overlapping_pairs(uv)) == 0
        assert piece.method == "projection"


def charts_of(surface: Surface) -> list[Piece]:
    ids = np.arange(len(surface.faces))
    pieces = projected(surface, ids, float(surface.face_areas().sum()), CONFIG)
    assert_valid(pieces, ids)
    return pieces


def test_a_cube_gets_a_chart_a_side_without_stretch() -> None:
    pieces = charts_of(Surface(*make_sample("cube", resolution=16)))
    assert len(pieces) == 6
    assert sum(piece.energy for piece in pieces) == pytest.approx(0.0, abs=1e-9)


def test_a_ball_gets_six_charts_of_some_stretch() -> None:
    pieces = charts_of(Surface(*make_sample("sphere", resolution=32)))
    assert len(pieces) == 6
    assert 0.01 < sum(piece.energy for piece in pieces) < 0.1


def test_a_chart_keeps_the_size_and_the_corners_of_its_faces() -> None:
    surface = Surface(*make_sample("sphere", resolution=16))
    for piece in charts_of(surface):
        np.testing.assert_allclose(
            piece.flat.surface.vertices[piece.flat.surface.faces], surface.triangles[piece.ids], atol=1e-12
        )
        uv = piece.flat.uv[piece.flat.surface.faces]
        flat = Surface(np.pad(uv.reshape(-1, 2), ((0, 0), (0, 1))), np.arange(3 * len(uv)).reshape(-1, 3))
        assert flat.face_areas().sum() == pytest.approx(surface.face_areas()[piece.ids].sum())


def test_a_ramp_that_winds_over_itself_is_cut_between_its_turns() -> None:
    angle = np.linspace(0.0, 6.0 * np.pi, 120)
    rim = np.stack([np.cos(angle), np.sin(angle), 0.1 * angle], axis=1)
    inner = rim * [0.4, 0.4, 1.0]
    at = np.arange(119)
    lower = np.stack([at, at + 1, at + 120], axis=1)
    upper = np.stack([at + 1, at + 121, at + 120], axis=1)
    pieces = charts_of(Surface(np.concatenate([rim, inner]), np.concatenate([lower, upper])))
    assert 3 <= len(pieces) <= 12


def test_triangles_at_random_that_pass_through_each_other_are_charts_too() -> None:
    rng = np.random.default_rng(0)
    soup = Surface(rng.normal(size=(60, 3)), rng.permuted(np.tile(np.arange(60), (40, 1)), axis=1)[:, :3])
    assert len(charts_of(soup)) <= 40


def test_noise_makes_crumbs_and_some_faces_can_be_asked_for_alone() -> None:
    vertices, faces = make_sample("sphere", resolution=32)
    noisy = vertices + np.random.default_rng(0).normal(scale=0.02, size=vertices.shape)
    chosen = np.arange(100, 900)
    pieces = projected(Surface(noisy, faces), chosen, 1.0, CONFIG)
    assert_valid(pieces, chosen)
    assert len(pieces) < 80
    assert projected(Surface(noisy, faces), chosen[:0], 1.0, CONFIG) == []
