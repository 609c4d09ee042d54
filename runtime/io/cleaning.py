"""Raw triangles → Asset: weld, drop what is no triangle, orient.

n file vertices · v welded vertices · f faces.  Positions are float64 in source units.  Faces that stay keep their order
and their first corner; a flipped face swaps its corners 1 and 2.  Every change is counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components, minimum_spanning_tree
from scipy.spatial import KDTree

from ..errors import MeshError
from ..geometry.rows import by_first_appearance, equal_rows, first_of_each
from ..mesh import Asset, Surface
from .rawmesh import LARGEST_DIAGONAL, RawMesh, check

WELD_TOLERANCE = (
    1e-8  # × bounding-box diagonal: under the spacing of float32 numbers of that size (6e-8), so no real detail is lost
)
SLIVER_TOLERANCE = (
    1e-14  # × squared longest edge: 45 float64 roundings, where the cross product no longer has a true digit
)
SMALLEST_DIAGONAL = 1e-100  # below, areas leave the range of float64


def clean(raw: RawMesh, *, stem: str = "mesh", sha256: str = "") -> Asset:
    """Weld, drop degenerate and duplicate faces and unused vertices, orient.

    Raises: MeshError for a mesh that is empty, not finite, out of range, too large, or degenerate in all its faces.
    """
    check(raw)
    weld = weld_vertices(raw.positions)
    welded_to = first_of_each(weld)[weld]
    faces = weld[raw.faces]
    points = raw.positions[first_of_each(weld)]
    proper = ~degenerate_faces(points, faces)
    if not proper.any():
        raise MeshError(
            f"all {len(faces)} faces are degenerate (repeated corners, no area), expected triangles; export it again"
        )
    kept = np.flatnonzero(proper)
    single = first_of_duplicates(faces[kept])
    kept = kept[single]
    flip = inconsistent_faces(faces[kept])
    corners = np.where(flip[:, None], raw.faces[kept][:, [0, 2, 1]], raw.faces[kept])
    counts = {
        "welded_vertices": int(np.count_nonzero(welded_to != np.arange(len(weld)))),
        "degenerate_faces": int(np.count_nonzero(~proper)),
        "duplicate_faces": int(np.count_nonzero(~single)),
        "flipped_faces": int(np.count_nonzero(flip)),
    }
    return _asset(replace(raw, changes={**raw.changes, **counts}), corners, kept, weld, stem=stem, sha256=sha256)


def weld_vertices(positions: NDArray[np.float64]) -> NDArray[np.int64]:
    """Which vertices are one: equal positions, or a chain of them closer than WELD_TOLERANCE × bounding-box diagonal.

    Args:
        positions: (n, 3) float64, finite.

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
    group = equal_rows(positions)
    distinct = positions[first_of_each(group)]
    pairs = KDTree(distinct).query_pairs(WELD_TOLERANCE * diagonal, output_type="ndarray")
    if len(pairs):
        group = connected_labels(pairs, len(distinct))[group]
    return by_first_appearance(group)


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


