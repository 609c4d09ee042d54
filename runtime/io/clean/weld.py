"""Vertices that are one, and faces that are no triangle.

n file vertices · v welded vertices · f faces.  Positions are float64 in source units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...errors import MeshError
from ...geometry.rows import by_first_appearance, equal_rows, first_of_each
from ..rawmesh import LARGEST_DIAGONAL
from .orient import connected_labels

if TYPE_CHECKING:
    from numpy.typing import NDArray

WELD_TOLERANCE = 1e-8
"""× bounding-box diagonal: under the spacing of float32 numbers of that size (6e-8), so no real detail is lost."""
WELD_SHARE = 1e-2
"""× the longest edge around a vertex: a part far smaller than the whole keeps its vertices apart."""
ROUNDED_UP = 1.0 + 1e-9
"""× a distance that a finer test follows."""
SLIVER_TOLERANCE = 1e-14
"""× squared longest edge: 45 float64 roundings, where the cross product no longer has a true digit."""
SMALLEST_DIAGONAL = 1e-100
"""Below, areas leave the range of float64."""


def weld_vertices(
    positions: NDArray[np.float64], faces: NDArray[np.int64] | None = None, body: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """Which vertices are one: equal positions, or a chain of them that are very near, in one body.

    Very near is closer than WELD_TOLERANCE × bounding-box diagonal, and than WELD_SHARE × the longest edge around
    either of them.

    Args:
        positions: (n, 3) float64, finite.
        faces: (f, 3) int64, whose edges set that limit; None sets none.
        body: (n,) int64, the body of each vertex; None is one body.

    Returns:
        (n,) int64 in [0, v), numbered by first appearance: the welded vertex of each file vertex.

    Raises:
        MeshError: the bounding box has no size that float64 areas can hold.
    """
    diagonal = float(np.linalg.norm(positions.max(axis=0) - positions.min(axis=0)))
    if not SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
        raise MeshError(
            f"the bounding box has diagonal {diagonal:.3g}, expected {SMALLEST_DIAGONAL:g} to {LARGEST_DIAGONAL:g}; "
            "check the mesh and its unit"
        )
    rows = positions if body is None else np.column_stack([positions, body.astype(np.float64)])
    group = equal_rows(rows)
    first = first_of_each(group)
    distinct = positions[first]
    farthest = None if faces is None else longest_edges(distinct, group[faces])
    near = WELD_TOLERANCE * diagonal
    if farthest is not None:  # one part far away makes all others near: no more pairs than edges allow
        near = min(near, ROUNDED_UP * WELD_SHARE * float(farthest.max(initial=0.0)))
    pairs = KDTree(distinct).query_pairs(near, output_type="ndarray")
    if body is not None:
        pairs = pairs[body[first[pairs[:, 0]]] == body[first[pairs[:, 1]]]]
    if len(pairs) and farthest is not None:
        apart = np.linalg.norm(distinct[pairs[:, 0]] - distinct[pairs[:, 1]], axis=1)
        pairs = pairs[apart <= WELD_SHARE * farthest[pairs].min(axis=1)]
    if len(pairs):
        group = connected_labels(pairs, len(distinct))[group]
    return by_first_appearance(group)


def longest_edges(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n,) float64: the longest edge of the faces around each vertex; vertices (n, 3), faces (f, 3) into them."""
    corner = vertices[faces]
    longest = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2).max(axis=1)
    reach = np.zeros(len(vertices))
    np.maximum.at(reach, faces, longest[:, None])
    return reach


def degenerate_faces(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(f,) bool: faces with a repeated corner, or whose twice area is at most SLIVER_TOLERANCE × longest edge squared.

    A sliver is kept as long as float64 can tell its corners from three points on a line.
    vertices: (v, 3) float64.  faces: (f, 3) int64 into them.
    """
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    longest = np.maximum.reduce([np.linalg.norm(edge, axis=1) for edge in (b - a, c - b, a - c)])
    unit = np.maximum(longest, np.finfo(np.float64).tiny)[:, None]
    double_area = np.linalg.norm(np.cross((b - a) / unit, (c - a) / unit), axis=1)
    repeated = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    return repeated | (double_area <= SLIVER_TOLERANCE)
