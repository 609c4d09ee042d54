"""SLIM in numpy, with triangles around a piece that rest as they lie: the twin of the kernel's, which libigl has not.

f faces · v vertices · J (f, 2, 2) Jacobians · each step as in `runtime/kernel/slim.hpp`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ...runtime.geometry.triangles import triangle_cross
from .curvature import factorize

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface

PROXIMAL = 5e-5
"""Holds the whole in place."""
SHY = 0.8
"""Share of the way to the first flip."""
HALVINGS = 12
"""Tries of a step, each half as long."""
ISOMETRIC = 1e-8
"""A singular value this close to 1 gets the weight 1."""


class PlainSlim:
    """SLIM on one piece and the triangles around it."""

    def __init__(self, surface: Surface, uv: NDArray[np.float64], around: NDArray[np.int64], weight: float) -> None:
        """``uv`` (v, 2) without flips, of the surface's vertices and others that ``around`` (s, 3) alone has."""
        plane = np.concatenate([uv, np.zeros((len(uv), 1))], axis=1)
        area, slope = at_rest(np.concatenate([surface.triangles, plane[around]]))
        area[len(surface.faces) :] = weight
        self.faces = np.concatenate([surface.faces, around])
        self.uv, self.area, self.slope = uv, area, slope

    def run(self, iterations: int) -> NDArray[np.float64]:
        """Uv (v, 2) after so many more iterations."""
        for _ in range(iterations):
            self.search(self.step())
        return self.uv

    def jacobians(self, uv: NDArray[np.float64]) -> NDArray[np.float64]:
        """(f, 2, 2) derivatives of uv (v, 2)."""
        return np.einsum("fix,fiu->fux", self.slope, uv[self.faces])

    def energy(self, uv: NDArray[np.float64]) -> float:
        """Σ area · (‖J‖² + ‖J⁻¹‖²)."""
        jacobian = self.jacobians(uv)
        norm, turn = (jacobian**2).sum(axis=(1, 2)), np.linalg.det(jacobian)
        return float(self.area @ (norm * (1.0 + 1.0 / turn**2)))

    def step(self) -> NDArray[np.float64]:
        """(v, 2) from uv to the least of the proxy."""
        jacobian, count = self.jacobians(self.uv), len(self.uv)
        weight, rotation = weights_of(jacobian), rotations_of(jacobian)
        target = np.einsum("fab,fbc->fac", weight, rotation - jacobian)
        right = self.area[:, None, None] * np.einsum("fix,fux->fiu", self.slope, target)
        share = self.area[:, None, None] * np.einsum("fix,fkx->fik", self.slope, self.slope)
        block = share[..., None, None] * weight[:, None, None]
        unknown = 2 * self.faces[..., None] + np.arange(2)
        shape = block.shape
        row = np.broadcast_to(unknown[:, :, None, :, None], shape).reshape(-1)
        column = np.broadcast_to(unknown[:, None, :, None, :], shape).reshape(-1)
        size = 2 * count
        matrix = sparse.csr_array((block.reshape(-1), (row, column)), shape=(size, size))
        side = np.bincount(unknown.reshape(-1), right.reshape(-1), minlength=size)
        return factorize(matrix + PROXIMAL * sparse.eye_array(size, format="csr")).solve(side).reshape(-1, 2)

    def search(self, step: NDArray[np.float64]) -> None:
        """As far along the step as no face flips and the energy falls."""
        before, share = self.energy(self.uv), min(1.0, SHY * self.first_flip(step))
        for _ in range(HALVINGS):
            moved = self.uv + share * step
            if self.energy(moved) < before:
                self.uv = moved
                return
            share *= 0.5

    def first_flip(self, step: NDArray[np.float64]) -> float:
        """The first positive share of a step at which a face turns over; infinite where none does."""
        corner, move = self.uv[self.faces], step[self.faces]
        (p, q), (dp, dq) = ((at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]) for at in (corner, move))
        a, b, c = crossed(dp, dq), crossed(p, dq) + crossed(dp, q), crossed(p, q)
        inner = b * b - 4.0 * a * c
        real = (inner > 0.0) & (a != 0.0)
        root = np.sqrt(inner[real])
        ends = np.concatenate([(-b[real] - root) / (2.0 * a[real]), (-b[real] + root) / (2.0 * a[real])])
        return float(ends[ends > 0.0].min(initial=np.inf))


def at_rest(triangles: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Areas (f,) of triangles (f, 3, 3), and the slopes (f, 3, 2) of what is 1 at a corner and 0 at the others."""
    first, second = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    length, doubled = np.linalg.norm(first, axis=1), np.linalg.norm(triangle_cross(triangles), axis=1)
    height, foot = doubled / length, (first * second).sum(axis=1) / length
    lean, zero = foot / length / height, np.zeros(len(length))
    slope = [[-1.0 / length, lean - 1.0 / height], [1.0 / length, -lean], [zero, 1.0 / height]]
    return 0.5 * doubled, np.array(slope).transpose(2, 0, 1)


def weights_of(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 2, 2) U diag(1 + 1/σ + 1/σ² + 1/σ³) Uᵀ of J = U diag(σ) Vᵀ."""
    left, size, _ = np.linalg.svd(jacobian)
    inverse = 1.0 / size
    weight = 1.0 + inverse * (1.0 + inverse * (1.0 + inverse))
    weight[np.abs(size - 1.0) < ISOMETRIC] = 1.0
    return np.einsum("fab,fb,fcb->fac", left, weight, left)


def rotations_of(jacobian: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 2, 2) the rotations nearest to J."""
    cosine, sine = jacobian[:, 0, 0] + jacobian[:, 1, 1], jacobian[:, 1, 0] - jacobian[:, 0, 1]
    size = np.hypot(cosine, sine)
    return np.stack([np.stack([cosine, -sine], -1), np.stack([sine, cosine], -1)], axis=1) / size[:, None, None]


def crossed(a: NDArray[np.float64], b: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f,) cross products of rows (f, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
