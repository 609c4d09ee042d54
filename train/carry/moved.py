"""Faces that went from one side of a seam to the other, laid where their new neighbours lead; all others stay.

m faces of a piece, opened along its seams as they are now; its source is the piece before they were moved.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.topology import edge_table, face_components
from ...runtime.mesh import Surface
from ..finish.arap import RigidSteps
from ..finish.flatten import Pins
from ..finish.slits import Flat
from .fine import bounded, spread
from .layout import carried_jacobians

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import FineConfig
    from ..finish.pieces import Piece


def as_others_lead(
    disk: Surface, ids: NDArray[np.int64], source: Piece, config: FineConfig
) -> NDArray[np.float64] | None:
    """Uv (v, 2) of faces ids (m,) in which all that hang together as in their source stay where they were.

    The others go on from the map of the nearest of these.  None where not even these fit together any more.
    """
    row = rows_of(ids, source.ids)
    stays = staying(disk, row, source.flat)
    uv, known = np.zeros((len(disk.vertices), 2)), np.zeros(len(disk.vertices), dtype=bool)
    where = source.flat.uv[source.flat.surface.faces[row[stays]]]
    uv[disk.faces[stays]] = where
    known[disk.faces[stays]] = True
    if not np.array_equal(uv[disk.faces[stays]], where):
        return None
    moved, beside = np.flatnonzero(~stays), spread(disk.faces, ~stays)[~stays]
    if len(moved) == 0:
        return uv
    if not stays[beside].all():
        return None
    patch, used = disk.part(moved)
    held = np.flatnonzero(known[used])
    lead = Surface(source.flat.surface.vertices, source.flat.surface.faces[row[beside]])
    turn = carried_jacobians(patch, Flat(lead, source.flat.uv, {}), np.arange(len(moved)))
    rigid = RigidSteps(patch, pins=Pins(held, uv[used[held]], config.hold))
    uv[used[~known[used]]] = rigid.solve(bounded(turn, config.steepest))[~known[used]]
    return uv


def rows_of(ids: NDArray[np.int64], among: NDArray[np.int64]) -> NDArray[np.int64]:
    """(m,) where each of ids (m,) stands among others (n,), −1 where it does not."""
    order = np.argsort(among)
    place = np.searchsorted(among, ids, sorter=order).clip(max=len(among) - 1)
    return np.where(among[order[place]] == ids, order[place], -1)


def staying(disk: Surface, row: NDArray[np.int64], source: Flat) -> NDArray[np.bool_]:
    """(m,) bool: the most faces that hang together in a piece and, at rows (m,) of its source, hung together there."""
    table = edge_table(disk.faces)
    half = table.edge_halfedges[table.manifold]
    face, corner, was = half // 3, half % 3, source.surface.faces
    (first, second), (one, other) = row[face].T, corner.T
    as_before = (first >= 0) & (second >= 0)
    as_before &= was[first, one] == was[second, (other + 1) % 3]
    as_before &= was[first, (one + 1) % 3] == was[second, other]
    part = face_components(len(disk.faces), face[as_before])
    return (part == np.bincount(part, row >= 0).argmax()) & (row >= 0)
