"""Overlap inside one chart, taken apart: border vertices that went under another part of the chart are drawn back out.

SLIM rules out flips, not a border that crosses itself.  Each round pins the vertices that lie inside another triangle
just outside the nearest border, runs SLIM, and asks the exact test again.  The chart is a flip-free piece; uv in source
units.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.distortion import MOST_EXCESS, excess, oriented_energy
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs, overlaps_anywhere
from ...runtime.geometry.topology import edge_table
from ...runtime.kernel.choice import kernel
from .flatten import Pins, Slim, jacobians, slim

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Move = Callable[[NDArray[np.float64], Pins | None], NDArray[np.float64]]
    """Uv (v, 2) and pins → uv (v, 2) without flips that gives way to the pins."""

    from ...runtime.mesh import Surface
    from .config import ContactConfig


def boundary_edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """(b, 2) directed boundary edges of faces (f, 3): the surface lies to their left in a flip-free uv."""
    if compiled := kernel():
        return compiled.boundary_edges(faces)
    table = edge_table(faces)
    half = table.edge_halfedges[table.edge_count == 1, 0]
    face, corner = half // 3, half % 3
    return np.stack([faces[face, corner], faces[face, (corner + 1) % 3]], axis=1)


def buried_vertices(
    uv: NDArray[np.float64], faces: NDArray[np.int64], pairs: NDArray[np.int64], edges: NDArray[np.int64]
) -> NDArray[np.int64]:
    """Boundary vertices that lie inside a triangle they don't belong to; pairs (p, 2) are the overlapping triangles."""
    on_boundary = np.zeros(len(uv), dtype=bool)
    on_boundary[edges[:, 0]] = True
    both = np.concatenate([pairs, pairs[:, ::-1]])
    vertex = faces[both[:, 0]].reshape(-1)
    other = np.repeat(both[:, 1], 3)
    keep = on_boundary[vertex] & (faces[other] != vertex[:, None]).all(axis=1)
    vertex, corner = vertex[keep], uv[faces[other[keep]]]
    point = uv[vertex]
    inside = np.ones(len(vertex), dtype=bool)
    for i in range(3):
        a, b = corner[:, i], corner[:, (i + 1) % 3]
        inside &= (b[:, 0] - a[:, 0]) * (point[:, 1] - a[:, 1]) >= (b[:, 1] - a[:, 1]) * (point[:, 0] - a[:, 0])
    return np.unique(vertex[inside])


def nearest_exit(
    uv: NDArray[np.float64], vertices: NDArray[np.int64], edges: NDArray[np.int64], margin: float
) -> NDArray[np.float64]:
    """(b, 2): for each vertex the place ``margin`` outside the nearest boundary edge that has it on its inner side.

    Edges at the vertex itself and their neighbours don't count.
    """
    a, b = uv[edges[:, 0]], uv[edges[:, 1]]
    along = b - a
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    inward = np.stack([-along[:, 1], along[:, 0]], axis=1) / length[:, None]
    following = np.zeros(len(uv), dtype=np.int64)
    following[edges[:, 0]] = edges[:, 1]
    preceding = np.zeros(len(uv), dtype=np.int64)
    preceding[edges[:, 1]] = edges[:, 0]
    places = np.zeros((len(vertices), 2))
    for row, vertex in enumerate(vertices.tolist()):
        offset = uv[vertex] - a
        t = np.clip((offset * along).sum(axis=1) / length**2, 0.0, 1.0)
        foot = a + t[:, None] * along
        distance = np.linalg.norm(uv[vertex] - foot, axis=1)
        own = {vertex, int(following[vertex]), int(preceding[vertex])}
        excluded = np.isin(edges, list(own)).any(axis=1) | ((offset * inward).sum(axis=1) <= 0.0)
        nearest = int(np.where(excluded, np.inf, distance).argmin())
        places[row] = foot[nearest] - margin * inward[nearest]
    return places


class Relaxed(NamedTuple):
    """A valid flattening on its way down.  uv (v, 2): no flips, no overlap.  pins: contacts that hold it, by vertex."""

    uv: NDArray[np.float64]
    pins: dict[int, NDArray[np.float64]]


def as_pins(places: dict[int, NDArray[np.float64]], weight: float) -> Pins | None:
    """Contacts as SLIM takes them; None where there are none."""
    return Pins(np.array(list(places), dtype=np.int64), np.stack(list(places.values())), weight) if places else None


