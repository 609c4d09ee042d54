"""Topological noise of a triangulated cloud: folds and handles smaller than what its points can show.

Noise folds a few triangles over their neighbours, which leaves a hole that nothing can close, as its triangles would
face inwards; two such folds may be the ends of a handle.  What was scanned has neither, and each would cost a chart
around it a slit.  Such places are cut out, with a ring or two around them, and closed over (Guskov & Wood 2001,
Topological noise removal).

d points · f faces · a place is a set of faces that share vertices.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from ...runtime.geometry.cutgraph import closing_paths, shortest_paths
from ...runtime.geometry.rows import compacted
from ...runtime.geometry.topology import (
    boundary_loops,
    components,
    edge_table,
    euler_characteristic,
    split_non_manifold_vertices,
    within_rings,
)
from ...runtime.geometry.triangles import triangle_normals
from .holes import hole_triangles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import CloudConfig


def without_noise(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    spacing: NDArray[np.float64],
    faces: NDArray[np.int64],
    config: CloudConfig,
    *,
    folds: bool = False,
) -> NDArray[np.int64]:
    """Faces (f, 3) with noisy places closed over, each cut out as widely as it takes; those that stay open are left.

    Args:
        points: (d, 3) float64, noise apart.
        normals: (d, 3) float64 unit, oriented as the faces are.
        spacing: (d,) float64 local spacing.
        faces: (f, 3) int64, an oriented manifold.
        config: the numbers of holes and noise.
        folds: whether triangles that turn from their corners' normals are noise.
    """
    wide = replace(config, hole_edges=config.noise_edges, hole_width=config.noise_width, hole_facing=config.folded)

    def at_folds(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
        noisy = at_small_holes(faces, len(points), config.hole_edges)
        return noisy | folded(points, normals, faces, config.folded) if folds else noisy

    noisy = at_folds(faces)
    if noisy.any():
        near = within_rings(faces, noisy, len(points), config.noise_reach)
        part = faces[near]
        for rings in range(config.noise_rings):
            cut = within_rings(part, at_folds(part), len(points), rings)
            part = closed_over(points, normals, spacing, part, cut, wide) if cut.any() else part
        faces = np.concatenate([faces[~near], part])
    noisy = at_small_handles(points, faces, config.handle_edges)  # many go with folds
    return closed_over(points, normals, spacing, faces, noisy, wide) if noisy.any() else faces


def closed_over(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    spacing: NDArray[np.float64],
    faces: NDArray[np.int64],
    cut: NDArray[np.bool_],
    config: CloudConfig,
) -> NDArray[np.int64]:
    """The faces (f, 3) without those at ``cut`` (f,), triangles in their place; places that stay open are as before.

    The same array where all do.
    """
    place, rest = places(faces[cut], len(points)), faces[~cut]
    closing = hole_triangles(points, normals, spacing, rest, config, place >= 0)
    left = np.ones(int(place.max()) + 2, dtype=bool)  # places that stay as they are; the last one is none
    left[place[closing]] = False
    for loop in boundary_loops(np.concatenate([rest, closing])):
        left[place[loop]] = True
    if left[:-1].all():
        return faces
    left[-1] = False
    back = cut.copy()
    back[cut] = left[place[faces[cut][:, 0]]]
    return np.concatenate([faces[~cut | back], closing[~left[place[closing[:, 0]]]]])


def folded(
    points: NDArray[np.float64], normals: NDArray[np.float64], faces: NDArray[np.int64], least: float
) -> NDArray[np.bool_]:
    """(f,) bool: the cosine between the normal of a face and the mean of its corners' normals (d, 3) is smaller."""
    mean = normals[faces[:, 0]] + normals[faces[:, 1]] + normals[faces[:, 2]]
    length = np.linalg.norm(mean, axis=1)
    return np.einsum("fc,fc->f", triangle_normals(points[faces]), mean) < least * length


def places(faces: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(count,) the number of each vertex's place, −1 for those that no face (f, 3) uses."""
    used, small = compacted(faces)
    links = (np.ones(2 * len(small), dtype=np.int8), (small[:, [0, 0]].reshape(-1), small[:, 1:].reshape(-1)))
    found = np.full(count, -1, dtype=np.int64)
    graph = sparse.coo_array(links, shape=(len(used), len(used)))
    found[used] = connected_components(graph, directed=False)[1]
    return found


def at_small_holes(faces: NDArray[np.int64], count: int, most: int) -> NDArray[np.bool_]:
    """(f,) bool: faces at a boundary loop of at most so many edges; count: of points."""
    rim = np.zeros(count, dtype=bool)
    for loop in boundary_loops(faces):
        rim[loop] |= len(loop) <= most
    return rim[faces[:, 0]] | rim[faces[:, 1]] | rim[faces[:, 2]]


def at_small_handles(points: NDArray[np.float64], faces: NDArray[np.int64], most: int) -> NDArray[np.bool_]:
    """(f,) bool: faces at ways of at most so many edges that cross each other, around a handle and through it.

    A wire has short ways around it, but none that crosses them: it is no handle of this kind.
    """
    found, table = np.zeros(len(faces), dtype=bool), edge_table(faces)
    piece = components(faces, table)
    if 2 * (int(piece.max(initial=-1)) + 1) - len(boundary_loops(faces)) == euler_characteristic(faces, table):
        return found
    for number in np.flatnonzero(np.bincount(piece) > most):
        rows = np.flatnonzero(piece == number)
        used, part = compacted(faces[rows])
        if handles(part) == 0:
            continue
        near = rows[at_loops(points[used], part, most)]
        place = places(faces[near], len(points))[faces[near][:, 0]]
        for one in range(int(place.max(initial=-1)) + 1):
            found[near[place == one]] = handles(faces[near[place == one]]) > 0
    return found


def at_loops(points: NDArray[np.float64], faces: NDArray[np.int64], most: int) -> NDArray[np.bool_]:
    """(f,) bool: faces of a connected manifold at one of the shortest loops that bound nothing, of few edges."""
    table = edge_table(faces)
    ends = points[table.edges]
    length = np.maximum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1), np.finfo(np.float64).tiny)
    paths = shortest_paths(len(points), table.edges, length, np.array([0]))
    touched = np.zeros(len(points), dtype=bool)
    for path in closing_paths(table, length, paths):
        way = path
        while len(way) > 2 and way[1] == way[-2]:  # the common way from where all paths begin
            way = way[1:-1]
        if len(way) - 1 <= most:
            touched[way] = True
    return touched[faces[:, 0]] | touched[faces[:, 1]] | touched[faces[:, 2]]


def handles(faces: NDArray[np.int64]) -> int:
    """The genus of faces (f, 3), of all their parts together; they are parted where a vertex alone joins them."""
    split = split_non_manifold_vertices(faces)[0]
    table = edge_table(split)
    parts = int(components(split, table).max(initial=-1)) + 1
    return (2 * parts - len(boundary_loops(split)) - euler_characteristic(split, table)) // 2
