"""Overlap inside a chart: two triangles by hand, rings of more than one turn and tight spirals, caps of a sphere.

A *ring* is a helical strip, so that its flat development of more than one turn is nearly isometric and overlaps itself.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import boundary_loops
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.config import ContactConfig
from flexpara.train.finish.contact import (
    Relaxed,
    as_pins,
    boundary_edges,
    buried_vertices,
    converge,
    excess_energy,
    nearest_exit,
    relax,
    rim_overlaps,
    separate,
)
from flexpara.train.finish.flatten import circle_map, flatten

CONFIG = ContactConfig(block=5, still=0.04)  # on until it hardly moves: what slides into overlap gets there
SQUARE = np.array([[0, 1, 2], [0, 2, 3]])
TWO_SQUARES = np.concatenate([SQUARE, SQUARE + 4])


def strip(columns: int, rows: int, across: float, path: np.ndarray, pitch: float) -> tuple[Surface, np.ndarray]:
    """A strip of width ``across`` right of a plane path (columns + 1, 2), lifted by pitch; and its flat uv."""
    tangent = np.gradient(path, axis=0)
    right = np.stack([tangent[:, 1], -tangent[:, 0]], axis=1) / np.linalg.norm(tangent, axis=1, keepdims=True)
    share = np.linspace(1.0, 0.0, rows + 1)
    uv = (path[:, None] + across * share[:, None] * right[:, None]).reshape(-1, 2)
    corner = np.arange(len(uv)).reshape(columns + 1, rows + 1)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    height = pitch * np.repeat(np.linspace(0.0, 1.0, columns + 1), rows + 1)
    return Surface(np.concatenate([uv, height[:, None]], axis=1), faces), uv


def ring(turns: float, columns: int = 60, widening: float = 0.0, across: float = 0.4) -> tuple[Surface, np.ndarray]:
    """A strip around a circle of radius 1 that grows by ``widening`` a turn."""
    angle = np.linspace(0.0, 2.0 * np.pi * turns, columns + 1)
    radius = 1.0 + widening * angle / (2.0 * np.pi)
    return strip(columns, 4, across, np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1), 0.1 * turns)


def figure_eight() -> tuple[Surface, np.ndarray]:
    """A strip along a lemniscate: it crosses itself in the middle, far from its ends."""
    t = np.linspace(0.1, 2.0 * np.pi - 0.1, 121)
    return strip(120, 4, 0.1, np.stack([np.cos(t), np.sin(2.0 * t) / 2.0], axis=1), 0.3)


def cap(height: float) -> Surface:
    """The part of the unit sphere above z = height."""
    vertices, faces = make_sample("sphere", resolution=24)
    chosen = faces[vertices[faces].mean(axis=1)[:, 2] > height]
    used, index = np.unique(chosen, return_inverse=True)
    return Surface(vertices[used], index.reshape(-1, 3).astype(np.int64))


def circle_start(surface: Surface) -> np.ndarray:
    return circle_map(surface, boundary_loops(surface.faces)[0])


def is_valid(surface: Surface, uv: np.ndarray) -> bool:
    corners = uv[surface.faces]
    return not flipped_triangles(corners).any() and len(overlapping_pairs(corners)) == 0


def two_squares(offset: list[float]) -> np.ndarray:
    """Corners of a unit square and of another of half its size."""
    square = np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    return np.concatenate([square, 0.5 * square + offset])


def test_boundary_edges_have_the_surface_on_their_left() -> None:
    uv = two_squares([3.0, 0.0])[:4]
    edges = boundary_edges(SQUARE)
    assert sorted(edges.tolist()) == [[0, 1], [1, 2], [2, 3], [3, 0]]
    along, inwards = uv[edges[:, 1]] - uv[edges[:, 0]], np.array([0.5, 0.5]) - uv[edges[:, 0]]
    assert (along[:, 0] * inwards[:, 1] - along[:, 1] * inwards[:, 0] > 0.0).all()


def test_the_corner_under_another_square_is_buried() -> None:
    uv = two_squares([0.8, 0.3])
    pairs = overlapping_pairs(uv[TWO_SQUARES])
    assert buried_vertices(uv, TWO_SQUARES, pairs, boundary_edges(TWO_SQUARES)).tolist() == [4, 7]


def test_nothing_is_buried_where_nothing_overlaps() -> None:
    uv = two_squares([1.5, 0.0])
    pairs = overlapping_pairs(uv[TWO_SQUARES])
    assert len(buried_vertices(uv, TWO_SQUARES, pairs, boundary_edges(TWO_SQUARES))) == 0


def test_the_exit_lies_a_margin_outside_the_nearest_border() -> None:
    uv = two_squares([0.8, 0.4])
    places = nearest_exit(uv, np.array([4, 7]), boundary_edges(TWO_SQUARES), 0.05)
    assert places == pytest.approx(np.array([[1.05, 0.4], [0.8, 1.05]]))


def test_pins_are_none_without_contacts() -> None:
    assert as_pins({}, 1.0) is None
    pins = as_pins({7: np.array([1.0, 2.0]), 3: np.array([4.0, 5.0])}, 9.0)
    assert pins is not None
    assert (pins.vertex.tolist(), pins.place.tolist(), pins.weight) == ([7, 3], [[1.0, 2.0], [4.0, 5.0]], 9.0)


def test_excess_energy_in_closed_form_is_zero_for_isometries_and_capped_for_slivers() -> None:
    surface = Surface(np.array([[0.0, 0, 1], [2, 0, 1], [2, 3, 1], [0, 3, 1]]), SQUARE)
    uv = surface.vertices[:, :2]
    assert excess_energy(surface, uv @ np.array([[0.6, -0.8], [0.8, 0.6]]) + 4.0) == pytest.approx(0.0, abs=1e-12)
    assert excess_energy(surface, 2.0 * uv) == pytest.approx(6.0 * ((4.0 + 0.25) / 2.0 - 1.0))
    assert excess_energy(surface, 1e-3 * uv) == pytest.approx(6.0 * 10.0)
    assert excess_energy(surface, uv * [1.0, -1.0]) == pytest.approx(6.0 * 10.0)


@pytest.mark.parametrize("turns", [0.5, 0.9, 0.999, 1.001, 1.02, 1.1, 1.5])
def test_the_rim_tells_what_the_full_test_tells_of_rings(turns: float) -> None:
    surface, uv = ring(turns)
    assert not flipped_triangles(uv[surface.faces]).any()
    assert rim_overlaps(surface.faces, boundary_edges(surface.faces), uv) == (turns > 1.0)
    assert (len(overlapping_pairs(uv[surface.faces])) > 0) == (turns > 1.0)


@pytest.mark.parametrize(("widening", "overlaps"), [(0.5, False), (0.41, False), (0.39, True), (0.1, True)])
def test_the_rim_tells_what_the_full_test_tells_of_spirals(widening: float, overlaps: bool) -> None:
    surface, uv = ring(2.5, columns=400, widening=widening)
    assert not flipped_triangles(uv[surface.faces]).any()
    assert rim_overlaps(surface.faces, boundary_edges(surface.faces), uv) == overlaps
    assert (len(overlapping_pairs(uv[surface.faces])) > 0) == overlaps


def test_the_rim_sees_a_crossing_far_from_the_ends() -> None:
    surface, uv = figure_eight()
    assert not flipped_triangles(uv[surface.faces]).any()
    assert rim_overlaps(surface.faces, boundary_edges(surface.faces), uv)


@pytest.mark.parametrize("seed", range(6))
def test_the_rim_tells_what_the_full_test_tells_of_random_strips(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bend = np.cumsum(np.convolve(rng.normal(0.0, 0.35, 140), np.ones(9) / 3.0, "valid")[:100])
    path = np.cumsum(np.stack([np.cos(bend), np.sin(bend)], axis=1), axis=0)
    surface, uv = strip(99, 2, 0.3, path, 5.0)
    found = rim_overlaps(surface.faces, boundary_edges(surface.faces), uv)
    assert found == (len(overlapping_pairs(uv[surface.faces])) > 0)


def test_a_valid_start_is_its_own_separation() -> None:
    surface, uv = ring(0.9)
    apart = separate(surface, Relaxed(uv, {}), boundary_edges(surface.faces), CONFIG)
    assert apart is not None
    assert np.array_equal(apart.uv, uv)
    assert apart.pins == {}


def test_ends_that_overlap_a_little_are_drawn_apart() -> None:
    surface, uv = ring(1.003)
    edges = boundary_edges(surface.faces)
    assert rim_overlaps(surface.faces, edges, uv)
    apart = separate(surface, Relaxed(uv, {}), edges, CONFIG)
    assert apart is not None
    assert is_valid(surface, apart.uv)
    assert len(apart.pins) > 0
    assert excess_energy(surface, apart.uv) < 0.01 * float(surface.face_areas().sum())


def test_the_windings_of_a_tight_spiral_are_drawn_apart() -> None:
    surface, uv = ring(2.0, columns=160, widening=0.38)
    edges = boundary_edges(surface.faces)
    assert rim_overlaps(surface.faces, edges, uv)
    apart = separate(surface, Relaxed(uv, {}), edges, CONFIG)
    assert apart is not None
    assert is_valid(surface, apart.uv)


@pytest.mark.parametrize("turns", [1.0005, 1.003, 1.01, 1.03, 1.1, 1.4, 2.2])
def test_what_overlaps_is_separated_or_refused(turns: float) -> None:
    surface, uv = ring(turns)
    apart = separate(surface, Relaxed(uv, {}), boundary_edges(surface.faces), CONFIG)
    assert apart is None or is_valid(surface, apart.uv)


def test_a_chart_that_crosses_itself_is_refused() -> None:
    surface, uv = figure_eight()
    assert separate(surface, Relaxed(uv, {}), boundary_edges(surface.faces), replace(CONFIG, rounds=3)) is None


def test_overlap_without_rounds_to_mend_it_is_refused() -> None:
    surface, uv = ring(1.003)
    assert separate(surface, Relaxed(uv, {}), boundary_edges(surface.faces), replace(CONFIG, rounds=0)) is None


def test_separating_writes_neither_to_the_start_nor_to_its_pins() -> None:
    surface, uv = ring(1.003)
    before, pins = uv.copy(), {}
    separate(surface, Relaxed(uv, pins), boundary_edges(surface.faces), CONFIG)
    assert np.array_equal(uv, before)
    assert pins == {}


def test_slim_converges_where_the_goal_is_within_reach() -> None:
    surface, _ = ring(0.4)
    start = circle_start(surface)
    goal = 0.01 * excess_energy(surface, start)
    uv = converge(surface, Relaxed(start, {}), goal, CONFIG)
    assert uv is not None
    assert excess_energy(surface, uv) < goal


def test_slim_gives_up_when_the_goal_is_out_of_sight() -> None:
    """What is already as flat as it gets comes no nearer to zero."""
    surface = cap(0.0)
    flattest = Relaxed(flatten(surface, 40), {})
    assert excess_energy(surface, flattest.uv) > 0.01
    assert converge(surface, flattest, 0.0, CONFIG) is None
    assert converge(surface, flattest, np.inf, CONFIG) is not None


def test_relaxing_returns_the_start_where_the_goal_is_out_of_sight() -> None:
    surface = cap(0.0)
    start = Relaxed(flatten(surface, 40), {})
    assert relax(surface, start, CONFIG, goal=0.0) is start


def test_relaxing_lowers_the_energy_of_a_valid_chart_and_keeps_it_valid() -> None:
    surface = cap(-0.3)
    start = Relaxed(circle_start(surface), {})
    end = relax(surface, start, CONFIG)
    assert is_valid(surface, end.uv)
    assert excess_energy(surface, end.uv) < 0.5 * excess_energy(surface, start.uv)
    assert end.pins == {}


def squeezed_ring() -> tuple[Surface, Relaxed]:
    """A broad ring of 1.006 turns, squeezed into 0.999: a valid start on its way into overlap."""
    return ring(1.006, 40, across=2.0)[0], Relaxed(ring(0.999, 40, across=2.0)[1], {})


@pytest.mark.parametrize("rounds", [0, CONFIG.rounds])
def test_relaxing_never_ends_in_overlap(rounds: int) -> None:
    surface, start = squeezed_ring()
    free = converge(surface, start, np.inf, CONFIG)
    assert free is not None
    assert rim_overlaps(surface.faces, boundary_edges(surface.faces), free)  # else this test shows nothing
    end = relax(surface, start, replace(CONFIG, rounds=rounds))
    assert is_valid(surface, end.uv)
    assert (end is start) == (rounds == 0)
    assert (excess_energy(surface, end.uv) < excess_energy(surface, start.uv)) == (rounds > 0)


def test_contacts_hold_apart_what_would_slide_on_into_overlap() -> None:
    surface, start = squeezed_ring()
    end = relax(surface, start, replace(CONFIG, step=20))
    assert len(end.pins) > 0
    assert is_valid(surface, end.uv)
    assert excess_energy(surface, end.uv) < 0.1 * excess_energy(surface, start.uv)
