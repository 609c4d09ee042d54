"""From a middle mesh, thinned but searched and finished, to the fine surface itself.   f faces · v vertices · area 1.

A fine chart differs from its chart on the middle mesh in detail only.  It takes that one's rotations, and rigid steps
by conjugate gradients lay it out, that one being the coarse level: no factorization or SLIM sees the fine surface.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from scipy import sparse

from ...runtime.geometry.distortion import singular_values
from ...runtime.geometry.overlap import overlapping_pairs
from ...runtime.geometry.topology import boundary_loops, edge_table
from ...runtime.mesh import Surface
from ..finish.arap import RigidSteps, evened_out, nearest_rotations
from ..finish.contact import boundary_edges, rim_faces
from ..finish.flatten import Pins, jacobians
from ..finish.openings import openings, slit_along
from ..finish.pieces import Piece, extract, measured
from ..finish.slits import Flat
from ..finish.twolevel import TwoLevel
from ..workers import parallel_map
from .carry import fragments_joined, smoothed_in_band, votes
from .labels import dual_graph
from .layout import carried_jacobians
from .search import Search
from .sides import faces_beside

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from ..config import FinishConfig
    from ..finish.arap import Solve


def refined(surface: Surface, middle: Surface, pieces: list[Piece], config: FinishConfig) -> list[Piece]:
    """The charts of the middle mesh on the surface; one that can't be laid out as there is flattened anew."""
    label = np.zeros(len(middle.faces), dtype=np.int64)
    for number, piece in enumerate(pieces):
        label[piece.ids] = number
    graph = dual_graph(surface, edge_table(surface.faces), config.labels.seams)
    areas = surface.face_areas()
    smooth = smoothed_in_band(votes(middle, label, surface, config.carry), areas, graph, config)
    joined = fragments_joined(smooth, areas, graph, config.carry.islet)
    groups = [np.flatnonzero(joined == number) for number in range(int(joined.max()) + 1)]
    sources = [pieces[int(np.bincount(smooth[ids]).argmax())] for ids in groups]
    order = sorted(range(len(groups)), key=lambda number: -len(groups[number]))
    total = float(areas.sum())
    found = parallel_map(lambda number: refined_piece(surface, groups[number], sources[number], total, config), order)
    search = None
    for number, piece in zip(order, found, strict=True):
        if piece is not None:
            continue
        search = search or Search(surface, graph, config)
        search.add_valid(groups[number], sources[number].slits)
    if search is not None:
        search.place_loose()
    return [piece for piece in found if piece is not None] + ([] if search is None else list(search.pieces.values()))


def refined_piece(
    surface: Surface, ids: NDArray[np.int64], source: Piece, total: float, config: FinishConfig
) -> Piece | None:
    """The faces ids (m,) laid out as on the middle mesh, of lowest cost; None where no way to open them is valid so."""
    whole = extract(surface, ids)
    best: Piece | None = None
    for disk in opened_alike(whole, source, config):
        uv = laid_out(disk, source.flat, config)
        if uv is None:
            continue
        piece = replace(measured(surface, ids, Flat(disk, uv, {}), total, source.slits), resort=source.resort)
        if best is None or piece.cost(config.slit.price) < best.cost(config.slit.price):
            best = piece
    allowed = config.carry.worse * source.energy + config.carry.slack * float(whole.face_areas().sum()) / total
    return best if best is not None and best.energy <= allowed else None


def opened_alike(whole: Surface, source: Piece, config: FinishConfig) -> Iterator[Surface]:
    """The ways to open a piece that leave as many borders as there are on the middle mesh; all where none does."""
    slit = slit_along(whole, source.slits, config.slit)
    ways = [opening.disk for opening in openings(slit, config.slit.seams)]
    loops = len(boundary_loops(source.flat.surface.faces))
    alike = [way for way in ways if len(boundary_loops(way.faces)) == loops]
    yield from alike or ways


def laid_out(disk: Surface, source: Flat, config: FinishConfig) -> NDArray[np.float64] | None:
    """Uv (v, 2) of an opened piece, as on the middle mesh, without flips and overlap; None where that can't be had.

    First with the middle mesh's stretch, contacts and all, then as rigid as it may become without overlap.
    """
    fine = config.fine
    nearest = faces_beside(disk, source, config)
    coarse = weights_of(disk, source.surface, nearest)
    solver = partial(solver_with, coarse, fine.tolerance, fine.solver_steps)
    rigid = RigidSteps(disk, solver)
    valid = None
    uv = rigid.solve(bounded(carried_jacobians(disk, source, nearest), fine.steepest), coarse @ source.uv)
    touching = np.zeros(len(uv), dtype=bool)
    for _ in range(fine.steps + fine.contacts):
        flat = evened_out(disk.faces, uv, config.slit.contact.unfolding)
        found = overlapping_vertices(disk.faces, uv if flat is None else flat)
        if flat is not None and not found.any():
            valid = flat
        elif valid is not None:
            touching |= found
            held = np.flatnonzero(touching)
            rigid = RigidSteps(disk, solver, Pins(held, valid[held], fine.hold))
            uv = valid
        uv = rigid.solve(nearest_rotations(jacobians(disk, uv)), uv)
    return valid


def bounded(jacobian: NDArray[np.float64], steepest: float) -> NDArray[np.float64]:
    """Jacobians (f, 2, 2); those that stretch or squeeze by more than a factor are rotations alone: a sliver's."""
    large, small = singular_values(jacobian)
    wild = (large > steepest) | (small < 1.0 / steepest)
    return np.where(wild[:, None, None], nearest_rotations(jacobian), jacobian)


def overlapping_vertices(faces: NDArray[np.int64], uv: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(v,) bool: a face at the vertex, along the border, lies over another; none where no border crosses itself."""
    rim = rim_faces(faces, boundary_edges(faces))
    found = np.zeros(len(uv), dtype=bool)
    found[faces[rim[overlapping_pairs(uv[faces[rim]])]]] = True
    return found


def solver_with(coarse: sparse.csr_array, tolerance: float, most: int, matrix: sparse.csr_array) -> Solve:
    """Solves by conjugate gradients with a coarse level (v, w)."""
    return TwoLevel(matrix, coarse, tolerance, most).solve


def weights_of(disk: Surface, source: Surface, nearest: NDArray[np.int64]) -> sparse.csr_array:
    """(v, w) weights of coarse vertices at those of a piece: barycentric in the nearest (f,) of a face around it.

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
