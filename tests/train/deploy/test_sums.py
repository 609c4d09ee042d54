"""Sums of nodes are those of a loop, over all rows or some."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.train.deploy.sums import node_sums


@pytest.mark.parametrize("shape", [(), (3,), (2, 3)])
def test_each_node_has_the_sum_of_its_rows(shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(0)
    part, first = rng.standard_normal((20, *shape)), np.array([0, 1, 7, 19])
    chosen = np.flatnonzero(rng.random(20) > 0.5)
    for rows in (None, chosen, chosen[:0]):
        kept = np.arange(20) if rows is None else rows
        nodes = np.split(np.arange(20), first[1:])
        expected = [part[np.intersect1d(node, kept)].sum(axis=0) for node in nodes]
        np.testing.assert_allclose(node_sums(part, first, rows), expected, atol=1e-12)
