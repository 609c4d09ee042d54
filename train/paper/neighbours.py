"""Nearest neighbours: scipy's k-d tree on the CPU, blocks of distances and top-k on CUDA.

n, m points · p charts · d coordinates · j neighbours.  Indices carry no gradient.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

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

    def nearest(self, queries: Tensor, count: int, *, workers: int | None = None) -> Tensor:
        """Indices (m, count) int64, the nearest first, of the points closest to queries (m, d); count ≤ n.

        workers: threads of the tree; None: as many as torch uses.

        Raises:
            FlexparaError: a query is not finite, so training has diverged.
        """
        asked = _finite(queries.detach().float())
        if self._tree is None:
            return _by_blocks(self._points, asked, count)
        _, index = self._tree.query(asked.numpy(), k=count, workers=workers or torch.get_num_threads())
        return torch.from_numpy(index.reshape(len(asked), count))


def own_neighbours(points: Tensor, count: int, *, workers: int | None = None) -> Tensor:
    """The ``count`` nearest others of each point: (n, d) → (n, min(count, n − 1)) int64.

    Where points coincide, a point may find its twin first and itself second; then the twin counts as itself.
    """
    kept = min(count, len(points) - 1)
    return Neighbourhood(points).nearest(points, kept + 1, workers=workers)[:, 1:]


def chart_neighbours(points: Tensor, count: int) -> Tensor:
    """`own_neighbours` of each chart by itself, all at once: (p, n, d) → (p, n, min(count, n − 1)) int64."""
    if points.device.type != "cpu":
        flat = _finite(points.detach().float())
        return _by_blocks(flat, flat, min(count, flat.shape[1] - 1) + 1)[..., 1:]
    with ThreadPoolExecutor(torch.get_num_threads()) as pool:
        near = pool.map(lambda flat: own_neighbours(flat, count, workers=1), points.detach().unbind())
        return torch.stack(list(near))


def _by_blocks(points: Tensor, queries: Tensor, count: int) -> Tensor:
    """Of (…, n, d) and (…, m, d): (…, m, count) int64, by whole distance matrices of so many queries at a time."""
    size = max(1, DISTANCES // points[..., 0].numel())
    blocks = queries.split(size, dim=-2)
    found = [torch.cdist(block, points).topk(count, largest=False).indices for block in blocks]
    return torch.cat(found, dim=-2)


def _finite(points: Tensor) -> Tensor:
    if not torch.isfinite(points).all():
        raise FlexparaError(
            f"{int((~torch.isfinite(points)).any(-1).sum())} of {len(points)} mapped points are not finite, expected "
            "finite numbers: training has diverged; choose a lower rate or dtype float32"
        )
    return points
