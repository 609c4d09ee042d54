"""Growing gated networks: affine maps, steps, sheets, curves, budgets, and what can't be told apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.train.deploy.config import GrowConfig
from flexpara.train.deploy.experts import Lesson, fit_affine
from flexpara.train.deploy.gated import GatedExperts
from flexpara.train.deploy.grow import grow, lay_grid, nearest_cells

PLAIN = GrowConfig()


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def lesson_of(x: NDArray[np.float64], y: NDArray[np.float64], label: NDArray[np.int64] | None = None) -> Lesson:
    """Without slopes and known planes."""
    plain = np.zeros(len(x), dtype=np.int64) if label is None else label
    slope = np.zeros((len(x), y.shape[1], x.shape[1]))
    return Lesson(x, y, plain, slope, np.full((len(x), x.shape[1] + 1), np.nan))


def grown(lesson: Lesson, tolerance: float, config: GrowConfig = PLAIN, seed: int = 0) -> GatedExperts:
    return grow(lesson, config, tolerance, rng(seed))


def square(count: int = 4000, seed: int = 0) -> NDArray[np.float64]:
    """Points of the plane z = 0 over [−1, 1]²."""
    return np.column_stack([rng(seed).uniform(-1.0, 1.0, (count, 2)), np.zeros(count)])


def test_an_affine_map_needs_no_gate_and_is_exact_everywhere() -> None:
    x, slope = square(), np.array([[2.0, -1.0, 0.0], [0.5, 3.0, 0.0]])
    network = grown(lesson_of(x, x @ slope.T + [7.0, -8.0])._replace(slope=np.tile(slope, (len(x), 1, 1))), 1e-3)
    probe = square(500, seed=1)
    assert len(network.gates) == 0
    assert len(network.label) <= PLAIN.coarsest
    assert np.abs(network(probe.astype(np.float32)).value - (probe @ slope.T + [7.0, -8.0])).max() < 1e-5


def test_one_sample_is_enough_and_keeps_its_slope() -> None:
    slope = np.array([[[1.0, 2.0, 0.0], [0.0, 1.0, 0.0]]])
    network = grown(
        Lesson(np.ones((1, 3)), np.array([[5.0, 6.0]]), np.array([2]), slope, np.full((1, 4), np.nan)), 1e-3
    )
    answer = network(np.array([[2.0, 1.0, 1.0]], dtype=np.float32))
    assert answer.value[0] == pytest.approx([6.0, 6.0])
    assert answer.label.tolist() == [2]


def test_every_sample_of_a_curved_map_is_answered_within_the_tolerance() -> None:
    x = square(20_000)
    y = np.column_stack([np.sin(2.0 * x[:, 0]), np.cos(3.0 * x[:, 1])])
    network = grown(lesson_of(x, y), 0.01)
    assert np.linalg.norm(network(x.astype(np.float32)).value - y, axis=1).max() < 0.0101
    assert len(network.label) > 50


def test_a_tighter_tolerance_takes_more_experts() -> None:
    x = square(20_000)
    lesson = lesson_of(x, np.column_stack([np.sin(2.0 * x[:, 0]), np.cos(3.0 * x[:, 1])]))
    assert len(grown(lesson, 0.003).label) > 1.5 * len(grown(lesson, 0.03).label)


@pytest.mark.parametrize("gap", [1e-1, 1e-3, 1e-5])
def test_two_sheets_are_told_apart_however_close(gap: float) -> None:
    x, side = square(8000), np.arange(8000) % 2
    x[:, 2] = gap * side
    network = grown(lesson_of(x, x[:, :2].copy(), side), 1e-3)
    probe = square(2000, seed=1)
    probe[:, 2] = gap * (np.arange(2000) % 2)
    answer = network(probe.astype(np.float32))
    assert (answer.label == np.arange(2000) % 2).all()
    assert answer.score.min() > 0.0


def test_labels_are_told_apart_where_their_outputs_agree() -> None:
    x = square()
    network = grown(lesson_of(x, x[:, :2].copy(), (x[:, 0] > 0.3).astype(np.int64)), 1e-3)
    probe = square(2000, seed=1)
    far = np.abs(probe[:, 0] - 0.3) > 0.05
    assert (network(probe.astype(np.float32)).label == (probe[:, 0] > 0.3))[far].all()


def test_many_labels_cost_little() -> None:
    """A thousand tiles, each with an output of its own."""
    centre = np.stack(np.meshgrid(np.arange(32.0), np.arange(32.0), [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    label = np.repeat(np.arange(1024), 30)
    x = centre[label] + np.column_stack([rng().uniform(-0.4, 0.4, (len(label), 2)), np.zeros(len(label))])
    network = grown(lesson_of(x / 32.0, rng(1).random((1024, 2))[label], label), 1e-3)
    assert (network((x / 32.0).astype(np.float32)).label == label).all()
    assert len(network.label) < 12 * 1024


def test_what_lies_in_the_same_place_cannot_be_told_apart_and_says_so() -> None:
    x, label = square(40_000), rng(3).integers(2, size=40_000)
    network = grown(lesson_of(x, x[:, :2] + 9.0 * label[:, None], label), 1e-3)
    answer = network(x.astype(np.float32))
    assert len(network.label) < 1500
    assert 0.5 < answer.score.mean() < 0.7


def test_two_sides_of_a_slit_in_one_place_are_not_averaged() -> None:
    """One label, outputs of two sides all over each other: each answer is right on one side, and not steep."""
    x, side = square(40_000), rng(3).random(40_000) < 0.4
    lesson = lesson_of(x, x[:, :2] + 9.0 * side[:, None])
    network = grown(lesson._replace(slope=np.tile(np.eye(2, 3), (len(x), 1, 1))), 1e-2)
    answer = network(x.astype(np.float32)).value
    gap = np.minimum(*(np.linalg.norm(answer - x[:, :2] - step, axis=1) for step in (0.0, 9.0)))
    assert np.percentile(gap, 95) < 0.05
    assert np.abs(network.weights[:, :, :3]).max() < 100.0


def test_the_budget_of_experts_is_kept() -> None:
    x = square(20_000)
    lesson = lesson_of(x, np.sin(20.0 * x[:, :2]))
    config = replace(PLAIN, most=200, cells=100)
    assert len(grown(lesson, 1e-4, config).label) <= 200


def test_no_way_is_longer_than_the_deepest_allowed() -> None:
    x = square(20_000)
    network = grown(lesson_of(x, np.sin(20.0 * x[:, :2])), 1e-4, replace(PLAIN, deepest=3, cells=64))
    assert network.depth == 3
    assert (network.route(x.astype(np.float32))[0] >= 0).all()


def test_the_same_seed_gives_the_same_network() -> None:
    x = square()
    lesson = lesson_of(x, np.sin(5.0 * x[:, :2]))
    first, again = grown(lesson, 0.01, seed=4), grown(lesson, 0.01, seed=4)
    assert np.array_equal(first.weights, again.weights)
    assert np.array_equal(first.sides, again.sides)


def test_the_ridge_draws_what_samples_leave_open_towards_the_slope() -> None:
    """Samples on a line say nothing of the slope across it."""
    x = np.column_stack([np.linspace(0.0, 1.0, 9), np.zeros(9), np.zeros(9)])
    lesson = lesson_of(x, 2.0 * x[:, :2])._replace(slope=np.tile([[2.0, 5.0, 0.0], [0.0, 6.0, 0.0]], (9, 1, 1)))
    fitted = fit_affine(lesson, np.array([0]), 1e-3)
    assert fitted.slope[0] == pytest.approx(np.array([[2.0, 5.0, 0.0], [0.0, 6.0, 0.0]]))


def test_without_a_ridge_an_expert_is_least_squares() -> None:
    x, y = rng().random((40, 3)), rng(1).random((40, 2))
    fitted = fit_affine(lesson_of(x, y), np.array([0, 25]), 0.0)
    for i, rows in enumerate((slice(0, 25), slice(25, 40))):
        design = np.column_stack([x[rows], np.ones(len(x[rows]))])
        best = np.linalg.lstsq(design, y[rows], rcond=None)[0]
        assert fitted.slope[i] == pytest.approx(best[:3].T)


def test_cells_are_nearly_cubes_and_as_many_as_allowed() -> None:
    grid = lay_grid(np.array([[0.0, 0.0, 0.0], [8.0, 2.0, 1.0]]), 1000, 512)
    assert 600 < grid.count <= 1000
    assert grid.shape * grid.cell == pytest.approx([8.0, 2.0, 1.0])
    assert grid.cell.max() < 1.3 * grid.cell.min()
    assert lay_grid(np.array([[0.0, 0.0, 0.0], [8.0, 0.0, 0.0]]), 1000, 512).shape.tolist() == [512, 1, 1]


def test_a_cell_without_samples_begins_like_the_nearest() -> None:
    grid = lay_grid(np.array([[0.0, 0.0, 0.0], [10.0, 0.0, 0.0]]), 10, 512)
    assert nearest_cells(grid, np.array([1, 8])).tolist() == [1, 1, 1, 1, 1, 8, 8, 8, 8, 8]
