"""From a middle mesh, thinned but searched and finished, to the fine surface itself.   f faces · v vertices · area 1.

A fine chart differs from its source, the chart on the middle mesh, in detail only.  It takes the source's rotations,
and rigid steps by conjugate gradients lay it out, the source being the coarse level: no factorization or SLIM sees the
fine surface.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ...runtime.geometry.distortion import singular_values
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.topology import boundary_loops, components, edge_table, within_rings
from ...runtime.mesh import Surface
from ...runtime.process.deadline import Late, never
from ..finish.arap import RigidSteps, evened_out, nearest_rotations
from ..finish.contact import boundary_edges, rim_faces
from ..finish.fallback import unwrapped_by_xatlas
from ..finish.flaps import flap_faces, restricted
from ..finish.flatten import Pins
from ..finish.openings import openings, slit_along
from ..finish.pieces import Piece, extract, measured, try_piece
from ..finish.projected import projected
from ..finish.slits import Flat
from ..finish.twolevel import TwoLevel
from ..search.labels import dual_graph
from ..search.state import State
from ..workers import parallel_map
from .groups import carried_groups
from .layout import carried_jacobians
from .scraps import scraps_given
from .sides import faces_beside

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..config import FineConfig, FinishConfig
    from ..finish.arap import Solve
    from .groups import Group


def refined(
    surface: Surface,
    middle: Surface,
    pieces: list[Piece],
    config: FinishConfig,
    late: Late = never,
    last: Late = never,
) -> list[Piece]:
    """The charts of the middle mesh on the surface; one that can't be laid out like its source is flattened anew.

    Once it is ``late``, borders of many charts are not weighed, a valid layout may be worse than its source, charts
    lose all that folds, and what has no layout is projected; from the ``last`` moment on, whatever is left.
    """
    shape = surface.shape
    graph = dual_graph(shape, edge_table(surface.faces), config.labels.seams)
    groups = carried_groups(shape, graph, middle, pieces, config, late)
    groups.sort(key=lambda group: -len(group.ids))
    total = float(surface.face_areas().sum())
    found = parallel_map(lambda group: [] if last() else refined_piece(surface, group, total, config, late), groups)
    failed = [group for group, of_one in zip(groups, found, strict=True) if not of_one]
    if late() and failed:
        left = np.sort(np.concatenate([group.ids for group in failed]))
        found.append(projected(surface, left, total, config.project))
        failed = []
    anew = State(shape, graph, config) if failed else None
    if anew is not None:
        anew.add_all_valid([(group.ids, group.source.slits) for group in failed])
    charts = [of_one[0] for of_one in found if of_one] + ([] if anew is None else list(anew.pieces.values()))
    return scraps_given(surface, charts, [scrap for of_one in found for scrap in of_one[1:]], config, late)


def refined_piece(
    surface: Surface, group: Group, total: float, config: FinishConfig, late: Late = never
) -> list[Piece]:
    """The faces of a group laid out like their source, and what had to be cut off; empty where no way to is valid.

    It may be no worse than the source by more than the configured factor, unless it is ``late``, or too large for SLIM.
    """
    if late():
        config = replace(config, fine=config.fine.in_a_hurry())
    ids, source, near = group
    whole = extract(surface, ids)
    allowed = config.carry.worse * source.energy + config.carry.slack * float(whole.face_areas().sum()) / total
    best: list[Piece] = []
    noisy = surface.calm is not None  # how much a chart stretches is the noise's doing then
    for disk in opened_alike(whole, source, config):
        uv, wrong = laid_out(disk, source.flat, config, near)
        found = without_folds(surface, ids, Flat(disk, uv, {}), wrong, total, config, late)
        if found and (not best or total_cost(found, config) < total_cost(best, config)):
            best = found
        if best and (best[0].energy <= allowed or noisy or late()):
            break
    torn = len(best) > config.fine.scraps and len(ids) <= config.fine.anew
    dear = bool(best) and best[0].energy > allowed and not noisy and len(ids) <= config.fine.largest
    if not best or ((torn or dear) and not late()):
        return []
    return [replace(best[0], slits=source.slits, resort=source.resort), *best[1:]]


def total_cost(pieces: list[Piece], config: FinishConfig) -> float:
    """What pieces add to the objective, their borders left out."""
    return sum(piece.cost(config.slit.price) for piece in pieces)


def without_folds(
    surface: Surface,
    ids: NDArray[np.int64],
    flat: Flat,
    wrong: NDArray[np.bool_],
    total: float,
    config: FinishConfig,
    late: Late = never,
) -> list[Piece]:
    """The piece, first, less the faces that fold or lie over others, and these, cut off, as others.

    Where any are ``wrong`` (m,), all are tested: a border may run over faces farther in.
    """
    rows, rest = np.arange(len(ids)), flat
    if wrong.mean() > config.fine.most_wrong:
        return []
    if wrong.any():
        off = in_the_way(flat, config.fine)
        if off.mean() > config.fine.most_off:
            return []
        part = components(flat.surface.faces[~off])
        rows = np.flatnonzero(~off)[part == np.bincount(part).argmax()]
        rest = restricted(flat, rows)
    left = np.ones(len(ids), dtype=bool)
    left[rows] = False
    off = ids[left]
    flaps = projected(surface, off, total, config.project) if late() else flaps_apart(surface, off, total, config)
    return [measured(surface, ids[rows], rest, total, ()), *flaps]


def in_the_way(flat: Flat, config: FineConfig) -> NDArray[np.bool_]:
    """(f,) bool: flipped faces and those around them, and of two that overlap one: without these it is valid."""
    faces = flat.surface.faces
    off = within_rings(faces, flipped_triangles(flat.uv[faces]), len(flat.uv), config.around)
    rest = np.flatnonzero(~off)
    off[rest[flap_faces(flat.uv[faces[rest]], flat.surface.face_areas()[rest])]] = True
    return off


def flaps_apart(surface: Surface, ids: NDArray[np.int64], total: float, config: FinishConfig) -> list[Piece]:
    """Each connected group of a few faces ids (m,), as a piece of its own."""
    if len(ids) == 0:
        return []
    group, pieces = components(surface.faces[ids]), []
    for number in range(int(group.max()) + 1):
        flap = ids[group == number]
        laid = try_piece(surface, flap, total, config)
        pieces += [laid] if isinstance(laid, Piece) else unwrapped_by_xatlas(surface, flap, total)
    return pieces


def wrong_faces(faces: NDArray[np.int64], rim: NDArray[np.int64], uv: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(f,) bool: faces (f, 3) that uv (v, 2) flips, and those of the border, ``rim``, that overlap each other."""
    wrong = flipped_triangles(uv[faces])
    wrong[rim[overlapping_pairs(uv[faces[rim]]).reshape(-1)]] = True
    return wrong


