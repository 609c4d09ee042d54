"""From the simplified twin back to the surface: labels, slits, and the flattening of each chart.   f faces · area 1.

A chart's flattening is carried as a field of rotations: each face turns as the nearest face of the twin does, one
sparse solve lays the faces out together, and a few rigid steps settle what the twin did not show.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.topology import edge_table
from ..finish.arap import RigidSteps, nearest_rotations
from ..finish.flatten import jacobians
from ..finish.pieces import Piece
from .labels import border_lengths, connected_pieces, dual_graph, smooth_labels
from .search import Search

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import CarryConfig, FinishConfig
    from ..finish.slits import Flat
    from .labels import DualGraph


def carried_back(surface: Surface, coarse: Surface, found: Search, charts: int, config: FinishConfig) -> Search:
    """The pieces and slits of the coarse twin, on the surface itself."""
    keys, label = np.unique(found.label(), return_inverse=True)
    graph = dual_graph(surface, edge_table(surface.faces), config.labels.seams)
    areas = surface.face_areas()
    smooth = smoothed_in_band(votes(coarse, label.reshape(-1), surface, config.carry), areas, graph, config)
    limit = max(charts, len(keys))
    piece = fragments_joined(smooth, areas, graph)
    search = Search(surface, graph, config)
    for number in range(int(piece.max()) + 1):
        ids = np.flatnonzero(piece == number)
        source = found.pieces[int(keys[np.bincount(smooth[ids]).argmax()])]
        carried = carried_piece(search, ids, source, config.carry)
        if carried is not None and search.is_bearable(carried):
            search.add(carried)
        else:
            search.add_valid(ids, source.slits)
    if len(search.pieces) > limit:
        search.merge(-np.inf, limit)
    search.split_down()
    return search


def carried_piece(search: Search, ids: NDArray[np.int64], source: Piece, config: CarryConfig) -> Piece | None:
    """A chart of the proxy on the faces ids (m,): laid out as there, anew with its slits, or with slits of its own.

    The first of these that stretches about as little as the proxy's chart, or the best; None where none is valid.
    """
    enough = config.worse * source.energy + config.slack * float(search.areas[ids].sum()) / search.area
    best: Piece | None = None
    for slits, start in (
        (source.slits, lambda disk: carried_uv(disk, source.flat, config)),
        (source.slits, None),
        ((), None),
    ):
        found = search.try_piece(ids, slits, start)
        if isinstance(found, Piece) and (best is None or found.energy < best.energy):
            best = found
        if best is not None and best.energy <= enough:
            break
    return best


def features(surface: Surface, config: CarryConfig) -> NDArray[np.float64]:
    """(f, 6) centroid and weighted normal of each face."""
    return np.concatenate([surface.triangles.mean(axis=1), config.normal_weight * surface.face_normals()], axis=1)


def votes(coarse: Surface, label: NDArray[np.int64], surface: Surface, config: CarryConfig) -> NDArray[np.float64]:
    """(f, k) share of each label (c,) among the nearest faces of the twin."""
    nearest = KDTree(features(coarse, config)).query(features(surface, config), k=config.neighbours)[1]
    near = label[np.reshape(nearest, (len(surface.faces), config.neighbours))]
    return np.stack([(near == k).mean(axis=1) for k in range(int(label.max()) + 1)], axis=1)


def smoothed_in_band(
    share: NDArray[np.float64], areas: NDArray[np.float64], graph: DualGraph, config: FinishConfig
) -> NDArray[np.int64]:
    """Labels (f,) of short borders, from the share of votes (f, k); only faces near a border may change theirs."""
    label = share.argmax(axis=1)
    near = share.max(axis=1) < 1.0
    i, j = graph.pairs.T
    for _ in range(config.carry.band):
        touched = (label[i] != label[j]) | near[i] | near[j]
        near = near.copy()
        near[i[touched]] = True
        near[j[touched]] = True
    doubt = -np.log(np.maximum(share, 1e-3)) * areas[:, None] / config.labels.smoothing
    doubt[~near] = np.where(np.arange(share.shape[1])[None] == label[~near, None], 0.0, 1e6)
    return smooth_labels(doubt, graph)


def fragments_joined(label: NDArray[np.int64], areas: NDArray[np.float64], graph: DualGraph) -> NDArray[np.int64]:
    """Connected pieces (f,), numbered 0…, one a label: its largest; fragments join the neighbour of longest border."""
    while True:
        piece = connected_pieces(label, graph)
        count = int(piece.max()) + 1
        size = np.bincount(piece, areas, minlength=count)
        of = np.zeros(count, dtype=np.int64)
        of[piece] = label
        largest = np.zeros(count, dtype=bool)
        order = np.lexsort((np.arange(count), -size, of))
        largest[order[np.unique(of[order], return_index=True)[1]]] = True
        fragments = np.flatnonzero(~largest)
        if len(fragments) == 0:
            return np.unique(label, return_inverse=True)[1].astype(np.int64)
        border = border_lengths(piece, count, graph)
        least = fragments[size[fragments].argmin()]
        label = np.where(piece == least, of[border[least].argmax()], label)


def face_frames(surface: Surface) -> NDArray[np.float64]:
    """(f, 3, 3) rows: along the first edge, across it, and the normal."""
    corner = surface.triangles
    along = corner[:, 1] - corner[:, 0]
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    normal = surface.face_normals()
    across = np.cross(normal, along).astype(np.float64)
    return np.stack([along, across, normal], axis=1)


def carried_uv(disk: Surface, source: Flat, config: CarryConfig) -> NDArray[np.float64]:
    """Uv (v, 2) of a piece of the surface, laid out as the twin's piece is; it may hold flips."""
    turn = nearest_rotations(carried_jacobians(disk, source, nearest_faces(disk, source.surface, config)))
    return RigidSteps(disk).run(turn, config.rigid_steps)


def nearest_faces(disk: Surface, twin: Surface, config: CarryConfig) -> NDArray[np.int64]:
    """(f,) the face of the twin that lies nearest to each face, by position and normal."""
    return np.asarray(KDTree(features(twin, config)).query(features(disk, config))[1], dtype=np.int64)


def carried_jacobians(disk: Surface, source: Flat, nearest: NDArray[np.int64]) -> NDArray[np.float64]:
    """(f, 2, 2) the derivative in the plane of each face, as its nearest face (f,) of the twin has it in its own."""
    frame, theirs = face_frames(disk), face_frames(source.surface)[nearest]
    turned = turned_into(frame[:, :2], frame[:, 2], theirs[:, 2])
    between = np.einsum("fic,fjc->fji", turned, theirs[:, :2])
    return jacobians(source.surface, source.uv)[nearest] @ nearest_rotations(between)


def turned_into(
    vectors: NDArray[np.float64], normal: NDArray[np.float64], other: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Vectors (f, n, 3) turned by the least rotation that brings normal (f, 3) onto other (f, 3)."""
    axis = np.cross(normal, other)[:, None]
    cosine = np.einsum("fc,fc->f", normal, other)[:, None, None]
    once = np.cross(axis, vectors)
    return vectors + once + np.cross(axis, once) / np.maximum(1.0 + cosine, 1e-3)
