"""Flattening one piece: a bijective start on the circle, then SLIM down to low symmetric Dirichlet energy.

Pieces are oriented manifolds over their own vertices.  uv in the surface's units: isometry has singular values 1.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import igl
import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from ...runtime.geometry import triangles
from ...runtime.geometry.overlap import flipped_triangles
from ...runtime.geometry.topology import boundary_loops
from ...runtime.kernel.choice import kernel
from ...runtime.mesh import Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray


class Pins(NamedTuple):
    """Vertices (b,) drawn to places (b, 2) by weight · distance² (SLIM's energy is Σ area · symmetric Dirichlet)."""

    vertex: NDArray[np.int64]
    place: NDArray[np.float64]
    weight: float


def jacobians(surface: Surface, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """(f, 2, 2) derivative of uv in an orthonormal basis of each face, for uv (v, 2)."""
    return triangles.jacobians(surface.triangles, uv[surface.faces])


def circle_map(surface: Surface, loop: NDArray[np.int64]) -> NDArray[np.float64]:
    """Bijective uv (v, 2) of a disk: its boundary loop on a circle by arc length, the inside harmonic.

    Cotangent weights first (close to conformal); where they flip a triangle or can't be solved for, uniform ones, which
    flip none (Tutte 1963).  Scaled to the surface's area.
    """
    boundary = np.asarray(igl.map_vertices_to_circle(surface.vertices, loop), dtype=np.float64)
    faces = np.asfortranarray(surface.faces)
    try:
        uv = np.asarray(igl.harmonic(np.asfortranarray(surface.vertices), faces, loop, boundary, 1), dtype=np.float64)
    except RuntimeError:  # libigl's word for a singular system
        uv = np.full((len(surface.vertices), 2), np.nan)
    if not np.isfinite(uv).all() or flipped_triangles(uv[surface.faces]).any():
        uv = tutte_map(surface, loop, boundary)
    return uv * np.sqrt(surface.face_areas().sum() / np.pi)


def at_own_area(surface: Surface, uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Uv (v, 2) at the area of the surface; as they are where they have none."""
    area = float(np.abs(triangles.signed_areas(uv[surface.faces])).sum())
    return uv * np.sqrt(float(surface.face_areas().sum()) / area) if 0.0 < area < np.inf else uv


def tutte_map(surface: Surface, loop: NDArray[np.int64], boundary: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each inner vertex at the mean of its neighbours; the loop (b,) at boundary (b, 2); NaN where none leads to it."""
    count = len(surface.vertices)
    a = surface.faces.reshape(-1)
    b = np.roll(surface.faces, -1, axis=1).reshape(-1)
    links = sparse.coo_array(
        (np.ones(2 * len(a)), (np.concatenate([a, b]), np.concatenate([b, a]))), shape=(count, count)
    )
    links = links.tocsr()
    links.data[:] = 1.0
    laplacian = sparse.diags_array(links.sum(axis=1)) - links
    inner = np.setdiff1d(np.arange(count), loop)
    uv = np.zeros((count, 2))
    uv[loop] = boundary
    if len(inner):
        rows = laplacian.tocsr()[inner]
        try:
            uv[inner] = splu(rows[:, inner].tocsc()).solve(-(rows[:, loop] @ boundary))
        except RuntimeError:  # SuperLU's word for a singular system: something inside hangs on nothing of the loop
            uv[inner] = np.nan
    return uv


ISOMETRIC = igl.MappingEnergyType.SYMMETRIC_DIRICHLET
CONFORMAL = igl.MappingEnergyType.CONFORMAL
"""Energies of SLIM; conformal leaves the scale open."""


class Slim:
    """SLIM (Rabinovich et al. 2017) on one piece, free boundary; the kernel does the work, or libigl, its twin."""

    def __init__(
        self,
        surface: Surface,
        uv: NDArray[np.float64],
        pins: Pins | None = None,
        energy: igl.MappingEnergyType = ISOMETRIC,
    ) -> None:
        """``uv`` (v, 2) without flips: SLIM keeps it so.  Pinned vertices are drawn to their places, not forced."""
        pins = pins or Pins(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), 0.0)
        compiled = kernel() if energy == ISOMETRIC else None
        self._compiled = compiled.Slim(surface.vertices, surface.faces, uv) if compiled else None
        if self._compiled is not None:
            for vertex, (x, y) in zip(pins.vertex.tolist(), pins.place.tolist(), strict=True):
                self._compiled.pin(vertex, x, y, pins.weight)
            return
        self._data = igl.slim_precompute(
            np.asfortranarray(surface.vertices),
            np.asfortranarray(surface.faces.astype(np.int32)),
            np.asfortranarray(uv),
            energy,
            pins.vertex.astype(np.int32),
            np.asfortranarray(pins.place),
            pins.weight,
        )

    def run(self, iterations: int) -> NDArray[np.float64]:
        """Uv (v, 2) after so many more iterations."""
        if self._compiled is not None:
            return self._compiled.run(iterations)
        return np.ascontiguousarray(igl.slim_solve(self._data, iterations))


def slim(
    surface: Surface,
    uv: NDArray[np.float64],
    iterations: int,
    pins: Pins | None = None,
    energy: igl.MappingEnergyType = ISOMETRIC,
) -> NDArray[np.float64]:
    """Uv (v, 2) after ``iterations`` of SLIM from the flip-free ``uv``; isometric energy has the surface's scale."""
    return Slim(surface, uv, pins, energy).run(iterations)


def fill_holes(surface: Surface, loops: list[NDArray[np.int64]]) -> Surface:
    """The piece with each of the loops closed by a fan around its mean point."""
    if not loops:
        return surface
    count = len(surface.vertices)
    centres = np.stack([surface.vertices[loop].mean(axis=0) for loop in loops])
    fans = [
        np.stack([np.roll(loop, -1), loop, np.full(len(loop), count + number)], axis=1)
        for number, loop in enumerate(loops)
    ]
    return Surface(np.concatenate([surface.vertices, centres]), np.concatenate([surface.faces, *fans]))


def loop_length(surface: Surface, loop: NDArray[np.int64]) -> float:
    """Length of a closed vertex loop (b,)."""
    points = surface.vertices[loop]
    return float(np.linalg.norm(points - np.roll(points, -1, axis=0), axis=1).sum())


def sorted_loops(surface: Surface) -> list[NDArray[np.int64]]:
    """Boundary loops, the longest first."""
    return sorted(boundary_loops(surface.faces), key=lambda loop: -loop_length(surface, loop))


def flatten(surface: Surface, iterations: int) -> NDArray[np.float64]:
    """Uv (v, 2) of a disk, holes allowed: they are filled while SLIM runs, so they stay open and simple."""
    outer, *holes = sorted_loops(surface)
    filled = fill_holes(surface, holes)
    uv = slim(filled, circle_map(filled, outer), iterations)
    if holes:
        uv = uv[: len(surface.vertices)]
    return uv
