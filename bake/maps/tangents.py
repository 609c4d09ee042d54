"""Tangent frames of MikkTSpace: the ones written to the file are the ones the normal map is baked in.

n vertices · f faces · g groups.  The tangent points along growing u, the bitangent w · (normal × tangent) along growing
v (v up), which is what glTF calls +Y.  After Mikkelsen 2008, "Simulation of Wrinkled Surfaces Revisited", and the
behaviour of mikktspace.c: vertices of equal position, normal and uv are one; faces around it that are joined by edges
and turn the same way in uv are a group; each face's u direction is projected into the plane of the vertex normal,
normalised, weighted by the corner's angle in that plane, summed over the group.  Faces without uv area have no say.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from ...runtime.geometry.rows import equal_rows
from ...runtime.geometry.triangles import cross_2d

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas

TINY = 1e-30


@dataclass(frozen=True, eq=False)
class Frames:
    """Tangent spaces of groups of corners.

    group: (f, 3) int64 in [0, g).  tangent: (g, 4) float64, unit direction or zero, and w = ±1.  weight: (g,) float64,
    sum of the corners' angles in radians; 0 for a group of faces without uv area.
    """

    group: NDArray[np.int64]
    tangent: NDArray[np.float64]
    weight: NDArray[np.float64]


def vertex_tangents(atlas: Atlas) -> NDArray[np.float32]:
    """(n, 4) float32: unit tangent, perpendicular to the vertex normal, and w = ±1.

    A vertex has one tangent: where several groups meet in one (mirrored uv, fans that touch in a point) the one of the
    largest angle; `split_by_tangents` makes atlases without such vertices.  A vertex whose faces have no uv area gets
    an arbitrary perpendicular direction and w = 1.
    """
    frames = corner_frames(atlas.positions, atlas.normals, atlas.uv, atlas.faces)
    vertex, group = atlas.faces.reshape(-1), frames.group.reshape(-1)
    order = np.argsort(frames.weight[group], kind="stable")  # of several assignments the last, heaviest one stays
    chosen = np.full(len(atlas.positions), -1, np.int64)
    chosen[vertex[order]] = group[order]
    result = np.where((chosen >= 0)[:, None], frames.tangent[chosen], 0.0)
    return completed(result, np.asarray(atlas.normals, np.float64)).astype(np.float32)


def vertex_frames(atlas: Atlas) -> NDArray[np.float32]:
    """(n, 7) float32: normal, tangent and w of each atlas vertex, as they are written and normal maps are read by."""
    return np.column_stack([atlas.normals, vertex_tangents(atlas)])


def mikk_tangents(
    positions: NDArray[np.floating], normals: NDArray[np.floating], uv: NDArray[np.floating], faces: NDArray[np.int64]
) -> NDArray[np.float32]:
    """(f, 3, 4) float32: unit tangent and w of each corner.

    positions, normals: (n, 3).  uv: (n, 2), v up.  faces: (f, 3).  All are read as float32, as files hold them.
    """
    frames = corner_frames(positions, normals, uv, faces)
    corner_normals = np.asarray(normals, np.float64)[faces].reshape(-1, 3)
    tangent = completed(frames.tangent[frames.group.reshape(-1)], corner_normals)
    return tangent.reshape(-1, 3, 4).astype(np.float32)


def split_by_tangents(atlas: Atlas) -> Atlas:
    """The same atlas with each vertex in one tangent group only; the very atlas where that is so already.

    Vertices keep their numbers, copies for further groups follow at the end; faces keep their order.
    """
    frames = corner_frames(atlas.positions, atlas.normals, atlas.uv, atlas.faces)
    vertex, group = atlas.faces.reshape(-1), frames.group.reshape(-1)
    heavy = frames.weight[group] > 0.0
    pair, place = np.unique(np.stack([vertex[heavy], group[heavy]], axis=1), axis=0, return_inverse=True)
    further = np.concatenate([[False], np.diff(pair[:, 0]) == 0])
    if not further.any():
        return atlas
    count = len(atlas.positions)
    number = np.where(further, count + np.cumsum(further) - 1, pair[:, 0])
    corners = vertex.copy()
    corners[heavy] = number[place.reshape(-1)]
    source = np.concatenate([np.arange(count), pair[further, 0]])
    return replace(
        atlas,
        positions=atlas.positions[source],
        uv=atlas.uv[source],
        normals=atlas.normals[source],
        source_vertex=atlas.source_vertex[source],
        faces=corners.reshape(-1, 3),
    )


def corner_frames(
    positions: NDArray[np.floating], normals: NDArray[np.floating], uv: NDArray[np.floating], faces: NDArray[np.int64]
) -> Frames:
    """Groups of corners and their tangent spaces.  Arguments as `mikk_tangents`."""
    position, normal, flat = (np.asarray(array, np.float32).astype(np.float64) for array in (positions, normals, uv))
    welded = equal_rows(np.column_stack([position, normal, flat]))[faces]
    direction, sign = face_tangents(position[faces], flat[faces])
    group = corner_groups(welded, sign)
    count = int(group.max(initial=-1)) + 1
    total, weight, turn = np.zeros((count, 3)), np.zeros(count), np.zeros(count)
    for corner in range(3):
        axis = normal[faces[:, corner]]
        along = unit(reject(direction, axis))
        angle = corner_angles(position[faces], axis, corner) * np.abs(sign)
        number = group[:, corner]
        weight += np.bincount(number, angle, count)
        turn += np.bincount(number, angle * sign, count)
        total += np.stack([np.bincount(number, angle * along[:, i], count) for i in range(3)], axis=1)
    return Frames(group, np.column_stack([unit(total), np.where(turn < 0.0, -1.0, 1.0)]), weight)


def face_tangents(
    corner: NDArray[np.float64], uv: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Direction of growing u on each face, (f, 3) not normalised, and the sign of its uv area, (f,) in {−1, 0, 1}.

    corner: (f, 3, 3) positions.  uv: (f, 3, 2).  The sign is 0 for a face with two corners in one place, too.
    """
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    uv_first, uv_second = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    sign = np.sign(cross_2d(uv_first, uv_second))
    repeated = (corner == np.roll(corner, 1, axis=1)).all(axis=2).any(axis=1)
    sign[repeated] = 0.0
    direction = (first * uv_second[:, 1:] - second * uv_first[:, 1:]) * sign[:, None]
    return unit(direction), sign


