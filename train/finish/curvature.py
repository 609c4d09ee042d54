"""How much stretch a piece of surface needs, foretold by one sparse solve, and the flattening that goes with it.

Among conformal flattenings the one that keeps the length of the border stretches least.  Its scale is e^u, where
Δu = K (the Gauss curvature) inside and u = 0 on the border (Springborn, Schröder & Pinkall 2008; Ben-Chen, Gotsman &
Bunin 2008).  Its energy orders pieces as SLIM does, and the lowest u is where a slit helps most: the tip of a limb.
The border itself then follows from u (Sawhney & Crane, Boundary First Flattening, 2017).   v vertices · f faces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ...runtime.geometry.distortion import excess
from ...runtime.geometry.triangles import corner_angles, triangle_cross

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse.linalg import SuperLU

    from ...runtime.mesh import Surface
    from .config import CotangentConfig


class Curvature:
    """What a piece's conformal factors follow from: its angles and cotangent weights, taken once.

    turn (v,): sum of the corner angles at each vertex, in radians.  laplacian (v, v): positive semidefinite.
    fan (v,): number of faces around each vertex.
    """

    def __init__(self, turn: NDArray[np.float64], laplacian: sparse.csr_array, fan: NDArray[np.int64]) -> None:
        self.turn, self.laplacian, self.fan = turn, laplacian, fan

    @classmethod
    def of(cls, surface: Surface, config: CotangentConfig) -> Curvature:
        """The curvature of a surface."""
        angle, cotangent = corner_angles(surface.triangles), corner_cotangents(surface.triangles)
        turn = np.zeros(len(surface.vertices))
        np.add.at(turn, surface.faces, angle)
        fan = np.bincount(surface.faces.reshape(-1), minlength=len(surface.vertices))
        return cls(turn, cotangent_laplacian(surface, cotangent, config), fan)

    def inside(self, rim: NDArray[np.bool_]) -> tuple[NDArray[np.int64], SuperLU | None]:
        """The vertices that a rim (v,) bool leaves free, and the factorized laplacian over them."""
        inner = np.flatnonzero(~rim)
        free = len(inner) > 0 and bool(rim.any())
        return inner, factorize(self.laplacian[inner][:, inner]) if free else None

    def factor(self, rim: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(v,) log scale u of the conformal map that keeps the lengths along a rim (v,) bool."""
        inner, solver = self.inside(rim)
        u = np.zeros(len(self.turn))
        if solver is not None:
            u[inner] = solver.solve(self.turn[inner] - 2.0 * np.pi)
        return u


def corner_cotangents(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 3) cotangents of the corner angles of triangles (f, 3, 3); ±1e12 where a face has no area."""
    ahead, back = np.roll(triangles, -1, axis=1) - triangles, np.roll(triangles, 1, axis=1) - triangles
    cosine = (ahead * back).sum(axis=2)
    sine = np.linalg.norm(triangle_cross(triangles), axis=1)[:, None]
    return cosine / np.maximum(sine, 1e-12 * (np.abs(cosine) + 1e-300))


def cotangent_laplacian(surface: Surface, cotangent: NDArray[np.float64], config: CotangentConfig) -> sparse.csr_array:
    """(v, v) positive semidefinite; weights of obtuse pairs of triangles are raised to a small positive one."""
    faces, count = surface.faces, len(surface.vertices)
    i, j = np.roll(faces, -1, axis=1).reshape(-1), np.roll(faces, -2, axis=1).reshape(-1)
    weight = 0.5 * np.clip(cotangent.reshape(-1), -config.steepest, config.steepest)
    links = sparse.coo_array((np.r_[weight, weight], (np.r_[i, j], np.r_[j, i])), shape=(count, count)).tocsr()
    links.data = np.maximum(links.data, config.least_weight)
    return (sparse.diags_array(links.sum(axis=1)) - links).tocsr()


def factorize(matrix: sparse.csr_array) -> SuperLU:
    """LU of a symmetric positive definite matrix; a row that nothing fixes gets a trace of its own diagonal."""
    steady = (matrix + 1e-12 * sparse.diags_array(matrix.diagonal() + 1e-300)).tocsc()
    return splu(steady, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)


def foretold_energies(
    faces: NDArray[np.int64], areas: NDArray[np.float64], u: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(f,) area · (symmetric Dirichlet − 1) of the conformal map of scale e^u (v,), capped; units squared."""
    scale = np.clip(u[faces].mean(axis=1), -5.0, 5.0)
    return areas * excess(np.cosh(2.0 * scale))


def foretold_energy(surface: Surface, u: NDArray[np.float64]) -> float:
    """Σ of ``foretold_energies``."""
    return float(foretold_energies(surface.faces, surface.face_areas(), u).sum())


def border_first(surface: Surface, loop: NDArray[np.int64], config: CotangentConfig) -> NDArray[np.float64]:
    """Uv (v, 2) of a disk: its border loop (b,) laid out with its own lengths, the inside harmonic.  May hold flips."""
    border = np.zeros(len(surface.vertices), dtype=bool)
    border[loop] = True
    curvature = Curvature.of(surface, config)
    inner, solver = curvature.inside(border)
    u = np.zeros(len(surface.vertices))
    if solver is not None:
        u[inner] = solver.solve(curvature.turn[inner] - 2.0 * np.pi)
    bend = np.pi - curvature.turn[loop] + (curvature.laplacian @ u)[loop]
    points = surface.vertices[loop]
    uv = np.zeros((len(surface.vertices), 2))
    uv[loop] = closed_polygon(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1), bend)
    if solver is not None:
        uv[inner] = solver.solve(-(curvature.laplacian[inner][:, loop] @ uv[loop]))
    return uv


def closed_polygon(length: NDArray[np.float64], bend: NDArray[np.float64]) -> NDArray[np.float64]:
    """Corners (b, 2) of the polygon with exterior angles ``bend`` (b,), its sides changed as little as closing it asks.

    length: (b,) of the side after each corner.  The angles are scaled to add up to 2π.
    """
    direction = np.cumsum(bend + (2.0 * np.pi - bend.sum()) / len(bend))
    side = np.stack([np.cos(direction), np.sin(direction)], axis=1)
    gram = side.T @ (length[:, None] * side)
    change = length * (side @ np.linalg.solve(gram + 1e-12 * np.trace(gram) * np.eye(2), side.T @ length))
    corners = np.cumsum((length - change)[:, None] * side, axis=0)
    return np.roll(corners, 1, axis=0)
