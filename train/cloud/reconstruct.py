"""Points → triangles whose corners are exactly those points, for charts that are finished exactly.

n points of the user · d distinct points · v points in use · f faces.  Lengths in source units.
Stars (`stars.py`) propose triangles; they are taken best first, each directed edge once, so that the result is a
manifold but for corners where two fans meet; small holes are closed.  Points that no triangle uses are answered for by
the nearest triangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import igl
import numpy as np

from ...runtime.errors import MeshError
from ...runtime.geometry.rows import compacted
from ...runtime.geometry.topology import components, split_non_manifold_vertices
from ...runtime.geometry.triangles import corner_angles
from ...runtime.io.points.cloud import CloudMesh, distinct_points, with_changes
from ...runtime.mesh import Asset, Surface
from .calm import calm_shape
from .config import CloudConfig
from .holes import hole_triangles
from .noise import without_noise
from .normals import disagreement, fitted_normals, local_spacing, oriented_normals, thinned_out, turned_to
from .stars import star_candidates

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.io.points.cloud import DistinctPoints, PointCloud
    from .stars import Candidates


@dataclass(frozen=True, eq=False)
class _Local:
    """Some of the distinct points with what is known around each: d points.

    chosen: (d,) int64 into the distinct points.  points, normals: (d, 3) float64, oriented.
    index: (d, k) int64 neighbours.  spacing: (d,) float64.  reoriented: whether the file's normals were turned.
    """

    chosen: NDArray[np.int64]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    index: NDArray[np.int64]
    spacing: NDArray[np.float64]
    reoriented: bool


def reconstruct(cloud: PointCloud, config: CloudConfig | None = None) -> CloudMesh:
    """A surface through the points of a cloud.

    Args:
        cloud: n points; oriented normals are kept in sign, others are fitted and oriented.
        config: numbers.

    Returns:
        The triangles as an Asset, ready for `pipeline.train` and `packing.pack`, and where each point lies on them.
        Its changes count repeated points, points without a triangle, normals oriented anew, and pieces.

    Raises:
        MeshError: no triangles could be made: the points lie on a line, or too far apart for what they show.
    """
    config = config or CloudConfig()
    distinct = distinct_points(cloud)
    local = _local(distinct, config)
    faces = triangulated(local.points, local.normals, local.index, local.spacing, config)
    if len(faces) == 0:
        raise MeshError(
            f"{cloud.stem}: {len(local.points)} points make no triangles, expected points spread over a surface; "
            "give more of them"
        )
    used, faces = compacted(faces)
    shape = calm_shape(local.points[used], local.normals[used], local.spacing[used], faces, config)
    surface = Surface(local.points[used], faces, calm=shape)
    user = distinct.first[local.chosen[used]]
    vertex = np.full(len(distinct.first), -1, dtype=np.int64)
    vertex[local.chosen[used]] = np.arange(len(used))
    face, weight = _places(surface, distinct, vertex, config.extrapolation)
    known = with_changes(
        cloud,
        repeated_points=len(cloud.points) - len(distinct.points),
        points_without_triangle=int(np.count_nonzero(vertex < 0)),
        reoriented_normals=len(distinct.points) if local.reoriented else 0,
    )
    asset = _asset(known, surface, user, local.normals[used], local.reoriented)
    return CloudMesh(asset, face[distinct.weld], weight[distinct.weld])


def _asset(
    cloud: PointCloud, surface: Surface, user: NDArray[np.int64], fitted: NDArray[np.float64], reoriented: bool
) -> Asset:
    """The surface as an Asset: vertex i is point user[i]; the file's normals where known and not turned."""
    own = fitted if cloud.normals is None or reoriented else cloud.normals[user]
    pieces = int(components(surface.faces).max()) + 1
    return Asset(
        positions=surface.vertices,
        faces=surface.faces,
        weld=np.arange(len(user)),
        surface=surface,
        normals=np.where(np.linalg.norm(own, axis=1, keepdims=True) > 0.0, own, fitted),
        colors=None if cloud.colors is None else cloud.colors[user],
        changes=with_changes(cloud, components=pieces if pieces > 1 else 0).changes,
        sha256=cloud.sha256,
        stem=cloud.stem,
    )


def _local(distinct: DistinctPoints, config: CloudConfig) -> _Local:
    """Points that aren't too close to an earlier one, their neighbours, and oriented normals."""
    chosen, index, distance = thinned_out(distinct.points, config.neighbours, config.closest)
    points, spacing = distinct.points[chosen], local_spacing(distance)
    given = None if distinct.normals is None else distinct.normals[chosen]
    links = index[:, : config.tree_neighbours]
    disordered = given is not None and disagreement(points, given, links, config) > config.reorient
    normals = fitted_normals(points, index, distance, config, None if disordered else given)
    if given is None or disordered or not given.any(axis=1).all():
        normals = oriented_normals(points, normals, index, spacing, config)
        normals = normals if given is None or disordered else turned_to(normals, given, index)
    return _Local(chosen, points, normals, index, spacing, disordered)