def opened_alike(whole: Surface, source: Piece, config: FinishConfig) -> Iterator[Surface]:
    """The ways to open a piece, first those that leave as many borders as its source has."""
    slit = slit_along(whole, source.slits, config.slit)
    loops, others = len(boundary_loops(source.flat.surface.faces)), []
    for opening in openings(slit, config.slit.seams):
        if len(boundary_loops(opening.disk.faces)) == loops:
            yield opening.disk
        else:
            others.append(opening.disk)
    yield from others


def laid_out(
    disk: Surface, source: Flat, config: FinishConfig, near: NDArray[np.int64] | None = None
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Uv (v, 2) of an opened piece, like its source's, and the faces (f,) bool that are flipped or overlap there.

    First with the source's stretch, contacts and all, then as rigid as it may become without overlap.
    near: as `faces_beside` takes it.
    """
    fine, faces = config.fine, disk.faces
    nearest = faces_beside(disk, source, config, near)
    coarse = weights_of(disk, source.surface, nearest)
    solver = partial(solver_with, coarse, fine.tolerance, fine.solver_steps)
    rim = rim_faces(faces, boundary_edges(faces))
    rigid = RigidSteps(disk, solver)
    uv = rigid.solve(bounded(carried_jacobians(disk, source, nearest), fine.steepest), coarse @ source.uv)
    best, fewest = uv, np.ones(len(faces), dtype=bool)
    touching = np.zeros(len(uv), dtype=bool)
    for step in range(fine.steps + fine.contacts):
        if step:
            uv = rigid.solve(rotations(rigid, uv, fine.rings), uv)
        flat = evened_out(faces, uv, config.slit.contact.unfolding)
        found = wrong_faces(faces, rim, uv if flat is None else flat)
        if found.sum() <= fewest.sum():
            best, fewest = uv if flat is None else flat, found
        elif not fewest.any():
            touching[faces[found]] = True
            held = np.flatnonzero(touching)
            rigid = RigidSteps(disk, solver, Pins(held, best[held], fine.hold))
            uv = best
    return best, fewest


def rotations(rigid: RigidSteps, uv: NDArray[np.float64], rings: int) -> NDArray[np.float64]:
    """(f, 2, 2) nearest rotations at uv (v, 2); faces within ``rings`` of a flipped one turn as the others beside them.

    A fold at the border is stable: every face of it is as rigid as can be.
    """
    vertices, faces = rigid.surface.vertices, rigid.surface.faces
    turn = nearest_rotations(rigid.jacobians(uv))
    wrong = within_rings(faces, flipped_triangles(uv[faces]), len(uv), rings)
    near = np.flatnonzero(within_rings(faces, wrong, len(uv), 1))
    beside = spread(faces[near], wrong[near])
    fold = np.flatnonzero(beside != np.arange(len(near)))
    if len(fold):
        part, around = Surface(vertices, faces[near[fold]]), Surface(vertices, faces[near])
        turn[near[fold]] = nearest_rotations(carried_jacobians(part, Flat(around, uv, {}), beside[fold]))
    return turn


def spread(faces: NDArray[np.int64], wrong: NDArray[np.bool_]) -> NDArray[np.int64]:
    """(f,) the face itself, or for wrong (f,) ones the nearest other across edges; themselves where there is none."""
    beside, left = np.arange(len(wrong)), wrong.copy()
    table = edge_table(faces)
    pairs = table.edge_faces[table.manifold]
    pairs = np.concatenate([pairs, pairs[:, ::-1]])
    pairs = pairs[wrong[pairs[:, 1]]]
    while True:
        onto = pairs[~left[pairs[:, 0]] & left[pairs[:, 1]]]
        if len(onto) == 0:
            return beside
        face, first = np.unique(onto[:, 1], return_index=True)
        beside[face] = beside[onto[first, 0]]
        left[face] = False


def bounded(jacobian: NDArray[np.float64], steepest: float) -> NDArray[np.float64]:
    """Jacobians (f, 2, 2); those that stretch or squeeze by more than a factor are rotations alone: a sliver's."""
    large, small = singular_values(jacobian)
    wild = (large > steepest) | (small < 1.0 / steepest)
    return np.where(wild[:, None, None], nearest_rotations(jacobian), jacobian)


def solver_with(coarse: sparse.csr_array, tolerance: float, most: int, matrix: sparse.csr_array) -> Solve:
    """Solves by conjugate gradients with a coarse level (v, w)."""
    return TwoLevel(matrix, coarse, tolerance, most).solve


def weights_of(disk: Surface, source: Surface, nearest: NDArray[np.int64]) -> sparse.csr_array:
    """(v, w) weights of the source's vertices at those of a piece: barycentric in the nearest (f,) of a face around it.

    Clipped to the triangle: no weight is negative, and they add up to 1.
    """
    count = len(disk.vertices)
    face = np.zeros(count, dtype=np.int64)
    face[disk.faces.reshape(-1)] = np.repeat(nearest, 3)
    corner = source.triangles[face]
    first, second = corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]
    offset = disk.vertices - corner[:, 0]
    a, b, c = (np.einsum("vc,vc->v", x, y) for x, y in ((first, first), (first, second), (second, second)))
    p, q = np.einsum("vc,vc->v", offset, first), np.einsum("vc,vc->v", offset, second)
    determinant = np.maximum(a * c - b * b, 1e-300)
    one, two = (c * p - b * q) / determinant, (a * q - b * p) / determinant
    weight = np.clip(np.stack([1.0 - one - two, one, two], axis=1), 0.0, 1.0)
    weight /= weight.sum(axis=1, keepdims=True)
    entries = weight.reshape(-1), (np.repeat(np.arange(count), 3), source.faces[face].reshape(-1))
    return sparse.csr_array(entries, shape=(count, len(source.vertices)))
