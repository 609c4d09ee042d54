"""Charts held apart by triangles around them: the triangulation, SLIM within it and its twin, cuts that open."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import boundary_loops
from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.mesh import Surface
from flexpara.train.finish.config import ScaffoldConfig
from flexpara.train.finish.contact import boundary_edges, excess_energy, is_valid
from flexpara.train.finish.flatten import circle_map
from flexpara.train.finish.scaffold import held_apart, opened_a_little, scaffold_around, slim_within

CONFIG = ScaffoldConfig(rounds=60)
SQUARE = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))


def bent_strip(turn: float, columns: int = 40) -> Surface:
    """A flat ring-shaped strip that turns by an angle, on a helix so steep that it does not meet itself in space."""
    angle = np.linspace(0.0, turn, columns + 1)
    rows = [np.stack([r * np.cos(angle), r * np.sin(angle), 0.02 * angle], axis=1) for r in (0.8, 0.9, 1.0)]
    points = np.concatenate(rows)
    corner = np.arange(len(points)).reshape(3, -1)
    a, b, c, d = corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1]
    faces = np.concatenate([np.stack([a, c, b], -1).reshape(-1, 3), np.stack([a, d, c], -1).reshape(-1, 3)])
    return Surface(points, faces[:, ::-1])


def on_circle(surface: Surface) -> np.ndarray:
    return circle_map(surface, boundary_loops(surface.faces)[0])


def test_a_scaffold_fills_the_ring_around_a_square_and_keeps_out_of_it() -> None:
    uv = SQUARE.vertices[:, :2]
    found = scaffold_around(uv, boundary_edges(SQUARE.faces), CONFIG)
    assert found is not None
    areas = signed_areas(np.concatenate([uv, found.ring])[found.faces])
    x, y = found.ring.T
    hull = 0.5 * float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    assert (areas > 0.0).all()
    assert float(areas.sum()) == pytest.approx(hull - 1.0)


def test_a_border_edge_that_delaunay_leaves_out_is_inserted() -> None:
    """A long thin triangle with points close to the middle of its long side on the other side of it."""
    points = np.array([[0.0, 0.0], [10.0, 0.0], [5.0, 5.0], [4.0, -0.2], [6.0, -0.2], [5.0, -4.0]])
    edges = np.array([[0, 1], [1, 2], [2, 0], [3, 5], [5, 4], [4, 3]])
    found = scaffold_around(points, edges, CONFIG)
    assert found is not None
    ahead = np.roll(found.faces, -1, axis=1)
    sides = {tuple(sorted(side)) for side in np.stack([found.faces, ahead], axis=-1).reshape(-1, 2).tolist()}
    assert {tuple(sorted(edge)) for edge in edges.tolist()} <= sides


def test_a_border_that_crosses_itself_has_no_scaffold() -> None:
    points = np.array([[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]])
    assert scaffold_around(points, np.array([[0, 1], [1, 2], [2, 3], [3, 0]]), CONFIG) is None


@pytest.mark.skipif(kernel() is None, reason="nothing was compiled")
@pytest.mark.parametrize("iterations", [1, 3])
def test_slim_within_a_scaffold_takes_its_twins_steps(iterations: int) -> None:
    surface = bent_strip(4.0)
    uv = on_circle(surface)
    scaffold = scaffold_around(uv, boundary_edges(surface.faces), CONFIG)
    assert scaffold is not None
    found = slim_within(surface, uv, scaffold, 0.01, iterations)
    with twins_only():
        assert found == pytest.approx(slim_within(surface, uv, scaffold, 0.01, iterations), abs=1e-6)


def test_a_strip_that_would_lie_over_itself_is_held_apart() -> None:
    surface = bent_strip(1.1 * 2.0 * np.pi)
    uv = held_apart(surface, on_circle(surface), CONFIG)
    assert uv is not None
    assert is_valid(surface, uv)
    assert 0.0 < excess_energy(surface, uv) < 0.2 * float(surface.face_areas().sum())


def test_it_is_given_up_where_the_goal_is_out_of_sight() -> None:
    surface = bent_strip(1.1 * 2.0 * np.pi)
    assert held_apart(surface, on_circle(surface), CONFIG, goal=0.0) is None


def test_the_sides_of_a_fresh_cut_are_moved_apart_and_all_else_stays() -> None:
    """Two triangles that share no vertex, side by side."""
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 0, 0], [1, 1, 0], [0, 1, 0]])
    cut = Surface(points, np.array([[0, 1, 2], [3, 4, 5]]))
    moved = opened_a_little(cut, points[:, :2], boundary_edges(cut.faces), 0.02)
    assert np.array_equal(moved[[1, 5]], points[[1, 5], :2])
    assert not (moved[[0, 2]] == moved[[3, 4]]).all(axis=1).any()
    assert is_valid(cut, moved)
