"""The last resort: faces that our own flattening can't make valid are unwrapped by xatlas, and named."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import xatlas

from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.rows import grouped
from ...runtime.geometry.topology import components, edge_table
from ...runtime.mesh import Surface
from .contact import excess_energy
from .pieces import Piece
from .slits import Flat

if TYPE_CHECKING:
    from numpy.typing import NDArray


def unwrapped_by_xatlas(surface: Surface, ids: NDArray[np.int64], total_area: float) -> list[Piece]:
    """The faces as xatlas's charts, each a piece of method "xatlas"; what even xatlas overlaps, as triangles."""
    points = surface.vertices[surface.faces[ids]].reshape(-1, 3).astype(np.float32)
    corners = np.unique(points, axis=0, return_inverse=True)
    faces = corners[1].reshape(-1, 3).astype(np.uint32)
    atlas = xatlas.Atlas()
    atlas.add_mesh(corners[0], faces)
    atlas.generate()
    _, index, uv = atlas[0]
    index = index.astype(np.int64)
    flat = uv.astype(np.float64) * [atlas.width, atlas.height]  # xatlas divides u and v apart
    pieces = []
    for rows in grouped(components(index, edge_table(index))):
        pieces += _chart(surface, ids[rows], flat[index[rows]], index[rows], total_area)
    return pieces


def _chart(
    surface: Surface, ids: NDArray[np.int64], uv: NDArray[np.float64], index: NDArray[np.int64], total_area: float
) -> list[Piece]:
    """One chart of xatlas, uv (m, 3, 2), at the scale of the surface and turned right way round."""
    first, second = uv[:, 1] - uv[:, 0], uv[:, 2] - uv[:, 0]
    signed = 0.5 * (first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum()
    areas = Surface(surface.vertices, surface.faces[ids]).face_areas()
    if signed != 0.0:
        uv = uv * np.sqrt(areas.sum() / abs(signed)) * [np.sign(signed), 1.0]
    if signed == 0.0 or flipped_triangles(uv).any() or len(overlapping_pairs(uv)):
        return [_triangle(surface, face, total_area) for face in ids.tolist()]
    used, where, faces = np.unique(index, return_index=True, return_inverse=True)
    vertices = surface.vertices[surface.faces[ids]].reshape(-1, 3)[where]
    flat = Flat(Surface(vertices, faces.reshape(-1, 3)), uv.reshape(-1, 2)[where], {})
    assert len(used) == len(vertices)
    return [_piece(ids, flat, total_area)]


def _triangle(surface: Surface, face: int, total_area: float) -> Piece:
    """One triangle laid flat."""
    a, b, c = surface.vertices[surface.faces[face]]
    length = float(np.linalg.norm(b - a))
    along = float((c - a) @ (b - a)) / length
    height = float(np.linalg.norm(np.cross(b - a, c - a))) / length
    uv = np.array([[0.0, 0.0], [length, 0.0], [along, height]])
    flat = Flat(Surface(np.stack([a, b, c]), np.array([[0, 1, 2]])), uv, {})
    return _piece(np.array([face]), flat, total_area)


def _piece(ids: NDArray[np.int64], flat: Flat, total_area: float) -> Piece:
    energy = excess_energy(flat.surface, flat.uv) / total_area
    return Piece(ids, flat, energy, 0.0, resort="xatlas")
