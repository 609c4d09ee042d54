"""Equal rows of an array: the labels by which vertices are welded.   n rows · k distinct ones."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from .topology import stable_order

if TYPE_CHECKING:
    from numpy.typing import NDArray


def equal_rows(rows: NDArray[np.float64] | NDArray[np.int64]) -> NDArray[np.int64]:
    """(n,) int64 label in [0, k) of each row of (n, d), equal exactly for equal rows (-0.0 is 0.0).

    Labels ascend with the rows, the last column first.
    """
    key = keys(rows.astype(np.int64, copy=False)) if rows.dtype == np.int64 and len(rows) else None
    if key is not None:
        order = stable_order(*key)
        new = np.diff(key[0][order]) != 0
    else:
        order = np.lexsort(rows.T)
        new = (np.diff(rows[order], axis=0) != 0).any(axis=1)
    label = np.zeros(len(rows), dtype=np.int64)
    label[order] = np.concatenate([[0], np.cumsum(new)])
    return label


def keys(rows: NDArray[np.int64]) -> tuple[NDArray[np.int64], int] | None:
    """A number (n,) for each row (n, d), ascending as rows do from the last column on, and a bound of them.

    One sort of numbers takes a fraction of the time that a sort by several columns takes.  None where 63 bits don't
    hold them.
    """
    least = rows.min(axis=0)
    bounds = [int(most) - int(low) + 1 for low, most in zip(least, rows.max(axis=0), strict=True)]
    if math.prod(bounds) > np.iinfo(np.int64).max:
        return None
    key = np.zeros(len(rows), dtype=np.int64)
    for column in range(rows.shape[1] - 1, -1, -1):
        key *= bounds[column]
        key += rows[:, column] - least[column]
    return key, math.prod(bounds)


def grouped(label: NDArray[np.int64], count: int = 0) -> list[NDArray[np.int64]]:
    """Rows of each label 0, 1, …, ascending; of ``count`` labels at least.  label: (n,)."""
    order, ends = stable_order(label, int(label.max(initial=0)) + 1), np.cumsum(np.bincount(label, minlength=count))
    return [order[begin:end] for begin, end in zip([0, *ends.tolist()], ends.tolist(), strict=False)]


def first_of_each(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """(k,) int64 index of the first element with each label 0 … k − 1."""
    first = first_places(label)
    return first[first < len(label)]


def by_first_appearance(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """The same classes (n,), numbers from 0 on, numbered in the order in which they first appear."""
    first = first_places(label)
    used = np.flatnonzero(first < len(label))
    rank = np.zeros(len(first), dtype=np.int64)
    rank[used[np.argsort(first[used])]] = np.arange(len(used))
    return rank[label]


def first_places(label: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of each number up to the highest the first place in a label (n,) where it stands, n where it does not."""
    first = np.full(int(label.max(initial=-1)) + 1, len(label))
    first[label[::-1]] = np.arange(len(label) - 1, -1, -1)  # of several the last one written stays
    return first


def compacted(index: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The different numbers (k,) in an array of any shape, from 0 on and ascending, and the array as places in them.

    ``np.unique`` with its inverse, without a sort.
    """
    there = np.zeros(int(index.max(initial=-1)) + 1, dtype=bool)
    there[index] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[index]


def distinct(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """``np.unique`` of many numbers (n,), by a sort: by a table of hashes numpy takes ten times as long."""
    values = np.sort(values)
    return values[np.append(True, values[1:] != values[:-1])[: len(values)]]
