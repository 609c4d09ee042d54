"""What the paper's training sees: the input as tensors, and the part of it that one step uses.

n points of the input · b points of a step · t triangles · e edges · j neighbours · xyz in the unit ball.
The paper feeds all V vertices every step.  So do we up to ``PaperConfig.points``; beyond, each step draws b points: the
corners of random triangles (or the ends of random neighbour pairs of a cloud), filled up with other random points, all
distinct and always b of them, so that every loss finds what it needs among the same points.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import torch
from torch import Tensor

from ...runtime.errors import MeshError, ShapeError
from .losses import corner_angles
from .neighbours import Neighbourhood, own_neighbours

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import PaperConfig


@dataclass(frozen=True, eq=False)
class PaperInput:
    """A surface as the paper's method takes it, in the unit ball.

    points: (n, 3) float64, n ≥ 16, finite.  normals: (n, 3) float64 unit, or None: the normal term falls away.
    faces: (f, 3) int64 into points, or None for a point cloud: the triangle term falls away, and the isometric loss of
    the multi-chart mode uses pairs of neighbours.

    Raises:
        ShapeError: an array has another shape.
        MeshError: too few points, a number that is not finite, or a face that names no point.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64] | None = None
    faces: NDArray[np.int64] | None = None

    def __post_init__(self) -> None:
        """Check what training relies on."""
        if self.points.ndim != 2 or self.points.shape[1] != 3:
            raise ShapeError(f"points have shape {self.points.shape}, expected (n, 3); pass one row a point")
        if len(self.points) < 16:
            raise MeshError(f"{len(self.points)} points, expected at least 16; sample the surface more densely")
        if self.normals is not None and self.normals.shape != self.points.shape:
            raise ShapeError(f"normals have shape {self.normals.shape}, expected {self.points.shape}; pass one a point")
        if not all(np.isfinite(part).all() for part in (self.points, self.normals) if part is not None):
            raise MeshError("points or normals are not all finite, expected finite numbers; clean the input")
        faces = self.faces
        if faces is not None and (faces.ndim != 2 or faces.shape[1] != 3 or len(faces) == 0):
            raise ShapeError(f"faces have shape {faces.shape}, expected (f, 3); pass None for a point cloud")
        if faces is not None and not (faces.min() >= 0 and faces.max() < len(self.points)):
            raise MeshError(f"a face names a point outside 0 … {len(self.points) - 1}; pass faces of these points")

    def sha256(self) -> str:
        """Hex digest of the arrays, for checkpoints."""
        digest = hashlib.sha256()
        for part, kind in ((self.points, "<f8"), (self.normals, "<f8"), (self.faces, "<i8")):
            digest.update(b"none" if part is None else str(part.shape).encode() + part.astype(kind).tobytes())
        return digest.hexdigest()


@dataclass(frozen=True, eq=False)
class Batch:
    """The part of the input that one step uses.

    xyz (b, 3) float32.  normal (b, 3) or None.  triangles (t, 3) int64 into b, or None, with their angles (t, 3) in
    radians.  edges (e, 2) int64 into b with lengths (e,).  lattice (m, 2) float32 in [−1, 1]².
    all_xyz (n, 3): the whole input, near: the same, ready to be asked for neighbours.  edge_total: edges of the whole
    input, each counted once a triangle.
    """

    xyz: Tensor
    normal: Tensor | None
    triangles: Tensor | None
    angles: Tensor | None
    edges: Tensor
    lengths: Tensor
    lattice: Tensor
    all_xyz: Tensor
    near: Neighbourhood
    edge_total: int


class BatchSource:
    """Draws batches; all chance comes from the generator given to ``draw``."""

    def __init__(self, samples: PaperInput, config: PaperConfig, device: torch.device) -> None:
        points = torch.from_numpy(np.ascontiguousarray(samples.points, dtype=np.float64))
        self._xyz = points.float().to(device)
        self._normal = None if samples.normals is None else torch.from_numpy(samples.normals).float().to(device)
        self._device, self._count = device, min(config.points, len(points))
        if samples.faces is None:
            self._groups, self._angles = cloud_edges(points, config.edge_neighbours), None
        else:
            self._groups = torch.from_numpy(np.ascontiguousarray(samples.faces, dtype=np.int64))
            self._angles = corner_angles(points[self._groups]).float()
        self._near = Neighbourhood(self._xyz)
        whole = self._count == len(points)
        self._whole = self._assemble(torch.arange(len(points)), None, torch.zeros(2)) if whole else None

    def draw(self, generator: torch.Generator) -> Batch:
        """The next batch; where it is the whole input, nothing is drawn."""
        if self._whole is not None:
            return self._whole
        most = self._count // self._groups.shape[1]
        pick = torch.randint(len(self._groups), (most,), generator=generator)
        corners = torch.unique(self._groups[pick])
        others = torch.ones(len(self._xyz), dtype=torch.bool)
        others[corners] = False
        free = torch.nonzero(others)[:, 0]
        fill = free[torch.randperm(len(free), generator=generator)[: self._count - len(corners)]]
        return self._assemble(torch.cat([corners, fill]), pick, torch.rand(2, generator=generator) - 0.5)

    def _lattice(self, shift: Tensor) -> Tensor:
        """G, (m, 2)."""
        side = math.isqrt(self._count)
        line = (torch.arange(side) + 0.5 + shift[:, None]) / side * 2.0 - 1.0
        if self._count == len(self._xyz):
            line = torch.linspace(-1.0, 1.0, side).expand(2, -1)
        return torch.cartesian_prod(*line).to(self._device)

    def _assemble(self, index: Tensor, pick: Tensor | None, shift: Tensor) -> Batch:
        """Batch of the points ``index`` (b,) with the groups ``pick``, or all, and a lattice moved by ``shift``."""
        place = torch.zeros(len(self._xyz), dtype=torch.int64)
        place[index] = torch.arange(len(index))
        groups = place[self._groups if pick is None else self._groups[pick]].to(self._device)
        xyz = self._xyz[index.to(self._device)]
        edges, total = groups, len(self._groups)
        triangles = angles = None
        if self._angles is not None:
            angles = (self._angles if pick is None else self._angles[pick]).to(self._device)
            triangles, edges = groups, torch.cat([groups[:, [0, 1]], groups[:, [1, 2]], groups[:, [2, 0]]])
            total = 3 * total
        lengths = (xyz[edges[:, 0]] - xyz[edges[:, 1]]).norm(dim=1)
        normal = None if self._normal is None else self._normal[index.to(self._device)]
        lattice = self._lattice(shift)
        return Batch(xyz, normal, triangles, angles, edges, lengths, lattice, self._xyz, self._near, total)


def cloud_edges(points: Tensor, count: int) -> Tensor:
    """Each point of a cloud with its ``count`` nearest others: (n, 3) → (n · count, 2) int64 (decided).

    As in the sum over triangles, most edges are counted twice.
    """
    near = own_neighbours(points, count)
    start = torch.arange(len(points))[:, None].expand_as(near)
    return torch.stack([start.reshape(-1), near.reshape(-1)], dim=1)
