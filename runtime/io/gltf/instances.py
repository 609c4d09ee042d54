"""The atlas of a scene, in which each mesh stands once, as a mesh for formats without a scene: every instance of it.

n atlas vertices · f faces.  All instances of a mesh have the same uv.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...mesh import Asset, Atlas
    from .nodes import Placement


def every_instance(atlas: Atlas, asset: Asset) -> tuple[Atlas, NDArray[np.int64]]:
    """The atlas with all places where its meshes stand, and which of its faces (f,) are those of the atlas given.

    Faces of an instance that mirrors are turned, so that outside stays outside.
    """
    document, same = asset.document, np.arange(len(atlas.faces))
    if document is None or asset.part is None:
        return atlas, same
    world = {part.mesh: part.world for part in document.parts}
    placed = faces_at_places(asset)
    if len(placed) == len(world) and all(entry.world is world[entry.mesh] for entry, _ in placed):
        return atlas, same
    whole = replace(atlas, faces=np.zeros((0, 3), np.int64), face_chart=np.zeros(0, np.int64))
    pieces, place, count = [], np.zeros(len(same), np.int64), 0
    for entry, own in placed:
        pieces.append(_moved(atlas, own, entry.world @ np.linalg.inv(world[entry.mesh])))
        if entry.world is world[entry.mesh]:
            place[own] = count + np.arange(len(own))
        count += len(own)
    return _together(whole, pieces), place


def faces_at_places(asset: Asset) -> list[tuple[Placement, NDArray[np.int64]]]:
    """Each place where a mesh of the scene stands, with the faces (m,) of the asset that stand there."""
    if asset.document is None or asset.part is None:
        return []
    mesh_of = np.array([part.mesh for part in asset.document.parts])[asset.part]
    meshes = {part.mesh for part in asset.document.parts}
    places = standing(asset.document.placements, meshes)
    return [(entry, np.flatnonzero(mesh_of == entry.mesh)) for entry in places]


def instance_faces(asset: Asset) -> NDArray[np.int64]:
    """(f,) which of the asset's faces each face of `every_instance` is."""
    placed = faces_at_places(asset)
    several = sum(len(own) for _, own in placed) > len(asset.faces)
    return np.concatenate([own for _, own in placed]) if several else np.arange(len(asset.faces))


def standing(placements: tuple[Placement, ...], meshes: set[int]) -> list[Placement]:
    """Places in the default scene; of a mesh that stands in others alone, those there."""
    shown = {entry.mesh for entry in placements if entry.first}
    return [entry for entry in placements if entry.mesh in meshes and (entry.first or entry.mesh not in shown)]


def _moved(atlas: Atlas, faces: NDArray[np.int64], matrix: NDArray[np.float64]) -> Atlas:
    """Some faces of the atlas, with their vertices, under a (4, 4) matrix."""
    used, corners = np.unique(atlas.faces[faces], return_inverse=True)
    corners = corners.reshape(-1, 3).astype(np.int64)
    linear, mirrored = matrix[:3, :3], bool(np.linalg.det(matrix[:3, :3]) < 0.0)
    normals = atlas.normals[used].astype(np.float64) @ np.linalg.inv(linear)
    length = np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    return replace(
        atlas,
        positions=atlas.positions[used] @ linear.T + matrix[:3, 3],
        faces=corners[:, [0, 2, 1]] if mirrored else corners,
        uv=atlas.uv[used],
        normals=(normals / length).astype(np.float32),
        face_chart=atlas.face_chart[faces],
        source_vertex=atlas.source_vertex[used],
    )


def _together(whole: Atlas, pieces: list[Atlas]) -> Atlas:
    start = np.cumsum([0, *(len(piece.positions) for piece in pieces)])
    return replace(
        whole,
        positions=np.concatenate([piece.positions for piece in pieces]),
        faces=np.concatenate([piece.faces + first for piece, first in zip(pieces, start[:-1], strict=True)]),
        uv=np.concatenate([piece.uv for piece in pieces]),
        normals=np.concatenate([piece.normals for piece in pieces]),
        face_chart=np.concatenate([piece.face_chart for piece in pieces]),
        source_vertex=np.concatenate([piece.source_vertex for piece in pieces]),
    )
