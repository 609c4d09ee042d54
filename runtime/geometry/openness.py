"""How open the sky is over a surface: the share of rays from each face that leave it.   f faces · r rays.

Cosine-weighted: a direction is the normal and a point of the unit sphere, added (Shirley and Morley 2003).
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from ..extras import requires

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Surface

LIFT = 1e-4
"""Where rays begin above their face, as a share of the surface's extent."""


def open_sky(surface: Surface, faces: NDArray[np.int64], rays: int, seed: int = 0) -> NDArray[np.float64]:
    """(f,) share in [0, 1] of the sky that faces (f,) of a surface see from their middle.

    Args:
        surface: casts the shadows.  Where most of it lies behind its own faces, it is inside out, and seen from there.
        faces: whose sky is asked for.
        rays: from each.
        seed: of their directions, the same for each face but for its normal.

    Raises: MissingDependencyError: flexpara[bake] is absent, which has Embree.
    """
    extent = float(np.ptp(surface.vertices, axis=0).max(initial=0.0)) or 1.0
    vertices = (surface.vertices - surface.vertices.mean(axis=0)) / extent
    corner = vertices[surface.faces]
    volume = float(np.einsum("fc,fc->", corner[:, 0], np.cross(corner[:, 1], corner[:, 2])))
    normal = surface.face_normals()[faces] * (-1.0 if volume < 0.0 else 1.0)
    sphere = np.random.default_rng(seed).normal(size=(rays, 3))
    sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
    direction = (normal[:, None] + sphere).reshape(-1, 3)
    origin = np.repeat(corner[faces].mean(axis=1) + LIFT * normal, rays, axis=0)
    # in a thread that ends with it: the library leaves denormal numbers flushed to zero, on which KDTree crashes
    with ThreadPoolExecutor(1) as thread:
        hit = thread.submit(occluded, vertices, surface.faces, origin, direction).result()
    return 1.0 - hit.reshape(-1, rays).mean(axis=1)


def occluded(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    origin: NDArray[np.float64],
    direction: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """(r,) bool: whether rays (r, 3) meet a face."""
    with requires("bake"):
        import lagrange
    mesh, casting = lagrange.SurfaceMesh(), lagrange.raycasting
    mesh.add_vertices(np.ascontiguousarray(vertices, np.float64))
    mesh.add_triangles(np.ascontiguousarray(faces, np.uint32))
    caster = casting.RayCaster(casting.SceneFlags.Robust, casting.BuildQuality.High)
    caster.add_mesh(mesh)
    caster.commit_updates()
    return np.asarray(caster.occluded(origin.astype(np.float32), direction.astype(np.float32)), dtype=bool)
