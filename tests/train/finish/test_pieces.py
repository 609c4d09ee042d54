"""Pieces: one triangle, rings and tubes in closed form, solids of every topology, half of a real mesh."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import boundary_loops, components, euler_characteristic, is_manifold
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FinishConfig
from flexpara.train.finish.contact import excess_energy
from flexpara.train.finish.flatten import circle_map
from flexpara.train.finish.pieces import (
    Piece,
    border_length,
    extract,
    flattened,
    make_piece,
    slit_further,
    try_piece,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

CONFIG = FinishConfig()
PRICE = CONFIG.slit.price
BOWTIE = Surface(
    np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [-1, 0, 0], [-1, -1, 0]]), np.array([[0, 1, 2], [0, 3, 4]])
)


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def area_of(surface: Surface) -> float:
    return float(surface.face_areas().sum())


def where(chosen: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.flatnonzero(chosen).astype(np.int64)


def whole_piece(surface: Surface) -> Piece:
    piece = make_piece(surface, np.arange(len(surface.faces)), area_of(surface), CONFIG)
    assert piece is not None
    return piece


def from_circle(disk: Surface) -> NDArray[np.float64]:
    return circle_map(disk, boundary_loops(disk.faces)[0])


def unslit(surface: Surface) -> Piece:
    """A disk flattened as it is: what starts from a uv of its own gets no slits."""
    piece = try_piece(surface, np.arange(len(surface.faces)), area_of(surface), CONFIG, start=from_circle)
    assert isinstance(piece, Piece)
    return piece


def flat_ring() -> tuple[Surface, NDArray[np.int64]]:
    """A flat sheet, and its faces without a hole in the middle."""
    cloth = sample("cloth", 16)
    sheet = Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces)
    return sheet, where(np.linalg.norm(sheet.triangles.mean(axis=1), axis=1) > 0.4)


def assert_valid(piece: Piece, surface: Surface) -> None:
    flat = piece.flat
    corners = flat.uv[flat.surface.faces]
    assert np.array_equal(flat.surface.triangles, surface.triangles[piece.ids])
    assert not flipped_triangles(corners).any()
    assert len(overlapping_pairs(corners)) == 0
    assert components(flat.surface.faces).max() == 0
    assert is_manifold(flat.surface.faces)
    assert 2 - euler_characteristic(flat.surface.faces) == len(boundary_loops(flat.surface.faces))  # no handles


def test_one_triangle_is_its_own_flattening() -> None:
    triangle = Surface(np.array([[0.0, 0, 1], [3, 0, 1], [0, 2, 5]]), np.array([[0, 1, 2]]))
    piece = whole_piece(triangle)
    assert piece.energy == pytest.approx(0.0, abs=1e-6)
    assert (piece.slit_length, piece.method, piece.slits) == (0.0, "slim", ())
    assert signed_areas(piece.flat.uv[piece.flat.surface.faces]) == pytest.approx(triangle.face_areas(), rel=1e-3)


def test_extraction_keeps_the_order_and_cuts_at_a_shared_vertex() -> None:
    part = extract(BOWTIE, np.array([1, 0]))
    assert len(part.vertices) == 6
    assert np.array_equal(part.triangles, BOWTIE.triangles[[1, 0]])
    assert is_manifold(part.faces)


def test_the_border_of_one_side_of_a_cube_is_four_edges_and_of_the_whole_none() -> None:
    cube = sample("cube", 16)
    assert border_length(extract(cube, where(cube.face_normals()[:, 2] > 0.5))) == pytest.approx(4.0)
    assert border_length(cube) == 0.0


def test_a_tube_is_cut_open_and_becomes_flat() -> None:
    tube = sample("tube", 24)
    piece = whole_piece(tube)
    assert_valid(piece, tube)
    assert piece.method == "slit"
    assert piece.slit_length == pytest.approx(2.0 / np.sqrt(area_of(tube)))
    assert piece.energy < 1e-4
    assert piece.cost(PRICE) == pytest.approx(piece.energy + PRICE * piece.slit_length)


def test_a_flat_ring_keeps_its_hole() -> None:
    sheet, ids = flat_ring()
    piece = make_piece(sheet, ids, area_of(sheet), CONFIG)
    assert piece is not None
    assert_valid(piece, sheet)
    assert (piece.slit_length, piece.method) == (0.0, "slim")
    assert piece.energy < 1e-3
    assert len(boundary_loops(piece.flat.surface.faces)) == 2


@pytest.mark.parametrize("name", ["sphere", "torus", "trefoil", "tube", "cone", "cube", "cloth", "gyroid", "bracket"])
def test_any_solid_is_one_valid_piece_or_the_overlap_that_keeps_it_from_being_one(name: str) -> None:
    if name in ("gyroid", "bracket"):
        pytest.importorskip("manifold3d")
    surface = sample(name, 20)
    found = try_piece(surface, np.arange(len(surface.faces)), area_of(surface), CONFIG)
    if isinstance(found, Piece):
        assert_valid(found, surface)
    elif found is not None:
        corners = found.flat.uv[found.flat.surface.faces]
        assert not flipped_triangles(corners).any()
        assert len(found.pairs()) > 0
        assert {tuple(pair) for pair in found.pairs().tolist()} <= {
            tuple(p) for p in overlapping_pairs(corners).tolist()
        }
    assert isinstance(found, Piece) or name in ("cube", "gyroid", "bracket")


def test_energy_and_slits_are_shares_of_the_whole_surface() -> None:
    sphere = sample("sphere", 24)
    ids = where(sphere.triangles.mean(axis=1)[:, 2] > 0.8)
    piece = make_piece(sphere, ids, area_of(sphere), CONFIG)
    larger = make_piece(sphere, ids, 4.0 * area_of(sphere), CONFIG)
    assert piece is not None
    assert piece.slit_length == 0.0  # curvature asks for none in a flat cap, whatever the area around it
    assert larger is not None
    assert piece.energy == pytest.approx(excess_energy(piece.flat.surface, piece.flat.uv) / area_of(sphere))
    assert larger.energy == pytest.approx(piece.energy / 4.0)


def test_a_goal_out_of_sight_gives_no_piece() -> None:
    sphere = sample("sphere", 24)
    ids = where(sphere.triangles.mean(axis=1)[:, 2] > -0.5)
    piece = make_piece(sphere, ids, area_of(sphere), CONFIG)
    assert piece is not None
    assert make_piece(sphere, ids, area_of(sphere), CONFIG, goal=0.1 * piece.energy) is None
    assert make_piece(sphere, ids, area_of(sphere), CONFIG, goal=2.0 * piece.energy) is not None


def test_holes_are_not_grown_shut_while_flattening() -> None:
    sheet, ids = flat_ring()
    ring = extract(sheet, ids)
    uv = flattened(ring, CONFIG.slit.contact, np.inf)
    assert uv is not None
    assert uv.shape == (len(ring.vertices), 2)
    assert signed_areas(uv[ring.faces]).sum() == pytest.approx(area_of(ring), rel=0.01)


def test_a_cone_gets_the_slit_that_its_curvature_asks_for() -> None:
    cone = sample("cone", 32)
    piece = whole_piece(cone)
    assert_valid(piece, cone)
    assert piece.method == "slit"
    assert piece.slit_length == pytest.approx(np.hypot(0.5, 1.0) / np.sqrt(area_of(cone)), rel=0.01)
    assert piece.energy < 1e-4


def test_a_start_of_its_own_gets_no_slits_but_those_given() -> None:
    cone = sample("cone", 32)
    piece = unslit(cone)
    assert_valid(piece, cone)
    assert (piece.slit_length, piece.slits) == (0.0, ())
    slit = whole_piece(cone).slits
    again = try_piece(cone, piece.ids, area_of(cone), CONFIG, slit, start=from_circle)
    assert isinstance(again, Piece)
    assert again.slits == slit
    assert again.energy < 1e-3


def test_the_rim_of_a_piece_is_its_border_and_its_slits() -> None:
    cone = sample("cone", 32)
    border = set(np.flatnonzero(cone.vertices[:, 2] == 0.0).tolist())
    assert set(unslit(cone).rim(cone).tolist()) == border
    slit = set(whole_piece(cone).rim(cone).tolist())
    assert border < slit
    assert len(slit - border) == len(whole_piece(cone).slits[0].points) - 1  # all but where it starts


def test_slitting_adds_its_slit_to_the_piece() -> None:
    cone = sample("cone", 32)
    plain = unslit(cone)
    open_ = slit_further(plain, area_of(cone), CONFIG.slit)
    assert_valid(open_, cone)
    assert open_.method == "slit"
    assert open_.slit_length == pytest.approx(np.hypot(0.5, 1.0) / np.sqrt(area_of(cone)), rel=0.02)
    assert len(open_.slits) == 1
    assert open_.cost(PRICE) < plain.cost(PRICE) - 0.1
    assert np.array_equal(open_.ids, plain.ids)


def test_a_piece_that_needs_no_slit_stays_what_it_is() -> None:
    sheet, ids = flat_ring()
    piece = make_piece(sheet, ids, area_of(sheet), CONFIG)
    assert piece is not None
    assert np.array_equal(slit_further(piece, area_of(sheet), CONFIG.slit).flat.uv, piece.flat.uv)


def test_slits_can_be_given_to_the_piece_again() -> None:
    cone = sample("cone", 32)
    patient = replace(CONFIG.slit, contact=replace(CONFIG.slit.contact, block=5, still=0.04))
    open_ = slit_further(unslit(cone), area_of(cone), patient)
    again = make_piece(cone, open_.ids, area_of(cone), CONFIG, open_.slits)
    assert again is not None
    assert_valid(again, cone)
    assert again.slit_length == pytest.approx(open_.slit_length)
    assert again.energy == pytest.approx(open_.energy, abs=1e-4)
    assert len(again.slits) == 1


def test_half_of_a_real_mesh_is_a_valid_piece(models: Path) -> None:
    surface = load_asset(models / "suzanne.obj").surface
    surface = Surface(Frame.of(surface.vertices).apply(surface.vertices), surface.faces)
    side = surface.triangles.mean(axis=1)[:, 0] > 0.0
    part = components(surface.faces[side])
    ids = where(side)[part == np.bincount(part).argmax()]
    piece = make_piece(surface, ids, area_of(surface), CONFIG)
    assert piece is not None
    assert_valid(piece, surface)
    assert_valid(slit_further(piece, area_of(surface), CONFIG.slit), surface)
