"""Which faces of a fine surface are laid out like which piece of its middle mesh.   f faces."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .carry import fragments_joined, smoothed_in_band, votes
from .hurried import crumbs_given, followed
from .layout import near_faces

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ...runtime.process.deadline import Late
    from ..config import FinishConfig
    from ..finish.pieces import Piece
    from ..search.labels import DualGraph


class Group(NamedTuple):
    """Connected faces of a fine surface, and the piece of its middle mesh that they are laid out like.

    ids: (m,) int64.  near: (m,) int64, the row in that piece of the middle mesh's face that is nearest to each; −1
    where that is a face of another piece.
    """

    ids: NDArray[np.int64]
    source: Piece
    near: NDArray[np.int64]


def carried_groups(
    surface: Surface, graph: DualGraph, middle: Surface, pieces: list[Piece], config: FinishConfig, late: Late
) -> list[Group]:
    """The surface's faces, group by group."""
    label, row = np.zeros((2, len(middle.faces)), dtype=np.int64)
    for number, piece in enumerate(pieces):
        label[piece.ids], row[piece.ids] = number, np.arange(len(piece.ids))
    areas, carry = surface.face_areas(), config.carry
    if late() and len(surface.faces) * len(pieces) > config.fine.hurried.weighed:
        near = near_faces(surface, middle, carry, 1)
        smooth = followed(label[near[:, 0]], graph, carry.hurried_rounds)
        joined = crumbs_given(smooth, areas, graph, carry.islet)
    else:
        near = near_faces(surface, middle, carry, carry.neighbours)
        smooth = smoothed_in_band(votes(label[near]), areas, graph, config)
        joined = fragments_joined(smooth, areas, graph, carry.islet)
    groups = []
    for ids in np.split(np.argsort(joined, kind="stable"), np.cumsum(np.bincount(joined))[:-1]):
        number = int(np.bincount(smooth[ids]).argmax())
        nearest = near[ids, 0]
        groups.append(Group(ids, pieces[number], np.where(label[nearest] == number, row[nearest], -1)))
    return groups
