"""Which coarse face answers for each face of a piece, on the right side of the coarse piece's slits.   f faces.

Next to a slit the nearest coarse face may lie on the slit's other side, turned and placed elsewhere in uv.  Faces
there take, of several near ones, the face whose map goes on from that of their neighbour farther in.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from ...runtime.geometry.topology import edge_table
from ...runtime.mesh import Surface
from ..finish.contact import boundary_edges
from ..finish.flatten import jacobians
from .layout import face_frames, features, nearest_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import FinishConfig
    from ..finish.slits import Flat


class CoarseMap:
    """The map of a coarse piece, face by face, as it goes on beyond each: uv of points near a face."""

    def __init__(self, source: Flat) -> None:
        self.place = source.surface.triangles.mean(axis=1)
        self.uv = source.uv[source.surface.faces].mean(axis=1)
        self.slope = jacobians(source.surface, source.uv) @ face_frames(source.surface)[:, :2]

    def __call__(self, face: NDArray[np.int64], points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Uv (…, 2) of points (…, 3) by the maps of faces (…)."""
        return self.uv[face] + np.einsum("...ij,...j->...i", self.slope[face], points - self.place[face])


def faces_beside(
    disk: Surface, source: Flat, config: FinishConfig, near: NDArray[np.int64] | None = None
) -> NDArray[np.int64]:
    """(f,) the coarse face that answers for each face of a piece opened like it.

    near: (f,) the nearest coarse face of each, where that is known, else −1.
    """
    chosen = np.full(len(disk.faces), -1) if near is None else near.copy()
    unknown = chosen < 0
    if unknown.any():
        part = Surface(disk.vertices, disk.faces[unknown])
        chosen[unknown] = nearest_faces(part, source.surface, config.carry)
    on_rim = np.zeros(len(source.surface.vertices), dtype=bool)
    on_rim[boundary_edges(source.surface.faces)] = True
    rim = np.flatnonzero(on_rim[source.surface.faces[chosen]].any(axis=1))
    count = min(config.fine.candidates, len(source.surface.faces))
    if len(rim) == 0 or count < 2:
        return chosen
    tree = KDTree(features(source.surface, config.carry))
    near = np.asarray(tree.query(features(disk, config.carry)[rim], k=count)[1], dtype=np.int64)
    mapped = CoarseMap(source)
    points = disk.triangles.mean(axis=1)
    torn = torn_apart(mapped, near, config.fine.torn)
    rim, near = rim[torn], near[torn]
    row = np.full(len(disk.faces), -1, dtype=np.int64)
    row[rim] = np.arange(len(rim))
    table = edge_table(disk.faces)
    pairs = table.edge_faces[table.manifold]
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    pairs = pairs[row[pairs[:, 1]] >= 0]
    while True:
        onto = pairs[(row[pairs[:, 0]] < 0) & (row[pairs[:, 1]] >= 0)]
        if len(onto) == 0:
            return chosen
        face, first = np.unique(onto[:, 1], return_index=True)
        candidates = near[row[face]]
        expected = mapped(chosen[onto[first, 0]], points[face])
        found = mapped(candidates, np.repeat(points[face][:, None], count, axis=1))
        best = np.linalg.norm(found - expected[:, None], axis=2).argmin(axis=1)
        chosen[face] = candidates[np.arange(len(face)), best]
        row[face] = -1


def torn_apart(mapped: CoarseMap, near: NDArray[np.int64], torn: float) -> NDArray[np.bool_]:
    """(n,) bool: of near coarse faces (n, k), some lie much farther apart in uv than in space."""
    place, uv = mapped.place[near], mapped.uv[near]
    apart = np.linalg.norm(place - place[:, :1], axis=2)
    return (np.linalg.norm(uv - uv[:, :1], axis=2) > torn * apart).any(axis=1)