def rim_overlaps(faces: NDArray[np.int64], edges: NDArray[np.int64], uv: NDArray[np.float64]) -> bool:
    """True where the border crosses itself.  For a flip-free piece that is overlap: a simple border bounds no overlap.

    Two border edges that cross belong to two triangles that overlap, so only the triangles along the border are tested.
    """
    return overlaps_anywhere(uv[faces[rim_faces(faces, edges)]])


def is_valid(surface: Surface, uv: NDArray[np.float64]) -> bool:
    """True for finite uv (v, 2) without flips, whose border does not cross itself: for a disk, no overlap."""
    if not np.isfinite(uv).all() or flipped_triangles(uv[surface.faces]).any():
        return False
    return not rim_overlaps(surface.faces, boundary_edges(surface.faces), uv)


def rim_faces(faces: NDArray[np.int64], edges: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows of the faces (f, 3) with two corners or more on the border, whose directed edges are (b, 2)."""
    on_border = np.zeros(int(faces.max()) + 1, dtype=bool)
    on_border[edges[:, 0]] = True
    return np.flatnonzero(on_border[faces].sum(axis=1) >= 2)


def separate(
    surface: Surface,
    start: Relaxed,
    edges: NDArray[np.int64],
    config: ContactConfig,
    move: Move | None = None,
) -> Relaxed | None:
    """``start`` with its overlaps taken apart; None where ``config.rounds`` did not suffice.

    ``move``: how the piece gives way to pins; None: by isometric SLIM.
    """
    move = move or (lambda uv, pins: slim(surface, uv, config.iterations, pins))
    margin = config.margin * float(np.sqrt(surface.face_areas().sum()))
    uv, places = start.uv, dict(start.pins)
    for _ in range(config.rounds):
        if not rim_overlaps(surface.faces, edges, uv):
            return Relaxed(uv, places)
        pairs = overlapping_pairs(uv[surface.faces])
        buried = buried_vertices(uv, surface.faces, pairs, edges)
        if len(buried) == 0 or len(buried) > config.most * len(edges):
            return None
        places.update(zip(buried.tolist(), nearest_exit(uv, buried, edges, margin), strict=True))
        uv = move(uv, as_pins(places, config.weight))
    return None if rim_overlaps(surface.faces, edges, uv) else Relaxed(uv, places)


def excess_energy(surface: Surface, uv: NDArray[np.float64]) -> float:
    """Σ area · (symmetric Dirichlet − 1), each face capped so that no sliver decides; source units squared."""
    if compiled := kernel():
        return compiled.excess_energy(surface.vertices, surface.faces, uv, MOST_EXCESS)
    return float(surface.face_areas() @ excess(oriented_energy(jacobians(surface, uv))))


def converge(surface: Surface, start: Relaxed, goal: float, config: ContactConfig) -> NDArray[np.float64] | None:
    """The uv (v, 2) after SLIM until it hardly moves; None as soon as ``goal`` (excess energy) is out of sight.

    A slit swings through overlap while it opens, so only the end is worth an overlap test.  SLIM converges about
    geometrically: out of sight is a goal that ``config.patience`` more drops like the last one would not reach.
    """
    solver = Slim(surface, start.uv, as_pins(start.pins, config.weight))
    energy, uv = excess_energy(surface, start.uv), start.uv
    for _ in range(config.blocks):
        uv = solver.run(config.block)
        previous, energy = energy, excess_energy(surface, uv)
        drop = previous - energy
        if energy - config.patience * drop > goal:
            return None
        if drop < config.still * previous:
            break
    return uv


def relax(surface: Surface, start: Relaxed, config: ContactConfig, *, goal: float = np.inf) -> Relaxed:
    """SLIM from a valid flattening to a valid one: freely first; where that ends in overlap, in small steps.

    Returns the start where ``goal`` (excess energy) is out of sight or a face has no area, and the last valid state
    where contacts can't hold the chart apart; with ``config.rounds`` = 0 there are no contacts.
    """
    edges = boundary_edges(surface.faces)
    free = converge(surface, start, goal, config)
    if free is None or not np.isfinite(free).all():
        return start
    if not rim_overlaps(surface.faces, edges, free):
        return Relaxed(free, start.pins)
    state = start
    for _ in range(config.steps if config.rounds else 0):
        moved = slim(surface, state.uv, config.step, as_pins(state.pins, config.weight))
        apart = separate(surface, Relaxed(moved, state.pins), edges, config)
        if apart is None:
            break
        state = apart
    return state
