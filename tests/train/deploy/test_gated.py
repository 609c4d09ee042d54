"""Gated networks made by hand: which expert answers, what it says, and how sure it is."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.train.deploy.gated import GatedExperts, Grid


def f32(values: object) -> NDArray[np.float32]:
    return np.asarray(values, dtype=np.float32)


def by_hand() -> GatedExperts:
    """Two cells along x, [0, 1] and [1, 2]; the second is halved at y = ½, and its upper half at x = 1.5.

    Expert i says 10 · i + x.
    """
    return GatedExperts(
        grid=Grid(f32([0.0, 0.0]), f32([1.0, 1.0]), np.array([2, 1])),
        start=np.array([2, 0], dtype=np.int32),
        gates=f32([[0.0, 1.0, -0.5], [1.0, 0.0, -1.5]]),
        sides=np.array([[3, 1], [4, 5]], dtype=np.int32),
        depth=2,
        weights=f32([[[1.0, 0.0, 10.0 * i]] for i in range(4)]),
        label=np.array([7, 8, 9, 7]),
        centre=f32([[0.5, 0.5], [1.5, 0.25], [1.25, 0.75], [1.75, 0.75]]),
        radius=f32([1.0, 0.5, 0.25, 0.25]),
        share=f32([1.0, 1.0, 0.5, 1.0]),
    )


@pytest.mark.parametrize(
    ("point", "expert"),
    [((0.5, 0.9), 0), ((1.5, 0.2), 1), ((1.2, 0.8), 2), ((1.7, 0.8), 3), ((-9.0, 0.9), 0), ((99.0, 9.0), 3)],
)
def test_a_point_goes_through_its_own_gates(point: tuple[float, float], expert: int) -> None:
    found, _ = by_hand().route(f32([point]))
    assert found.tolist() == [expert]


def test_a_point_on_a_gate_stays_on_the_first_side() -> None:
    assert by_hand().route(f32([[1.2, 0.5], [1.5, 0.75]]))[0].tolist() == [1, 2]


def test_the_answer_is_that_of_the_expert() -> None:
    answer = by_hand()(f32([[0.5, 0.9], [1.7, 0.8]]))
    assert answer.value[:, 0].tolist() == pytest.approx([0.5, 31.7])
    assert answer.label.tolist() == [7, 7]
    assert (answer.value.dtype, answer.label.dtype, answer.score.dtype) == (np.float32, np.int64, np.float32)


def test_the_score_is_the_share_inside_the_ball_and_falls_with_the_square_outside() -> None:
    score = by_hand()(f32([[0.5, 0.5], [1.2, 0.8], [0.5, 2.5]])).score
    assert score.tolist() == pytest.approx([1.0, 0.5, 0.25])


def test_the_margin_is_the_distance_from_the_nearest_gate_on_the_way() -> None:
    _, margin = by_hand().route(f32([[0.5, 0.5], [1.2, 0.6], [1.6, 0.9]]))
    assert margin.tolist() == pytest.approx([np.inf, 0.1, 0.1])


def test_no_point_and_one_point_and_many_give_the_same_answers() -> None:
    network, points = by_hand(), np.random.default_rng(0).uniform(-1.0, 3.0, (200, 2)).astype(np.float32)
    assert network(points[:0]).value.shape == (0, 1)
    every = network(points)
    for i in (0, 17, 199):
        one = network(points[i : i + 1])
        assert all(np.array_equal(part[0], whole[i]) for part, whole in zip(one, every, strict=True))


def test_cells_are_numbered_with_the_last_axis_fastest_and_clamped() -> None:
    grid = Grid(f32([0.0, 0.0, 0.0]), f32([0.5, 0.5, 0.5]), np.array([2, 3, 4]))
    points = f32([[0.0, 0.0, 0.0], [0.0, 0.0, 0.6], [0.0, 0.6, 0.0], [0.6, 0.0, 0.0], [-5.0, 9.0, 9.0]])
    assert grid.count == 24
    assert grid.number(points).tolist() == [0, 1, 4, 12, 11]


def test_the_margin_of_a_grid_counts_inner_sides_alone() -> None:
    grid = Grid(f32([0.0]), f32([0.5]), np.array([4]))
    assert grid.margin(f32([[0.01], [0.49], [1.02], [1.99]])).tolist() == pytest.approx([np.inf, 0.01, 0.02, np.inf])