def first_of_duplicates(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(f,) bool: true for the first face of each set of corners, whatever their rotation and winding."""
    group = equal_rows(np.sort(faces, axis=1))
    first = np.zeros(len(faces), dtype=np.bool_)
    first[first_of_each(group)] = True
    return first


@dataclass(frozen=True, eq=False)
class _FaceEdges:
    """Faces that share an edge.

    pairs: (m, 2) int64 faces at manifold edges.  agree: (m,) bool, they run through it opposite ways.
    links: (…, 2) int64 faces at any shared edge, as a chain.  non_manifold: how many edges have three faces or more.
    """

    pairs: NDArray[np.int64]
    agree: NDArray[np.bool_]
    links: NDArray[np.int64]
    non_manifold: int


def _face_edges(faces: NDArray[np.int64]) -> _FaceEdges:
    tail, head = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    order = np.lexsort((high, low))
    same = (low[order][1:] == low[order][:-1]) & (high[order][1:] == high[order][:-1])
    face, forward = order // 3, (tail < head)[order]
    before = np.concatenate([[False], same[:-1]])
    after = np.concatenate([same[1:], [False]])
    alone = np.flatnonzero(same & ~before & ~after)
    pairs = np.stack([face[alone], face[alone + 1]], axis=1)
    links = np.stack([face[:-1][same], face[1:][same]], axis=1)
    return _FaceEdges(
        pairs=pairs,
        agree=forward[alone] != forward[alone + 1],
        links=links,
        non_manifold=int(np.count_nonzero(same & after & ~before)),
    )


def inconsistent_faces(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which faces to flip so that neighbours across manifold edges run their edge opposite ways.

    The winding of most faces of a component stays (of a tie, that of the first face).  A surface that can't be oriented
    is flipped along a spanning tree that crosses as few disagreeing edges as it can: best effort.

    Args:
        faces: (f, 3) int64 welded vertices.

    Returns:
        (f,) bool.
    """
    edges, count = _face_edges(faces), len(faces)
    if edges.agree.all():
        return np.zeros(count, dtype=np.bool_)
    tree = _spanning_forest(edges, count)
    one, other, twist = tree.row.astype(np.int64), tree.col.astype(np.int64), (tree.data > 1.5).astype(np.int64)
    # Each face stands twice, as it is (i) and flipped (i + count); tree edges join the copies that agree.
    links = np.concatenate(
        [np.stack([one, other + twist * count], axis=1), np.stack([one + count, other + (1 - twist) * count], axis=1)]
    )
    side = connected_labels(links, 2 * count)
    same_way, opposite = side[:count], side[count:]
    size = np.bincount(same_way, minlength=int(side.max()) + 1)
    return (size[opposite] > size[same_way]) | ((size[opposite] == size[same_way]) & (opposite < same_way))


def _spanning_forest(edges: _FaceEdges, count: int) -> coo_matrix:
    """(count, count) tree edges between faces: 1 where they agree, 2 where one has to flip; few of the latter."""
    cost = np.where(edges.agree, 1.0, 2.0)
    order = np.lexsort((cost, edges.pairs[:, 1], edges.pairs[:, 0]))
    pairs = edges.pairs[order]
    first = np.concatenate([[True], (np.diff(pairs, axis=0) != 0).any(axis=1)])  # two faces may share two edges
    graph = coo_matrix((cost[order][first], (pairs[first, 0], pairs[first, 1])), shape=(count, count))
    return minimum_spanning_tree(graph.tocsr()).tocoo()


def connected_labels(links: NDArray[np.int64], count: int) -> NDArray[np.int64]:
    """(count,) int64 component of each node, numbered by first appearance; links (m, 2) int64 joins nodes."""
    graph = coo_matrix((np.ones(len(links), dtype=np.int8), (links[:, 0], links[:, 1])), shape=(count, count))
    return by_first_appearance(connected_components(graph.tocsr(), directed=False)[1].astype(np.int64))


def _asset(
    raw: RawMesh,
    corners: NDArray[np.int64],
    kept: NDArray[np.int64],
    weld: NDArray[np.int64],
    *,
    stem: str,
    sha256: str,
) -> Asset:
    in_use = np.zeros(len(raw.positions), dtype=np.bool_)
    in_use[corners] = True
    used = np.flatnonzero(in_use)
    renumber = np.full(len(raw.positions), -1, dtype=np.int64)
    renumber[used] = np.arange(len(used))
    new_weld = by_first_appearance(weld[used])
    faces, positions = renumber[corners], raw.positions[used]
    surface = Surface(vertices=positions[first_of_each(new_weld)], faces=new_weld[faces])
    counts = {**raw.changes, "unreferenced_vertices": len(raw.positions) - len(used), **_edge_counts(surface.faces)}
    return Asset(
        positions=positions,
        faces=faces,
        weld=new_weld,
        surface=surface,
        normals=None if raw.normals is None else raw.normals[used],
        colors=None if raw.colors is None else raw.colors[used],
        uv=None if raw.uv is None else raw.uv[used],
        materials=raw.materials,
        face_material=None if raw.face_material is None else raw.face_material[kept],
        changes={name: count for name, count in counts.items() if count},
        sha256=sha256,
        stem=stem,
    )


def _edge_counts(faces: NDArray[np.int64]) -> dict[str, int]:
    """Edges with three faces or more, and pieces joined by edges where there are several."""
    edges = _face_edges(faces)
    components = int(connected_labels(edges.links, len(faces)).max()) + 1
    return {"non_manifold_edges": edges.non_manifold, "components": components if components > 1 else 0}
