"""Nearest neighbours: scipy's k-d tree on the CPU, blocks of distances and top-k on CUDA.

n, m points · d coordinates · j neighbours.  Indices carry no gradient.
"""

from __future__ import annotations

import torch
from scipy.spatial import KDTree
from torch import Tensor

from ...runtime.errors import FlexparaError

DISTANCES = 1 << 27
"""Distances that are held at a time on CUDA (512 MiB)."""


class Neighbourhood:
    """Points that can be asked for the nearest of them: (n, d)."""

    def __init__(self, points: Tensor) -> None:
        self._points = _finite(points.detach().float())
        self._tree = KDTree(self._points.numpy()) if points.device.type == "cpu" else None

    def nearest(self, queries: Tensor, count: int) -> Tensor:
        """Indices (m, count) int64, the nearest first, of the points closest to queries (m, d); count ≤ n.

        Raises:
            FlexparaError: a query is not finite, so training has diverged.
        """
        asked = _finite(queries.detach().float())
        if self._tree is None:
            return _by_blocks(self._points, asked, count)
        _, index = self._tree.query(asked.numpy(), k=count, workers=torch.get_num_threads())
        return torch.from_numpy(index.reshape(len(asked), count))


def own_neighbours(points: Tensor, count: int) -> Tensor:
    """The ``count`` nearest others of each point: (n, d) → (n, min(count, n − 1)) int64.

    Where points coincide, a point may find its twin first and itself second; then the twin counts as itself.
    """
    kept = min(count, len(points) - 1)
    return Neighbourhood(points).nearest(points, kept + 1)[:, 1:]


def _by_blocks(points: Tensor, queries: Tensor, count: int) -> Tensor:
    size = max(1, DISTANCES // len(points))
    found = [torch.cdist(block, points).topk(count, largest=False).indices for block in queries.split(size)]
    return torch.cat(found)


def _finite(points: Tensor) -> Tensor:
    if not torch.isfinite(points).all():
        raise FlexparaError(
            f"{int((~torch.isfinite(points)).any(-1).sum())} of {len(points)} mapped points are not finite, expected "
            "finite numbers: training has diverged; choose a lower rate or dtype float32"
        )
    return points
