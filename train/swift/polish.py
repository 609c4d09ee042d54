"""Vertices of a flattening moved one by one to where the triangles around them are least distorted.

The energy is Σ area · symmetric Dirichlet.  Moving one corner p, a triangle's Jacobian is J0 + p gᵀ: ‖J‖² is quadratic
in p and its determinant linear, so each step is Newton's on two unknowns, shortened until all triangles stay upright
and the energy falls.  Around a triangle that is turned over, determinants are raised first.   v vertices · n triangles.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.distortion import oriented_energy
from ...runtime.geometry.rows import grouped
from ...runtime.kernel.choice import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface

UPRIGHT, RAISED = 0.01, 0.3
"""Determinant below which a triangle counts as turned over, and up to which it is raised."""
SPREAD = 1e-3
"""Weight of ‖J‖² against that."""
SHORTER = 8
"""Times that a step is halved."""
LEAST = 0.1
"""Least curvature of the energy, as a share of what ‖J‖² alone gives."""


def polished(surface: Surface, uv: NDArray[np.float64], sweeps: int, above: float = 0.0) -> NDArray[np.float64]:
    """Uv (v, 2) after sweeps over the vertices of faces whose excess energy is above so much, or turned over."""
    if compiled := kernel():
        return compiled.polished(surface.vertices, surface.faces, uv, sweeps, above)
    uv, faces, area, slopes = uv.copy(), surface.faces, surface.face_areas(), corner_slopes(surface)
    around = grouped(faces.reshape(-1), len(uv))
    for _ in range(sweeps):
        jacobian = np.einsum("fci,fcj->fij", uv[faces], slopes)
        upright = np.linalg.det(jacobian) >= UPRIGHT
        chosen = ~upright | (oriented_energy(jacobian) - 1.0 > above)
        for vertex in np.unique(faces[chosen]).tolist() if above > 0.0 else range(len(uv)):
            face, corner = np.divmod(around[vertex], 3)
            jacobian = np.einsum("nci,ncj->nij", uv[faces[face]], slopes[face])
            uv[vertex] = Fan.of(uv[vertex], jacobian, slopes[face, corner], area[face]).moved(uv[vertex])
    return uv


def corner_slopes(surface: Surface) -> NDArray[np.float64]:
    """(f, 3, 2) the gradient in each face's own axes of the functions that are 1 at a corner and 0 at the others."""
    corner = surface.triangles
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    length = np.linalg.norm(first, axis=1)
    height = np.linalg.norm(np.cross(first, second), axis=1) / length
    slope = np.einsum("fc,fc->f", first, second) / length / length / height
    none = np.zeros(len(length))
    along, across = (-1.0 / length, 1.0 / length, none), (slope - 1.0 / height, -slope, 1.0 / height)
    return np.stack([np.stack(along, axis=1), np.stack(across, axis=1)], axis=2)


class Fan(NamedTuple):
    """The triangles (n,) around a vertex at p: ‖J‖² = square · |p|² + 2 slope · p + rest, det J = base + way · p.

    turned: whether one of them is turned over.
    """

    area: NDArray[np.float64]
    square: NDArray[np.float64]
    slope: NDArray[np.float64]
    rest: NDArray[np.float64]
    base: NDArray[np.float64]
    way: NDArray[np.float64]
    turned: bool

    @classmethod
    def of(
        cls,
        place: NDArray[np.float64],
        jacobian: NDArray[np.float64],
        g: NDArray[np.float64],
        area: NDArray[np.float64],
    ) -> Fan:
        """Jacobians (n, 2, 2) and gradients g (n, 2) of triangles around a vertex at place (2,)."""
        j = jacobian - place[:, None] * g[:, None]
        base = j[:, 0, 0] * j[:, 1, 1] - j[:, 0, 1] * j[:, 1, 0]
        way = np.stack(
            [g[:, 0] * j[:, 1, 1] - g[:, 1] * j[:, 1, 0], j[:, 0, 0] * g[:, 1] - j[:, 0, 1] * g[:, 0]], axis=1
        )
        turned = bool((base + way @ place < UPRIGHT).any())
        return cls(area, (g**2).sum(axis=1), np.einsum("nij,nj->ni", j, g), (j**2).sum(axis=(1, 2)), base, way, turned)

    def norm(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) ‖J‖² with the vertex at p."""
        return self.square * (p @ p) + 2.0 * self.slope @ p + self.rest

    def energy(self, p: NDArray[np.float64]) -> float:
        """What is lowered."""
        determinant = self.base + self.way @ p
        if self.turned:
            lack = np.maximum(RAISED - determinant, 0.0)
            return float(self.area @ (lack**2 + SPREAD * self.norm(p)))
        if (determinant < UPRIGHT).any():
            return np.inf
        return float(self.area @ (self.norm(p) * (1.0 + determinant**-2.0))) / 4.0

    def moved(self, p: NDArray[np.float64]) -> NDArray[np.float64]:
        """Where the vertex goes from p."""
        determinant, towards = self.base + self.way @ p, 2.0 * (self.square[:, None] * p + self.slope)
        if self.turned:
            lack = np.maximum(RAISED - determinant, 0.0)
            along, turn, mixed = SPREAD * self.area, -2.0 * self.area * lack, np.zeros(len(lack))
            second = np.where(lack > 0.0, 2.0 * self.area, 0.0)
        else:
            squared = determinant**-2.0
            along, turn = 0.25 * self.area * (1.0 + squared), -0.5 * self.area * self.norm(p) * squared / determinant
            mixed, second = -0.5 * self.area * squared / determinant, 1.5 * self.area * self.norm(p) * squared**2
        slope = along @ towards + turn @ self.way
        cross = np.einsum("n,ni,nj->ij", mixed, towards, self.way)
        plain = 2.0 * float(along @ self.square)
        matrix = plain * np.eye(2) + cross + cross.T + np.einsum("n,ni,nj->ij", second, self.way, self.way)
        middle, spread = (
            (matrix[0, 0] + matrix[1, 1]) / 2.0,
            np.hypot((matrix[0, 0] - matrix[1, 1]) / 2.0, matrix[0, 1]),
        )
        matrix += max(LEAST * plain - (middle - spread), 0.0) * np.eye(2)
        if not np.linalg.det(matrix) > 0.0:
            return p
        step, before = -np.linalg.solve(matrix, slope), self.energy(p)
        shorter = (p + 0.5**n * step for n in range(SHORTER))
        return next((there for there in shorter if self.energy(there) < before), p)
