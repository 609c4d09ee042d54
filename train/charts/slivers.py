"""Triangles thinner than the numbers that hold them, given a height that can be worked with.   v vertices · f faces.

A needle or a cap (a triangle whose corner lies on its opposite side) has next to no area, and a normal that is noise.
No flattening keeps it from turning over.  Its apex is moved off its longest side, into the plane of the face beyond
that side, by some millionths of the surface's extent: nothing else notices, and its uv get an area that float32 has
room for.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.topology import edge_table
from ...runtime.mesh import Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import SliverConfig

GOLDEN_RATIO = 0.6180339887498949
"""Multiples of it, less their whole parts, never come close to each other: how much further each vertex moves."""


def steadied(surface: Surface, config: SliverConfig) -> Surface:
    """The surface with a least height for its slivers; the surface itself where it has none."""
    least = config.height * float(np.ptp(surface.vertices, axis=0).max(initial=0.0))
    vertices = surface.vertices
    table = None
    for attempt in range(config.rounds):
        longest, height = longest_sides(vertices[surface.faces])
        sliver = np.flatnonzero((height < least) & (height < config.aspect * longest[1]))
        if len(sliver) == 0:
            break
        table = table or edge_table(surface.faces)
        beyond = faces_beyond(surface.faces, table.face_edges, table.edge_faces, sliver, longest[0][sliver])
        vertices = moved(vertices, surface.faces, sliver, longest[0][sliver], beyond, least * (1.0 + attempt))
    return surface if vertices is surface.vertices else replace(surface, vertices=vertices)


def longest_sides(
    triangles: NDArray[np.float64],
) -> tuple[tuple[NDArray[np.int64], NDArray[np.float64]], NDArray[np.float64]]:
    """Of triangles (f, 3, 3): which side is the longest (f,), its length (f,), and the height over it (f,)."""
    length = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    side = length.argmax(axis=1)
    longest = length.max(axis=1)
    twice = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    return (side, longest), twice / np.maximum(longest, 1e-300)


def faces_beyond(
    faces: NDArray[np.int64],
    face_edges: NDArray[np.int64],
    edge_faces: NDArray[np.int64],
    sliver: NDArray[np.int64],
    side: NDArray[np.int64],
) -> NDArray[np.int64]:
    """(s,) the face across the longest side of each sliver, or the sliver itself where there is none."""
    pair = edge_faces[face_edges[sliver, side]]
    other = np.where(pair[:, 0] == sliver, pair[:, 1], pair[:, 0])
    return np.where((other >= 0) & (other < len(faces)), other, sliver)


def moved(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    sliver: NDArray[np.int64],
    side: NDArray[np.int64],
    beyond: NDArray[np.int64],
    step: float,
) -> NDArray[np.float64]:
    """Vertices with the apex of each sliver a step off its longest side, away from the face beyond it."""
    row = np.arange(len(sliver))
    start = vertices[faces[sliver][row, side]]
    along = vertices[faces[sliver][row, (side + 1) % 3]] - start
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    corner = vertices[faces[beyond]]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal -= np.einsum("sc,sc->s", normal, along)[:, None] * along
    size = np.linalg.norm(normal, axis=1, keepdims=True)
    direction = np.where(size > 0.0, np.cross(normal / np.maximum(size, 1e-300), along), across(along))
    apex = faces[sliver][row, (side + 2) % 3]
    total = np.stack([np.bincount(apex, axis, minlength=len(vertices)) for axis in direction.T], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    # neighbours that would move alike stay as thin as they were: the steps differ
    uneven = 1.0 + 0.5 * np.modf(np.arange(len(vertices)) * GOLDEN_RATIO)[0][:, None]
    return vertices + step * uneven * total / np.maximum(length, 1e-300)


def across(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3) unit vectors at right angles to unit vectors (n, 3): any, where nothing says which."""
    least = np.eye(3)[np.abs(direction).argmin(axis=1)]
    found = np.cross(direction, least)
    return found / np.maximum(np.linalg.norm(found, axis=1, keepdims=True), 1e-300)
