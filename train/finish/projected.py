"""Charts by projection, for when there is no time to search any: valid always, in time that grows with the faces alone.

Faces take the direction that they and those around them face; connected ones lie in its plane as they are seen from
there.  What lies over itself is cut where the layers are apart, down to single triangles.   m faces · k directions.
"""

from __future__ import annotations

from functools import cache, partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.rows import grouped
from ...runtime.geometry.topology import components, edge_table, face_components
from ...runtime.geometry.triangles import signed_areas
from ...runtime.mesh import Surface
from ..workers import parallel_map
from .contact import excess_energy
from .pieces import Piece
from .slits import Flat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import ProjectConfig


def projected(surface: Surface, ids: NDArray[np.int64], total_area: float, config: ProjectConfig) -> list[Piece]:
    """The faces ids (m,) of a surface as valid pieces of method "projection"."""
    if len(ids) == 0:
        return []
    corners = surface.faces[ids]
    pairs = edge_table(corners)
    pairs = pairs.edge_faces[pairs.manifold]
    part = Surface(surface.vertices, corners)
    label = smoothed(part, pairs, config)
    group = face_components(len(ids), pairs[label[pairs[:, 0]] == label[pairs[:, 1]]])
    rows = grouped(group)
    rows.sort(key=lambda one: -len(one))
    # crumbs by the hundred are one piece of work
    blocks = [rows[at :: config.blocks] for at in range(min(config.blocks, len(rows)))]
    found = parallel_map(partial(laid_out, part, label, directions()), blocks)
    return [
        Piece(ids[rows], flat, excess_energy(flat.surface, flat.uv) / total_area, 0.0, resort="projection")
        for of_one in found
        for rows, flat in of_one
    ]


@cache
def directions() -> NDArray[np.float64]:
    """(k, 3) unit vectors: to the sides of a cube."""
    return np.concatenate([np.eye(3), -np.eye(3)])


def smoothed(part: Surface, pairs: NDArray[np.int64], config: ProjectConfig) -> NDArray[np.int64]:
    """(m,) the direction of each face: that of its surroundings, if the face itself does not turn too far from it."""
    count = len(part.faces)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    links = sparse.csr_array((np.ones(len(both)), tuple(both.T)), shape=(count, count))
    around = part.face_normals()
    facing = around @ directions().T
    for _ in range(config.rounds):
        around = around + links @ around
        around /= np.maximum(np.linalg.norm(around, axis=1, keepdims=True), 1e-300)
    label = np.where(facing >= config.least, around @ directions().T, facing - 2.0).argmax(axis=1)
    for _ in range(config.votes):
        own = (np.arange(len(directions())) == label[:, None]).astype(np.float64)
        votes = links @ own + 0.5 * own  # among equals it stays
        label = np.where(facing >= config.least, votes, facing - 2.0).argmax(axis=1)
    for _ in range(config.rounds):
        label = crumbs_joined(label, pairs, facing, config)
    return label


def crumbs_joined(
    label: NDArray[np.int64], pairs: NDArray[np.int64], facing: NDArray[np.float64], config: ProjectConfig
) -> NDArray[np.int64]:
    """(m,) directions; those of few faces are their neighbours', as far as none of these faces turns away from it."""
    group = face_components(len(label), pairs[label[pairs[:, 0]] == label[pairs[:, 1]]])
    count = int(group.max(initial=-1)) + 1
    across = pairs[group[pairs[:, 0]] != group[pairs[:, 1]]]
    across = np.concatenate([across, across[:, ::-1]])
    votes = np.bincount(
        group[across[:, 0]] * facing.shape[1] + label[across[:, 1]], minlength=count * facing.shape[1]
    ).reshape(count, -1)
    least = np.full((count, facing.shape[1]), np.inf)
    np.minimum.at(least, group, facing)
    votes[least < config.barely] = 0
    moves = (np.bincount(group, minlength=count) < config.crumb) & (votes.max(axis=1) > 0)
    return np.where(moves[group], votes.argmax(axis=1)[group], label)


def laid_out(
    part: Surface, label: NDArray[np.int64], ways: NDArray[np.float64], groups: list[NDArray[np.int64]]
) -> list[tuple[NDArray[np.int64], Flat]]:
    """Rows of faces and their flat layout: each group (n,) as it is, or cut until nothing of it lies over itself."""
    found, waiting = [], list(groups)
    while waiting:
        rows = waiting.pop()
        way = ways[label[rows[0]]]
        flat = seen_from(part, rows, way) if len(rows) > 1 else None
        uv = None if flat is None else flat.uv[flat.surface.faces]
        if flat is None or uv is None:
            found.append((rows, triangle(part, int(rows[0]))))
        elif flipped_triangles(uv).any():  # a needle, by rounding
            waiting += [rows[:1], *connected(part, rows[1:])]
        elif len(pairs := overlapping_pairs(uv)):
            upper = layers(part.vertices[part.faces[rows]].mean(axis=1), pairs, way)
            waiting += [*connected(part, rows[upper]), *connected(part, rows[~upper])]
        else:
            found.append((rows, flat))
    return found


def seen_from(part: Surface, rows: NDArray[np.int64], way: NDArray[np.float64]) -> Flat:
    """Faces (n,) in the plane across a direction, at the size that they have in space."""
    own, _ = part.part(rows)
    uv = own.vertices @ across(*way.tolist())
    area = own.face_areas().sum() / max(float(signed_areas(uv[own.faces]).sum()), 1e-300)
    return Flat(own, uv * np.sqrt(area), {})


@cache
def across(x: float, y: float, z: float) -> NDArray[np.float64]:
    """(3, 2) two unit vectors at right angles to a third, and to each other: seen from it, they turn to the left."""
    way = np.array([x, y, z])
    first = np.cross(way, np.eye(3)[np.abs(way).argmin()])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(way, first)], axis=1)


def layers(centroids: NDArray[np.float64], pairs: NDArray[np.int64], way: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(n,) bool: faces nearer than the middle depth of the pairs (p, 2) that lie over each other; some, never all."""
    depth = centroids @ way
    upper = depth > np.median(depth[pairs].mean(axis=1))
    if upper.all() or not upper.any():  # a surface that passes through itself
        longest = np.ptp(centroids, axis=0).argmax()
        upper = np.zeros(len(centroids), dtype=np.bool_)
        upper[np.argsort(centroids[:, longest])[len(centroids) // 2 :]] = True
    return upper


def connected(part: Surface, rows: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Faces (n,) in connected groups."""
    group = components(part.faces[rows]) if len(rows) else rows
    return [rows[group == number] for number in range(int(group.max(initial=-1)) + 1)]


def triangle(part: Surface, face: int) -> Flat:
    """One triangle laid flat."""
    a, b, c = part.vertices[part.faces[face]]
    length = float(np.linalg.norm(b - a))
    along = float((c - a) @ (b - a)) / length
    height = float(np.linalg.norm(np.cross(b - a, c - a))) / length
    uv = np.array([[0.0, 0.0], [length, 0.0], [along, height]])
    return Flat(Surface(np.stack([a, b, c]), np.array([[0, 1, 2]])), uv, {})
