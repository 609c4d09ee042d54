"""Gates: the plane across a rod, between two sheets, along a seam; and their squared error against numpy's."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.train.deploy.gates import Spread, best_gates, fisher_gates, known_gates, principal_gates, second_side


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def spread_of(
    *nodes: tuple[NDArray[np.float64], NDArray[np.float64]], plane: NDArray[np.float64] | None = None
) -> Spread:
    """Nodes of samples (x, y); no plane is known unless it is given for all samples."""
    x, y = (np.concatenate([node[i] - node[i].mean(axis=0) for node in nodes]) for i in (0, 1))
    sizes = np.array([len(node[0]) for node in nodes])
    unknown = np.full((len(x), x.shape[1] + 1), np.nan)
    mean = np.stack([node[0].mean(axis=0) for node in nodes])
    inputs = np.concatenate([node[0] for node in nodes])
    return Spread(x, y, unknown if plane is None else plane, np.cumsum(sizes) - sizes, mean, inputs)


def sheets(gap: float, count: int = 200) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Two sheets that lean by 45°, ``gap`` apart along z; their outputs are far apart."""
    xy = rng().uniform(-1.0, 1.0, (count, 2))
    upper = np.arange(count) % 2
    x = np.column_stack([xy, xy[:, 0] + gap * upper])
    return x + np.array([5.0, 6.0, 7.0]), np.column_stack([xy[:, 0] + 40.0 * upper, xy[:, 1]])


def test_the_principal_gate_halves_a_rod_across_its_length() -> None:
    along = np.linspace(-1.0, 1.0, 50)
    x = np.outer(along, [3.0, 4.0, 0.0]) + np.array([1.0, 2.0, 3.0])
    (plane,) = principal_gates(spread_of((x, x[:, :2])))
    assert np.abs(plane[:3]) == pytest.approx([0.6, 0.8, 0.0])
    assert second_side(plane[None].repeat(50, axis=0), x).sum() == 25


@pytest.mark.parametrize("gap", [1.0, 1e-2, 1e-4])
def test_fishers_gate_is_the_plane_between_two_sheets(gap: float) -> None:
    x, y = sheets(gap)
    (plane,) = fisher_gates(spread_of((x, y)))
    assert np.abs(plane[:3]) == pytest.approx(np.sqrt([0.5, 0.0, 0.5]), abs=1e-3)
    second = second_side(plane[None].repeat(len(x), axis=0), x)
    assert second.tolist() in ((y[:, 0] > 20.0).tolist(), (y[:, 0] < 20.0).tolist())


def test_nodes_do_not_disturb_each_other() -> None:
    nodes = [sheets(gap) for gap in (1.0, 0.1, 0.01)]
    makers: list[Callable[[Spread], NDArray[np.float64]]] = [principal_gates, fisher_gates]
    for make in makers:
        together = make(spread_of(*nodes))
        assert np.allclose(together, np.concatenate([make(spread_of(node)) for node in nodes]))


def test_a_node_without_a_known_plane_gets_none() -> None:
    first, second = sheets(1.0, 20), sheets(1.0, 30)
    plane = np.full((50, 4), np.nan)
    plane[31] = [1.0, 0.0, 0.0, -5.0]
    picks = list(known_gates(spread_of(first, second, plane=plane), 3, rng()))
    assert len(picks) == 3
    for pick in picks:
        assert np.isnan(pick[0]).all()
        assert pick[1].tolist() == [1.0, 0.0, 0.0, -5.0]


def squared_error(x: NDArray[np.float64], y: NDArray[np.float64]) -> float:
    """Of the best affine map, by numpy."""
    design = np.column_stack([x, np.ones(len(x))])
    return float(((y - design @ np.linalg.lstsq(design, y, rcond=None)[0]) ** 2).sum())


def test_the_error_before_and_behind_the_best_gate_is_numpys() -> None:
    x = rng(1).uniform(-1.0, 1.0, (300, 3))
    y = np.column_stack([np.sin(3.0 * x[:, 0]), x[:, 1] * x[:, 2]])
    chosen = best_gates(spread_of((x, y)), 0, 0.0, rng())
    second = second_side(chosen.plane.repeat(300, axis=0), x)
    assert chosen.before[0] == pytest.approx(squared_error(x, y), rel=1e-3)
    parts = squared_error(x[second], y[second]) + squared_error(x[~second], y[~second])
    assert chosen.left[0] == pytest.approx(parts, rel=1e-3)
    assert chosen.left[0] < chosen.before[0]


def test_the_plane_of_a_seam_is_taken_where_it_parts_best() -> None:
    x = np.column_stack([rng(2).uniform(-1.0, 1.0, (400, 2)), np.zeros(400)])
    seam = np.array([0.8, -0.6, 0.0, -0.123])
    beyond = x @ seam[:3] + seam[3] > 0.0
    y = x[:, :2] + 30.0 * beyond[:, None]
    chosen = best_gates(spread_of((x, y), plane=np.tile(seam, (400, 1))), 4, 0.0, rng())
    assert chosen.plane[0] == pytest.approx(seam, abs=1e-6)
    assert chosen.left[0] < 1e-6 * chosen.before[0]


def test_samples_at_one_point_have_no_gate() -> None:
    x, y = np.ones((5, 3)), rng().random((5, 2))
    chosen = best_gates(spread_of((x, y), sheets(1.0, 40)), 2, 0.0, rng())
    assert np.isinf(chosen.left[0])
    assert np.isfinite(chosen.left[1])


def test_a_gate_leaves_samples_on_both_sides_by_the_inputs_themselves() -> None:
    """All samples lie in a seam's plane: a mean taken off and put back would round some of them across it."""
    seam = np.array([1.0, 3.0, 5.0, 7.0])
    x = rng().uniform(-20.0, 0.0, (400, 3))
    x[:, 2] = -(x[:, :2] @ seam[:2] + seam[3]) / seam[2]
    x = x[~second_side(np.tile(seam, (len(x), 1)), x)]
    known = np.tile(seam, (len(x), 1))
    across = second_side(known, x - x.mean(axis=0) + x.mean(axis=0))
    assert across.any()
    y = np.column_stack([x[:, 0], 40.0 * across.astype(np.float64)])
    chosen = best_gates(spread_of((x, y), plane=known), 1, 1e-6, rng())
    assert 0 < second_side(chosen.plane.repeat(len(x), axis=0), x).sum() < len(x)