def corner_groups(welded: NDArray[np.int64], sign: NDArray[np.float64]) -> NDArray[np.int64]:
    """(f, 3) int64: corners of one welded vertex, joined across edges between faces of one orientation.

    welded: (f, 3) int64 vertices.  sign: (f,) orientation in uv; a face with 0 takes that of a neighbour.
    """
    start, end = welded.reshape(-1), np.roll(welded, -1, axis=1).reshape(-1)
    ahead, back = _opposite_pairs(start, end)
    turn = sign.copy()
    for near, far in ((ahead // 3, back // 3), (back // 3, ahead // 3)):
        lost = (turn[near] == 0.0) & (sign[far] != 0.0)
        turn[near[lost]] = sign[far[lost]]
    joined = turn[ahead // 3] == turn[back // 3]
    ahead, back = ahead[joined], back[joined]
    rows = np.concatenate([ahead, _next_corner(ahead)])
    columns = np.concatenate([_next_corner(back), back])
    links = coo_matrix((np.ones(len(rows), np.int8), (rows, columns)), shape=(welded.size, welded.size))
    return connected_components(links, directed=False)[1].astype(np.int64).reshape(-1, 3)


def _opposite_pairs(start: NDArray[np.int64], end: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Half-edges (p,), (p,) that run the other way along one edge; where there are several, in their order."""
    low, high, forward = np.minimum(start, end), np.maximum(start, end), start < end
    key = low * (int(high.max(initial=0)) + 1) + high
    one, other = np.flatnonzero(forward), np.flatnonzero(start > end)
    ranked = [key[side] * len(key) + _rank(key[side]) for side in (one, other)]
    _, here, there = np.intersect1d(ranked[0], ranked[1], assume_unique=True, return_indices=True)
    return one[here], other[there]


def _rank(key: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) how many equal entries come before each."""
    order = np.argsort(key, kind="stable")
    first = np.concatenate([[True], np.diff(key[order]) != 0])
    place = np.arange(len(key))
    rank = np.zeros(len(key), np.int64)
    rank[order] = place - np.maximum.accumulate(np.where(first, place, 0))
    return rank


def _next_corner(corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """The flat number of the corner that follows in its face."""
    return corner - corner % 3 + (corner + 1) % 3


def corner_angles(triangles: NDArray[np.float64], axis: NDArray[np.float64], corner: int) -> NDArray[np.float64]:
    """(f,) angle in radians between the two edges at a corner, both projected into the plane of its normal (f, 3)."""
    here = triangles[:, corner]
    ahead = unit(reject(triangles[:, (corner + 1) % 3] - here, axis))
    behind = unit(reject(triangles[:, (corner + 2) % 3] - here, axis))
    return np.arccos(np.clip(np.einsum("fi,fi->f", ahead, behind), -1.0, 1.0))


def completed(tangent: NDArray[np.float64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 4) tangents made perpendicular to normals (m, 3) and unit; any direction and w = 1 where there is none."""
    axis = unit(normal)
    direction = unit(reject(tangent[:, :3], axis))
    lost = np.linalg.norm(direction, axis=1) < 0.5
    direction[lost] = any_perpendicular(axis[lost])
    return np.column_stack([direction, np.where(lost | (tangent[:, 3] >= 0.0), 1.0, -1.0)])


def unit(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…, 3) vectors at length 1; shorter than 1e-30 becomes zero."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.where(length > TINY, vector / np.maximum(length, TINY), 0.0)


def reject(vector: NDArray[np.float64], axis: NDArray[np.float64]) -> NDArray[np.float64]:
    """(…, 3) vector without its part along the unit axis."""
    return vector - np.einsum("...i,...i->...", vector, axis)[..., None] * axis


def any_perpendicular(normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(m, 3) unit vectors perpendicular to unit normals: from the coordinate axis that is least along each."""
    axis = np.eye(3)[np.argmin(np.abs(normal), axis=1)]
    return unit(reject(axis, normal))
