"""Equal rows of an array: the labels by which vertices are welded.   n rows · k distinct ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


def equal_rows(rows: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) int64 label in [0, k) of each row of (n, d), equal exactly for equal rows (-0.0 is 0.0)."""
    order = np.lexsort(rows.T)
    new = (np.diff(rows[order], axis=0) != 0).any(axis=1)
    label = np.zeros(len(rows), dtype=np.int64)
    label[order] = np.concatenate([[0], np.cumsum(new)])
    return label


def first_of_each(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k,) int64 index of the first element with each label 0 … k − 1."""
    return np.unique(label, return_index=True)[1].astype(np.int64)


def by_first_appearance(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same classes, numbered in the order in which they first appear."""
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    rank = np.zeros(len(first), dtype=np.int64)
    rank[np.argsort(first)] = np.arange(len(first))
    return rank[inverse]
