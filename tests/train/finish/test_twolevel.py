"""Conjugate gradients with a coarse level: the solution of a direct solve, in steps that the size does not decide."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import sparse

from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.train.finish import twolevel
from flexpara.train.finish.twolevel import TwoLevel


def chain(count: int) -> sparse.csr_array:
    """The stiffness of a chain held lightly at its first node."""
    row = np.arange(count - 1)
    entries = np.r_[-np.ones(count - 1), np.ones(count - 1)], (np.r_[row, row], np.r_[row, row + 1])
    bonds = sparse.csr_array(entries, shape=(count - 1, count))
    held = sparse.csr_array(([1e-3], ([0], [0])), shape=(count, count))
    return sparse.csr_array(bonds.T @ bonds + held)


def direct(matrix: sparse.csr_array, right: np.ndarray) -> np.ndarray:
    return np.linalg.solve(matrix.toarray(), right)


def hats(count: int, spacing: int) -> sparse.csr_array:
    """Weights of every ``spacing``-th node, linear between them."""
    place = np.arange(count) / spacing
    left = np.floor(place).astype(np.int64)
    share = place - left
    rows = np.r_[np.arange(count), np.arange(count)]
    return sparse.csr_array((np.r_[1.0 - share, share], (rows, np.r_[left, left + 1])), shape=(count, left.max() + 2))


def steps_of(count: int, monkeypatch: pytest.MonkeyPatch) -> int:
    steps = []
    plain = TwoLevel.preconditioned
    monkeypatch.setattr(TwoLevel, "preconditioned", lambda self, r: steps.append(1) or plain(self, r))
    solver = TwoLevel(chain(count), hats(count, 8)[:, :-1] if (count - 1) % 8 == 0 else hats(count, 8), 1e-8, 500)
    right = np.random.default_rng(0).normal(size=(count, 1))
    solver.solve(right, None, float(np.linalg.norm(right)))
    monkeypatch.undo()
    return len(steps)


@pytest.mark.parametrize("columns", [1, 2])
def test_the_solution_is_that_of_a_direct_solve(columns: int) -> None:
    matrix, right = chain(97), np.random.default_rng(1).normal(size=(97, columns))
    found = TwoLevel(matrix, hats(97, 8)[:, :-1], 1e-12, 500).solve(right, None, float(np.linalg.norm(right)))
    np.testing.assert_allclose(found, direct(matrix, right), rtol=1e-6, atol=1e-6)


def test_a_start_at_the_solution_stays_there() -> None:
    matrix, right = chain(97), np.ones((97, 2))
    exact = direct(matrix, right)
    found = TwoLevel(matrix, hats(97, 8)[:, :-1], 1e-6, 500).solve(right, exact, float(np.linalg.norm(right)))
    assert np.array_equal(found, exact)


def test_ten_times_the_size_takes_hardly_more_steps(monkeypatch: pytest.MonkeyPatch) -> None:
    assert steps_of(4001, monkeypatch) < 1.5 * steps_of(401, monkeypatch)


def test_no_more_steps_are_made_than_allowed() -> None:
    right = np.random.default_rng(2).normal(size=(97, 1))
    one, all_of_them = (
        TwoLevel(chain(97), hats(97, 8)[:, :-1], 1e-12, most).solve(right, None, 1.0) for most in (1, 500)
    )
    assert np.abs(one - all_of_them).max() > 1e-3


def test_the_kernel_solves_as_its_twin_does_and_leaves_what_is_given() -> None:
    if kernel() is None:
        pytest.skip("nothing was compiled")
    matrix, right = chain(401), np.random.default_rng(3).normal(size=(401, 2))
    start, size = np.zeros_like(right), float(np.linalg.norm(right))
    found = TwoLevel(matrix, hats(401, 8)[:, :-1], 1e-11, 500).solve(right, start, size)
    with twins_only():
        expected = TwoLevel(matrix, hats(401, 8)[:, :-1], 1e-11, 500).solve(right, start, size)
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6)
    assert not start.any()
    assert np.linalg.norm(right - matrix @ found) <= 1e-9 * size


def test_threads_change_no_bit(monkeypatch: pytest.MonkeyPatch) -> None:
    if kernel() is None:
        pytest.skip("nothing was compiled")
    count = 40_001  # several blocks
    matrix, right = chain(count), np.random.default_rng(4).normal(size=(count, 2))
    found = []
    for threads in (1, 2, 4):
        monkeypatch.setattr(twolevel, "core_count", lambda threads=threads: threads)
        found.append(TwoLevel(matrix, hats(count, 8)[:, :-1], 1e-6, 50).solve(right, None, 1.0))
    assert np.array_equal(found[0], found[1])
    assert np.array_equal(found[0], found[2])


def test_rows_that_pull_at_others_of_another_block_do_not_end_it() -> None:
    """Slivers link rows by weights of either sign: a hub, 18,000 rows around it, and in each triangle a row beyond."""
    count = 9_000
    pair, beyond = 1 + np.arange(2 * count), 1 + 2 * count + np.arange(count)
    rows = np.concatenate([np.zeros(2 * count, np.int64), pair[::2], pair[::2], pair[1::2]])
    columns = np.concatenate([pair, pair[1::2], beyond, beyond])
    value = np.concatenate([np.full(2 * count, -1e-6), np.full(3 * count, 0.9)])
    upper = sparse.csr_array((value, (rows, columns)), shape=(3 * count + 1, 3 * count + 1))
    matrix = sparse.csr_array(upper + upper.T + sparse.eye_array(3 * count + 1))
    right = np.random.default_rng(5).normal(size=(3 * count + 1, 2))
    found = TwoLevel(matrix, sparse.csr_array(np.ones((3 * count + 1, 1))), 1e-10, 500).solve(right, None, 1.0)
    assert np.linalg.norm(right - matrix @ found) <= 1e-9


def test_levels_between_keep_the_steps_few_where_the_coarse_level_has_few_unknowns() -> None:
    if kernel() is None:
        pytest.skip("nothing was compiled")
    side, spacing = 241, 20
    line, whole = chain(side), sparse.eye_array(side)
    matrix = sparse.csr_array(sparse.kron(line, whole) + sparse.kron(whole, line))
    coarse = sparse.csr_array(sparse.kron(*[hats(side, spacing)[:, :-1]] * 2))
    exact = np.random.default_rng(6).normal(size=(side * side, 2)).cumsum(axis=0)
    right = matrix @ exact
    size = float(np.linalg.norm(right))
    found = TwoLevel(matrix, coarse, 1e-9, 16).solve(right, None, size)
    assert np.linalg.norm(right - matrix @ found) <= 1e-5 * size
