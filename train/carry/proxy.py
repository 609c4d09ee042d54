"""The proxy: a simplified copy of a surface for decisions that need no detail, and the way of its labels back.

Splitting and merging weighs dozens of flattenings; on a few thousand faces each takes hundredths of a second.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import fast_simplification
import igl
import numpy as np

from ...runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic, split_non_manifold_vertices
from ...runtime.mesh import Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import FineConfig


def thinned(surface: Surface, config: FineConfig) -> Surface:
    """About ``config.faces`` faces of a surface of many more, in a tenth of the time that ``simplified`` takes.

    Quadric errors again, but edges below a rising threshold collapse in the order they come in (Forstmann, Fast
    quadric mesh simplification).  In a plane every collapse is free, and slivers are what is left: vertices are moved
    a little first, so that short edges cost least.  ``simplified`` does the rest, and all where the topology changed
    by more than a few specks that noise had left.
    """
    if len(surface.faces) <= config.early * config.faces:
        return simplified(surface, config.faces)
    manifold, old = split_non_manifold_vertices(surface.faces)
    moved = jittered(surface.vertices[old], manifold, config.jitter)
    found = fast_simplification.simplify(
        moved, manifold.astype(np.int32), target_count=config.early * config.faces, agg=config.haste
    )
    coarse = compact(np.asarray(found[0], dtype=np.float64), np.asarray(found[1], dtype=np.int64))
    alike = is_as_simple(coarse.faces, manifold, config.closed) and len(coarse.faces) < len(surface.faces)
    return simplified(coarse if alike else surface, config.faces)


def jittered(vertices: NDArray[np.float64], faces: NDArray[np.int64], share: float) -> NDArray[np.float64]:
    """Vertices (v, 3) of faces (f, 3), each moved by about a share of its shortest edge, always alike."""
    corner = vertices[faces]
    length = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2)
    shortest = np.full(len(vertices), np.inf)
    np.minimum.at(shortest, faces, np.minimum(length, np.roll(length, 1, axis=1)))
    moves = np.random.default_rng(0).normal(scale=share, size=vertices.shape)
    return vertices + moves * np.where(np.isfinite(shortest), shortest, 0.0)[:, None]


def is_as_simple(coarse: NDArray[np.int64], fine: NDArray[np.int64], closed: int) -> bool:
    """True where thinned faces have the topology of the fine ones, or lack so many of their handles and holes at most.

    closed: how much higher the Euler characteristic may be: by 1 for a hole, by 2 for a handle.
    """
    (euler, loops, tangled), (fine_euler, fine_loops, _) = topology_of(coarse), topology_of(fine)
    return not tangled and 0 <= euler - fine_euler <= closed and loops <= fine_loops


def topology_of(faces: NDArray[np.int64]) -> tuple[int, int, bool]:
    """Euler characteristic, number of boundary loops, and whether an edge is not manifold."""
    table = edge_table(faces)
    return euler_characteristic(faces), len(boundary_loops(faces)), bool((table.interior & ~table.manifold).any())


def compact(vertices: NDArray[np.float64], triangles: NDArray[np.int64]) -> Surface:
    """The triangles that have an area, over the vertices they use."""
    solid = Surface(vertices, triangles).face_areas() > 0.0
    used, index = np.unique(triangles[solid], return_inverse=True)
    return Surface(np.ascontiguousarray(vertices[used]), index.reshape(-1, 3).astype(np.int64))


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
    return compact(coarse, triangles)
