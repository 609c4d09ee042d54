"""How much stretch a piece of surface needs, foretold by one sparse solve, and the flattening that goes with it.

Among conformal flattenings the one that keeps the length of the border stretches least.  Its scale is e^u, where
Δu = K (the Gauss curvature) inside and u = 0 on the border (Springborn, Schröder & Pinkall 2008; Ben-Chen, Gotsman &
Bunin 2008).  Its energy orders pieces as SLIM does, and the lowest u is where a slit helps most: the tip of a limb.
The border itself then follows from u (Sawhney & Crane, Boundary First Flattening, 2017).   v vertices · f faces.
"""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ...runtime.geometry.distortion import excess
from ...runtime.geometry.triangles import corner_angles, triangle_cross
from ...runtime.kernel.choice import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from scipy.sparse.linalg import SuperLU

    from ...runtime.mesh import Surface
    from .config import CotangentConfig


class Curvature:
    """What a piece's conformal factors follow from: its angles and cotangent weights, taken once.

    A rim (v,) bool is where values are given; all else is inside.
    """

    def __init__(self, surface: Surface, config: CotangentConfig) -> None:
        self.surface, self.config = surface, config

    @classmethod
    def of(cls, surface: Surface, config: CotangentConfig) -> Curvature:
        """The curvature of a surface."""
        return Compiled(surface, config) if kernel() else cls(surface, config)

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """(v,) sum of the corner angles at each vertex, in radians."""
        turn = np.zeros(len(self.surface.vertices))
        np.add.at(turn, self.surface.faces, corner_angles(self.surface.triangles))
        return turn

    @cached_property
    def fan(self) -> NDArray[np.int64]:
        """(v,) number of faces around each vertex."""
        return np.bincount(self.surface.faces.reshape(-1), minlength=len(self.surface.vertices))

    @cached_property
    def laplacian(self) -> sparse.csr_array:
        """(v, v), positive semidefinite."""
        return cotangent_laplacian(self.surface, corner_cotangents(self.surface.triangles), self.config)

    def inside(self, rim: NDArray[np.bool_]) -> tuple[NDArray[np.int64], SuperLU | None]:
        """The vertices that a rim leaves free, and the factorized laplacian over them."""
        inner = np.flatnonzero(~rim)
        free = len(inner) > 0 and bool(rim.any())
        return inner, factorize(self.laplacian[inner][:, inner]) if free else None

    def factor(self, rim: NDArray[np.bool_]) -> NDArray[np.float64]:
        """(v,) log scale u of the conformal map that keeps the lengths along a rim."""
        inner, solver = self.inside(rim)
        u = np.zeros(len(self.turn))
        if solver is not None:
            u[inner] = solver.solve(self.turn[inner] - 2.0 * np.pi)
        return u

    def product(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """(v,) the laplacian's product with u (v,)."""
        return self.laplacian @ u

    def harmonic(self, rim: NDArray[np.bool_], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values (v, 2): as given on the rim, and inside it where the laplacian is zero."""
        inner, solver = self.inside(rim)
        found = values.copy()
        if solver is not None:
            found[inner] = solver.solve(-(self.laplacian[inner][:, rim] @ values[rim]))
        return found


class Compiled(Curvature):
    """The same by the kernel."""

    def __init__(self, surface: Surface, config: CotangentConfig) -> None:
        super().__init__(surface, config)
        compiled = kernel()
        assert compiled is not None
        self._conformal = compiled.Conformal(surface.vertices, surface.faces, config.least_weight, config.steepest)

    def __reduce__(self) -> tuple[type[Compiled], tuple[Surface, CotangentConfig]]:
        return Compiled, (self.surface, self.config)

    @cached_property
    def turn(self) -> NDArray[np.float64]:
        """As above."""
        return self._conformal.turn()

    @cached_property
    def fan(self) -> NDArray[np.int64]:
        """As above."""
        return self._conformal.fan()

    def factor(self, rim: NDArray[np.bool_]) -> NDArray[np.float64]:
        """As above."""
        return self._conformal.factor(rim)

    def product(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """As above."""
        return self._conformal.product(u)

    def harmonic(self, rim: NDArray[np.bool_], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """As above."""
        columns = [self._conformal.harmonic(rim, np.ascontiguousarray(column)) for column in values.T]
        return np.stack(columns, axis=1)


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


def border_first(
    surface: Surface, loop: NDArray[np.int64], config: CotangentConfig, curvature: Curvature | None = None
) -> NDArray[np.float64]:
    """Uv (v, 2) of a disk: its border loop (b,) laid out with its own lengths, the inside harmonic.  May hold flips.

    curvature: of the disk, where it is known.
    """
    border = np.zeros(len(surface.vertices), dtype=bool)
    border[loop] = True
    curvature = curvature or Curvature.of(surface, config)
    bend = np.pi - curvature.turn[loop] + curvature.product(curvature.factor(border))[loop]
    points = surface.vertices[loop]
    uv = np.zeros((len(surface.vertices), 2))
    uv[loop] = closed_polygon(np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1), bend)
    return curvature.harmonic(border, uv)


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
