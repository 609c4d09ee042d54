"""Flattening by the kernel against its twins: one triangle, a strip, caps, pinned vertices, slits, and a curvature."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import flipped_triangles
from flexpara.runtime.geometry.topology import boundary_loops
from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.arap import Slopes
from flexpara.train.finish.config import CotangentConfig
from flexpara.train.finish.contact import boundary_edges, excess_energy
from flexpara.train.finish.curvature import Curvature, border_first
from flexpara.train.finish.flatten import Pins, Slim, circle_map
from flexpara.train.finish.pieces import extract

pytestmark = pytest.mark.skipif(kernel() is None, reason="nothing was compiled")

CONFIG = CotangentConfig()
TRIANGLE = Surface(np.array([[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [0.0, 1.0, 2.0]]), np.array([[0, 1, 2]]))


def cap(name: str, share: float) -> Surface:
    """The part of a sample below a share of its height: a disk."""
    whole = Surface(*make_sample(name, resolution=16))
    height = whole.triangles.mean(axis=1)[:, 2]
    return extract(whole, np.flatnonzero(height < np.quantile(height, share)))


PIECES = {"triangle": TRIANGLE, "flat cap": cap("sphere", 0.2), "deep cap": cap("sphere", 0.7)}


@pytest.fixture(params=PIECES.values(), ids=list(PIECES))
def piece(request: pytest.FixtureRequest) -> Surface:
    return request.param


def start(piece: Surface) -> np.ndarray:
    return circle_map(piece, boundary_loops(piece.faces)[0])


@pytest.mark.parametrize("iterations", [0, 1, 2, 12])
def test_slim_takes_its_twins_steps(piece: Surface, iterations: int) -> None:
    found = Slim(piece, start(piece)).run(iterations)
    with twins_only():
        expected = Slim(piece, start(piece)).run(iterations)
    assert found == pytest.approx(expected, abs=1e-7 * np.ptp(expected))
    assert not flipped_triangles(found[piece.faces]).any()


def test_slim_goes_on_where_it_was(piece: Surface) -> None:
    solver = Slim(piece, start(piece))
    solver.run(2)
    assert np.array_equal(solver.run(3), Slim(piece, start(piece)).run(5))


def test_pins_draw_as_the_twins_do(piece: Surface) -> None:
    uv = start(piece)
    pins = Pins(np.array([0, 2]), uv[[0, 2]] * 1.3 + 0.1, 10.0)
    found = Slim(piece, uv, pins).run(4)
    with twins_only():
        expected = Slim(piece, uv, pins).run(4)
    assert found == pytest.approx(expected, abs=1e-7 * np.ptp(expected))


def test_a_triangle_comes_out_isometric() -> None:
    uv = Slim(TRIANGLE, np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 3.0]])).run(40)
    assert np.linalg.norm(uv[1] - uv[0]) == pytest.approx(2.0, rel=1e-6)
    assert excess_energy(TRIANGLE, uv) == pytest.approx(0.0, abs=1e-9)


def test_energies_and_borders_are_the_twins(piece: Surface) -> None:
    uv = start(piece)
    uv[0] += 10.0  # flips faces: they count as capped
    energy, edges = excess_energy(piece, uv), boundary_edges(piece.faces)
    with twins_only():
        assert energy == pytest.approx(excess_energy(piece, uv), rel=1e-9)
        assert np.array_equal(edges, boundary_edges(piece.faces))
    bent = Surface(piece.vertices[:, [0, 0, 2]] * [1.0, 0.0, 0.0], piece.faces)  # no face has area
    assert excess_energy(bent, uv) == 0.0


def test_curvature_and_what_follows_from_it_are_the_twins(piece: Surface) -> None:
    rim = np.zeros(len(piece.vertices), dtype=bool)
    rim[boundary_loops(piece.faces)[0]] = True
    found = Curvature.of(piece, CONFIG)
    values = np.where(rim[:, None], piece.vertices[:, :2], 0.0)
    with twins_only():
        expected = Curvature.of(piece, CONFIG)
        assert type(found) is not type(expected)
        laid_out = border_first(piece, boundary_loops(piece.faces)[0], CONFIG)
    assert found.turn == pytest.approx(expected.turn, abs=1e-12)
    assert np.array_equal(found.fan, expected.fan)
    for chosen in (rim, ~rim, np.zeros_like(rim), np.ones_like(rim), rim):
        assert found.factor(chosen) == pytest.approx(expected.factor(chosen), abs=1e-8)
        assert found.harmonic(chosen, values) == pytest.approx(expected.harmonic(chosen, values), abs=1e-9)
    assert found.product(expected.turn) == pytest.approx(expected.product(expected.turn), abs=1e-9)
    assert border_first(piece, boundary_loops(piece.faces)[0], CONFIG) == pytest.approx(laid_out, abs=1e-8)


def test_a_curvature_travels_to_another_process() -> None:
    piece = PIECES["deep cap"]
    rim = np.zeros(len(piece.vertices), dtype=bool)
    rim[:3] = True
    found = Curvature.of(piece, CONFIG)
    assert np.array_equal(pickle.loads(pickle.dumps(found)).factor(rim), found.factor(rim))


def test_the_slopes_of_a_piece_are_its_twins(piece: Surface) -> None:
    rng = np.random.default_rng(5)
    uv, turn = rng.normal(size=(len(piece.vertices), 2)), rng.normal(size=(len(piece.faces), 2, 2))
    found, expected = Slopes.of(piece), Slopes(piece)
    assert type(found) is not type(expected)
    np.testing.assert_allclose(found.stiffness().toarray(), expected.stiffness().toarray(), atol=1e-12)
    np.testing.assert_allclose(found.jacobians(uv), expected.jacobians(uv), rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(found.right(turn), expected.right(turn), atol=1e-12)


def test_a_face_without_area_has_no_say_in_the_slopes() -> None:
    flat = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    slopes = Slopes.of(flat)
    assert np.isfinite(slopes.stiffness().toarray()).all()
    assert not slopes.right(np.ones((2, 2, 2)))[3].any()


def test_slopes_of_another_piece_are_refused(piece: Surface) -> None:
    with pytest.raises(ValueError, match="another piece"):
        Slopes.of(piece).jacobians(np.zeros((len(piece.vertices) + 1, 2)))
