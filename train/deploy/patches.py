"""Patches: parts of a chart on which uv is a smooth function of position, one Unwrap-Net each.   unit ball.

A network sees a point, not the face it lies on.  Where two points of one chart are close in space and far apart in uv
(the two sides of a slit, of an ear, of a thin sheet), one smooth map can't answer for both: the chart is halved between
them.  Such points are looked for among samples of even density, so that it doesn't matter how fine the mesh is.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from ..sampling import sample_surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import PatchConfig
    from ..finish.pieces import Piece


class Probes(NamedTuple):
    """Points of a piece.  xyz (n, 3), uv (n, 2) float64; face (n,) int64: the positions of their faces in the piece."""

    xyz: NDArray[np.float64]
    uv: NDArray[np.float64]
    face: NDArray[np.int64]

    def among(self, chosen: NDArray[np.bool_]) -> Probes:
        """Those chosen (n,)."""
        return Probes(self.xyz[chosen], self.uv[chosen], self.face[chosen])


class Conflict(NamedTuple):
    """Two faces (positions in a piece) with points that are close in space and far apart in uv."""

    first: int
    second: int


def split_into_patches(piece: Piece, config: PatchConfig) -> NDArray[np.int64]:
    """Patch (m,), numbered from 0, of each face of a piece."""
    flat = piece.flat.surface
    links = joined_faces(flat.faces, flat.triangles.mean(axis=1), rings=config.rings)
    probes, areas = probe_piece(piece, config), flat.face_areas()
    patch = np.zeros(len(flat.faces), dtype=np.int64)
    open_patches, count = [0], 1
    while open_patches and count < config.most:
        members = np.flatnonzero(patch == open_patches[-1])
        inside_patch = probes.among(patch[probes.face] == open_patches[-1])
        conflict = worst_conflict(inside_patch, config)
        if conflict is None and areas[members].sum() > config.largest:
            conflict = far_ends(inside_patch)
        if conflict is None:
            open_patches.pop()
            continue
        inside = links[members][:, members]
        ends = np.searchsorted(members, [conflict.first, conflict.second])
        distance = dijkstra(inside, directed=False, indices=ends)
        patch[members[distance[1] < distance[0]]] = count
        open_patches.append(count)
        count += 1
    return patch


def far_ends(probes: Probes) -> Conflict | None:
    """The two faces at the ends of a patch in uv, along its longest direction; None where that is one face."""
    if len(probes.uv) < 2:
        return None
    centred = probes.uv - probes.uv.mean(axis=0)
    along = centred @ np.linalg.svd(centred, full_matrices=False)[2][0]
    first, second = (int(probes.face[i]) for i in (along.argmin(), along.argmax()))
    return Conflict(first, second) if first != second else None


def probe_piece(piece: Piece, config: PatchConfig) -> Probes:
    """Samples of a piece: two layers of it have ``config.neighbours`` of them within ``config.reach`` of a point."""
    flat = piece.flat.surface
    density = config.neighbours / (2.0 * np.pi * config.reach**2)
    count = 64 + int(density * flat.face_areas().sum())
    samples = sample_surface(flat, count, np.random.default_rng(0))  # fixed: the division follows from the piece alone
    uv = np.einsum("nc,ncd->nd", samples.barycentric, piece.flat.uv[flat.faces[samples.face]])
    return Probes(samples.xyz, uv, samples.face)


def joined_faces(faces: NDArray[np.int64], centroids: NDArray[np.float64], *, rings: int = 1) -> sparse.csr_array:
    """(m, m) distances between centroids of faces up to ``rings`` edges apart in the flattened piece: slits don't join.

    Paths from face to neighbouring face follow the grain of the mesh and come out too long, by a quarter in some
    directions; chords over a few rings go almost straight.
    """
    start, end = faces.reshape(-1), np.roll(faces, -1, axis=1).reshape(-1)
    owner = np.repeat(np.arange(len(faces)), 3)
    count = int(faces.max()) + 1
    along = sparse.csr_array((owner + 1, (start, end)), shape=(count, count))
    back = along.T.tocsr()
    shared = along.multiply(back > 0).tocoo()
    twin = back.multiply(along > 0).tocoo()
    shape = (len(faces), len(faces))
    one = sparse.csr_array((np.ones(len(shared.data)), (shared.data - 1, twin.data - 1)), shape=shape)
    near = one
    for _ in range(rings - 1):
        near = near + near @ one
    i, j = near.tocoo().coords
    i, j = i[i != j], j[i != j]
    return sparse.csr_array((np.linalg.norm(centroids[i] - centroids[j], axis=1) + 1e-9, (i, j)), shape=shape)


def worst_conflict(probes: Probes, config: PatchConfig) -> Conflict | None:
    """The pair within ``config.reach`` in space whose uv lie farthest apart, if farther than smoothness allows.

    Near in space means near in uv for a smooth map with singular values around 1: farther than ``config.stretch`` times
    the distance plus ``config.gap`` is a tear.  Two points of one face are never torn.
    """
    xyz, uv, face = probes
    if len(xyz) < 2:
        return None
    near = min(config.neighbours, len(xyz))
    distance, index = KDTree(xyz).query(xyz, k=near, distance_upper_bound=config.reach)
    row = np.repeat(np.arange(len(xyz)), near)
    found = np.isfinite(distance.reshape(-1))
    row, other, distance = row[found], index.reshape(-1)[found], distance.reshape(-1)[found]
    tear = np.linalg.norm(uv[row] - uv[other], axis=1) - config.stretch * distance - config.gap
    tear[face[row] == face[other]] = 0.0
    worst = int(tear.argmax())
    return Conflict(int(face[row[worst]]), int(face[other[worst]])) if tear[worst] > 0.0 else None
