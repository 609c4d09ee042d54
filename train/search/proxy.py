"""A simplified twin of a surface for decisions that need no detail, and the way of its labels back.

Splitting and merging weighs dozens of flattenings; on a few thousand faces each takes hundredths of a second.
"""

from __future__ import annotations

import igl
import numpy as np

from ...runtime.geometry.topology import split_non_manifold_vertices
from ...runtime.mesh import Surface


def simplified(surface: Surface, faces: int) -> Surface:
    """About ``faces`` faces by quadric error (Garland & Heckbert 1997, libigl); the surface where that can't be had.

    Non-manifold edges and vertices are cut apart first, as they are for flattening.
    """
    if len(surface.faces) <= faces * 1.5:
        return surface
    manifold, old = split_non_manifold_vertices(surface.faces)
    vertices = np.asfortranarray(surface.vertices[old])
    found = igl.qslim(vertices, np.asfortranarray(manifold.astype(np.int32)), faces)
    coarse, triangles = np.asarray(found[0], dtype=np.float64), np.asarray(found[1], dtype=np.int64)
    if len(triangles) == 0:
        return surface
    solid = Surface(coarse, triangles).face_areas() > 0.0
    used, index = np.unique(triangles[solid], return_inverse=True)
    return Surface(np.ascontiguousarray(coarse[used]), index.reshape(-1, 3).astype(np.int64))