def triangulated(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    index: NDArray[np.int64],
    spacing: NDArray[np.float64],
    config: CloudConfig,
) -> NDArray[np.int64]:
    """Triangles (f, 3) int64 over points (d, 3): an oriented manifold, facing as the normals do.

    Args:
        points: (d, 3) float64, all different.
        normals: (d, 3) float64 unit, oriented.
        index: (d, k) int64 neighbours.
        spacing: (d,) float64 local spacing.
        config: numbers.
    """
    faces = assembled(star_candidates(points, normals, index, spacing, config), len(points))
    faces = closed(points, normals, spacing, faces, config)
    shape = calm_shape(points, normals, spacing, faces, config)
    noisy = shape is not None
    calm = without_noise(shape if noisy else points, normals, spacing, faces, config, folds=noisy)
    faces = faces if calm is faces else closed(points, normals, spacing, calm, config)
    return _without_small_pieces(faces, config.least_faces)


def closed(
    points: NDArray[np.float64],
    normals: NDArray[np.float64],
    spacing: NDArray[np.float64],
    faces: NDArray[np.int64],
    config: CloudConfig,
) -> NDArray[np.int64]:
    """The faces (f, 3) without pinches, small holes closed; arguments as of ``triangulated``."""
    for _ in range(config.rounds):
        closing = hole_triangles(points, normals, spacing, faces, config)
        whole = without_pinches(points, np.concatenate([faces, closing]))
        if len(closing) == 0 and len(whole) == len(faces):
            break
        faces = whole
    return faces


def assembled(found: Candidates, count: int) -> NDArray[np.int64]:
    """The candidates that remain when they are taken by votes, then by circumradius, each directed edge once.

    Equal to taking them one by one: in each round those are taken that come first at all their edges.

    Args:
        found: candidates over count points.
        count: number of points.

    Returns:
        (f, 3) int64 faces, best first.
    """
    order = np.lexsort((found.radius, -found.votes))
    corners = found.corners[order]
    key = corners * count + np.roll(corners, -1, axis=1)
    edge = np.unique(key, return_inverse=True)[1].reshape(-1, 3)
    rank = np.arange(len(corners))
    taken = np.zeros(len(corners), dtype=np.bool_)
    used = np.zeros(int(edge.max(initial=-1)) + 1, dtype=np.bool_)
    while len(rank):
        first = np.full(len(used), len(corners))
        np.minimum.at(first, edge[rank].reshape(-1), np.repeat(rank, 3))
        wins = (first[edge[rank]] == rank[:, None]).all(axis=1)
        taken[rank[wins]] = True
        used[edge[rank[wins]]] = True
        rank = rank[~used[edge[rank]].any(axis=1)]
    return corners[taken]


def without_pinches(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces (f, 3) int64 without the smaller fans (by angle) of vertices where several meet."""
    while True:
        split, old = split_non_manifold_vertices(faces)
        several = np.append(False, old[1:] == old[:-1])
        several[:-1] |= several[1:]  # fans of vertices that have two or more
        if not several.any():
            return faces
        near = np.flatnonzero(several[split].any(axis=1))
        corner, angle = split[near].reshape(-1), corner_angles(points[faces[near]]).reshape(-1)
        width = np.bincount(corner, angle, minlength=len(old))
        fans = np.flatnonzero(several)
        order = fans[np.lexsort((-width[fans], old[fans]))]
        smaller = np.zeros(len(old), dtype=np.bool_)
        smaller[order[1:][old[order][1:] == old[order][:-1]]] = True
        faces = faces[~smaller[split].any(axis=1)]


def _without_small_pieces(faces: NDArray[np.int64], least: int) -> NDArray[np.int64]:
    """The faces without pieces of fewer than least of them; where all are so small, the largest stays."""
    if len(faces) == 0:
        return faces
    piece = components(faces)
    size = np.bincount(piece)
    return faces[size[piece] >= min(least, int(size.max()))]


def _places(
    surface: Surface, distinct: DistinctPoints, vertex: NDArray[np.int64], extrapolation: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Face (d,) and weights (d, 3) of its corners for each distinct point; vertex (d,) is −1 where it has none."""
    rank = np.argsort(-surface.face_areas(), kind="stable")[::-1]
    largest = np.zeros(len(surface.vertices), dtype=np.int64)
    largest[surface.faces[rank]] = 3 * rank[:, None] + np.arange(3)  # the last one that is written stays
    face, weight = np.zeros(len(vertex), dtype=np.int64), np.zeros((len(vertex), 3))
    on, off = np.flatnonzero(vertex >= 0), np.flatnonzero(vertex < 0)
    face[on] = largest[vertex[on]] // 3
    weight[on, largest[vertex[on]] % 3] = 1.0
    if len(off):
        nearest = igl.point_mesh_squared_distance(distinct.points[off], surface.vertices, surface.faces)[1]
        face[off] = np.asarray(nearest, dtype=np.int64).reshape(-1)
        weight[off] = _projected(distinct.points[off], surface.triangles[face[off]], extrapolation)
    return face, weight


def _projected(
    points: NDArray[np.float64], triangles: NDArray[np.float64], extrapolation: float
) -> NDArray[np.float64]:
    """(s, 3) barycentric weights of points (s, 3) projected on planes of triangles (s, 3, 3), held near them."""
    first, second, way = triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0], points - triangles[:, 0]
    normal = np.cross(first, second)
    square = np.einsum("sc,sc->s", normal, normal)
    one = np.einsum("sc,sc->s", np.cross(way, second), normal) / square
    two = np.einsum("sc,sc->s", np.cross(first, way), normal) / square
    weight = np.maximum(np.stack([1.0 - one - two, one, two], axis=1), -extrapolation)
    return weight / weight.sum(axis=1, keepdims=True)
