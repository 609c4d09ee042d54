"""As-rigid-as-possible flattening: each triangle's own rotation and one sparse solve, in turn, factorized once.

Sorkine & Alexa 2007; Liu et al. 2008 (A local/global approach to mesh parameterization).  v vertices · f faces.
uv in the surface's units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ...runtime.geometry.overlap import flipped_triangles
from ...runtime.geometry.topology import within_rings
from ...runtime.kernel.choice import kernel
from ...runtime.process.cores import core_count
from .curvature import factorize

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from .flatten import Pins

    Solve = Callable[[NDArray[np.float64], NDArray[np.float64] | None, float], NDArray[np.float64]]
    """Right sides (v, 2), where to start from, and the size that a residual is a share of → unknowns (v, 2)."""

PIN = 1e-6
"""Weight that holds one vertex in place, as a share of the mean diagonal: the energy leaves the whole's place open.

No setting: any weight gives the same shape, as the pinned vertex gets there at no cost to the rest."""


def factorized(matrix: sparse.csr_array) -> Solve:
    """Solves by factors of the matrix; where a solve starts from plays no part."""
    solver = factorize(matrix)
    return lambda right, _start, _size: solver.solve(np.ascontiguousarray(right))


class Slopes:
    """Gradients G of a piece's faces, and their areas W."""

    def __init__(self, surface: Surface) -> None:
        self.gradient = gradient(surface)
        self.weight = np.tile(surface.face_areas(), 2)

    @staticmethod
    def of(surface: Surface) -> Slopes:
        """The slopes of a piece."""
        return Compiled(surface) if kernel() else Slopes(surface)

    def stiffness(self) -> sparse.csr_array:
        """(v, v) Gᵀ W G."""
        return sparse.csr_array(self.gradient.T @ sparse.diags_array(self.weight) @ self.gradient)

    def jacobians(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(f, 2, 2) of uv (v, 2)."""
        return np.stack(np.split(self.gradient @ uv, 2), axis=2)

    def right(self, turn: NDArray[np.float64]) -> NDArray[np.float64]:
        """(v, 2) Gᵀ W turn of Jacobians turn (f, 2, 2)."""
        return self.gradient.T @ (np.concatenate([turn[:, :, 0], turn[:, :, 1]]) * self.weight[:, None])


class Compiled(Slopes):
    """The same by the kernel."""

    def __init__(self, surface: Surface) -> None:
        compiled = kernel()
        assert compiled is not None
        self._rigid = compiled.Rigid(surface.vertices, surface.faces, core_count())
        self.count = len(surface.vertices)

    def stiffness(self) -> sparse.csr_array:
        """As above."""
        return sparse.csr_array(self._rigid.stiffness(), shape=(self.count, self.count))

    def jacobians(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """As above."""
        return self._rigid.jacobians(uv)

    def right(self, turn: NDArray[np.float64]) -> NDArray[np.float64]:
        """As above."""
        return self._rigid.right(turn)


class RigidSteps:
    """The local and global steps for one piece."""

    def __init__(
        self,
        surface: Surface,
        solver: Callable[[sparse.csr_array], Solve] = factorized,
        pins: Pins | None = None,
    ) -> None:
        """``solver``: of the one matrix of all steps.  ``pins`` draw their vertices to their places."""
        self.surface = surface
        self.slopes = Slopes.of(surface)
        matrix = self.slopes.stiffness()
        held = np.zeros(len(surface.vertices))
        held[0] = PIN * matrix.diagonal().mean()
        self.pull = np.zeros((len(surface.vertices), 2))
        if pins is not None:
            held[pins.vertex] += pins.weight
            self.pull[pins.vertex] = pins.weight * pins.place
        self.system = solver((matrix + sparse.diags_array(held)).tocsr())

    def jacobians(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(f, 2, 2) as ``flatten.jacobians`` of uv (v, 2), from the gradients that are there."""
        return self.slopes.jacobians(uv)

    def solve(self, turn: NDArray[np.float64], start: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
        """Uv (v, 2) whose Jacobians are nearest to turn (f, 2, 2), rotations mostly, weighted by area.

        ``start`` (v, 2): where a solver that needs steps begins.
        """
        right = self.slopes.right(turn)
        return self.system(right + self.pull, start, float(np.linalg.norm(right)))

    def run(
        self, turn: NDArray[np.float64], steps: int, start: NDArray[np.float64] | None = None
    ) -> NDArray[np.float64]:
        """Uv (v, 2) after ``steps`` from rotations turn (f, 2, 2)."""
        uv = self.solve(turn, start)
        for _ in range(steps - 1):
            uv = self.solve(nearest_rotations(self.jacobians(uv)), uv)
        return uv


def gradient(surface: Surface) -> sparse.csr_array:
    """(2f, v): derivatives along the two axes of each face, as ``flatten.jacobians`` takes them; first axes first."""
    corner, faces = surface.triangles, surface.faces
    e1, e2 = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    length = np.maximum(np.linalg.norm(e1, axis=1), 1e-300)
    height = np.maximum(np.linalg.norm(np.cross(e1, e2), axis=1) / length, 1e-300)
    along = np.einsum("fc,fc->f", e1, e2) / length
    row, shape = np.arange(len(faces)), (len(faces), len(surface.vertices))
    slope = along / length / height
    columns = np.concatenate([faces[:, 0], faces[:, 1]])
    first = sparse.coo_array((np.r_[-1.0 / length, 1.0 / length], (np.r_[row, row], columns)), shape=shape)
    values = np.r_[slope - 1.0 / height, -slope, 1.0 / height]
    second = sparse.coo_array((values, (np.r_[row, row, row], faces.T.reshape(-1))), shape=shape)
    return sparse.csr_array(sparse.vstack([first, second]))


def nearest_rotations(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 2, 2) the rotation nearest to each Jacobian, also where that is flipped; the identity for a zero."""
    cosine = jacobian[:, 0, 0] + jacobian[:, 1, 1]
    sine = jacobian[:, 1, 0] - jacobian[:, 0, 1]
    size = np.hypot(cosine, sine)
    cosine, sine = np.where(size > 0.0, cosine, 1.0), np.where(size > 0.0, sine, 0.0)
    size = np.where(size > 0.0, size, 1.0)
    return np.stack([np.stack([cosine, -sine], axis=1), np.stack([sine, cosine], axis=1)], axis=1) / size[:, None, None]


def unfolded(surface: Surface, uv: NDArray[np.float64], steps: int) -> NDArray[np.float64] | None:
    """Uv without flips, from one with some, by rigid steps and then by evening out around those left.

    None where ``steps`` of either don't suffice.
    """
    rigid = RigidSteps(surface)
    for _ in range(steps):
        uv = rigid.solve(nearest_rotations(rigid.jacobians(uv)))
        if not np.isfinite(uv).all():
            return None
        if not flipped_triangles(uv[surface.faces]).any():
            return uv
    return evened_out(surface.faces, uv, steps)


def evened_out(faces: NDArray[np.int64], uv: NDArray[np.float64], steps: int) -> NDArray[np.float64] | None:
    """Uv without flips: vertices of flipped faces (f, 3) inside the piece go to the mean of their neighbours.

    Each step looks a ring further around what is still flipped.  None where ``steps`` don't suffice.
    """
    flipped = flipped_triangles(uv[faces])
    if not flipped.any():
        return uv
    part = faces[within_rings(faces, flipped, len(uv), 2 * steps)]
    mean, border = neighbour_means(part, len(uv))
    loose = np.zeros(len(uv), dtype=bool)
    for _ in range(steps):
        flipped = flipped_triangles(uv[part])
        if not flipped.any():
            return uv
        loose[part[flipped]] = True
        loose[part[loose[part].any(axis=1)]] = True
        loose[border] = False
        moved = np.flatnonzero(loose)
        rows, uv = mean[moved], uv.copy()
        for _ in range(steps):
            uv[moved] = rows @ uv
    return None if flipped_triangles(uv[part]).any() else uv


def neighbour_means(faces: NDArray[np.int64], count: int) -> tuple[sparse.csr_array, NDArray[np.int64]]:
    """(v, v) weights that give each of ``count`` vertices the mean of its neighbours; those on the border."""
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    links = sparse.csr_array((np.ones(len(start)), (start, end)), shape=(count, count))
    border = np.unique(np.concatenate((links - links.T).nonzero()))
    links = (links + links.T > 0).astype(np.float64)
    return sparse.csr_array(sparse.diags_array(1.0 / np.maximum(links.sum(axis=1), 1.0)) @ links), border
