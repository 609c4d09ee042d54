"""An atlas as torch tensors, as nvdiffrast takes them."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch

if TYPE_CHECKING:
    from ..runtime.mesh import Atlas


class Tensors(NamedTuple):
    """positions (n, 3), uv (n, 2) v up, normals (n, 3) float32; faces (f, 3) int32; source_vertex (n,) int64."""

    positions: torch.Tensor
    faces: torch.Tensor
    uv: torch.Tensor
    normals: torch.Tensor
    source_vertex: torch.Tensor


def as_tensors(atlas: Atlas, device: str) -> Tensors:
    """Copies of the atlas's arrays on a device, contiguous."""

    def moved(array: np.ndarray, kind: type[np.generic]) -> torch.Tensor:
        return torch.from_numpy(np.array(array, dtype=kind, order="C")).to(device)

    return Tensors(
        moved(atlas.positions, np.float32),
        moved(atlas.faces, np.int32),
        moved(atlas.uv, np.float32),
        moved(atlas.normals, np.float32),
        moved(atlas.source_vertex, np.int64),
    )
