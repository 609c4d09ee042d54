"""Valid charts of any surface in the time that laying it flat a few times takes.

Clusters of faces that face one way are laid flat all together.  What folds at a rim is cut off, a chart that lies over
itself is cut in two, and both are laid flat again, until all are valid.  Then charts join those beside them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.distortion import MOST_EXCESS, TRIM, oriented_energy
from ..finish.flatten import jacobians
from ..workers import one_thread_each
from .join import Joining
from .settle import settled
from .sheet import Sheet

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...runtime.mesh import Surface
    from ..config import FinishConfig
    from ..finish.pieces import Piece

    Left = Callable[[], float]
    """Seconds that are left."""


def no_end() -> float:
    """Seconds without end."""
    return math.inf


def swift_pieces(surface: Surface, config: FinishConfig, left: Left = no_end) -> list[Piece]:
    """Charts of a surface, whose edges need not be manifold; they are valid, whatever time is left to join them."""
    return joined(swift_sheet(surface, config), left)


def swift_sheet(surface: Surface, config: FinishConfig) -> Sheet:
    """The same before they are joined."""
    with one_thread_each():
        sheet = Sheet(surface, config)
        settled(sheet)
        return sheet


def joined(sheet: Sheet, left: Left = no_end) -> list[Piece]:
    """Charts of a sheet, joined as far as it pays and time is left."""
    with one_thread_each():
        Joining(sheet).run(left)
        return sheet.pieces()


def better(
    found: list[Piece], sheet: Sheet, objective: Callable[[list[Piece]], float], left: Left
) -> list[Piece] | None:
    """The charts of a sheet, joined, if they are better than those found elsewhere; else None."""
    cost, swift = objective(found) + trimmed(found), sheet.pieces()
    if cost > sheet.config.swift.hope * (objective(swift) + trimmed(swift)):
        swift = joined(sheet, left)
    return swift if objective(swift) + trimmed(swift) < cost else None


def trimmed(pieces: list[Piece]) -> float:
    """What faces are stretched beyond the bound of an objective, up to that of metrics; pieces of area 1 together."""
    lost = 0.0
    for piece in pieces:
        surface = piece.flat.surface
        energy = np.minimum(oriented_energy(jacobians(surface, piece.flat.uv)), TRIM)
        lost += float(surface.face_areas() @ np.maximum(energy - 1.0 - MOST_EXCESS, 0.0))
    return lost


def swift_rest(surface: Surface, pieces: list[Piece], config: FinishConfig, left: Left) -> list[Piece]:
    """Charts of the faces that no piece has."""
    free = np.ones(len(surface.faces), dtype=np.bool_)
    for piece in pieces:
        free[piece.ids] = False
    ids = np.flatnonzero(free)
    if len(ids) == 0:
        return []
    part, _ = surface.part(ids)
    share = float(part.face_areas().sum() / surface.face_areas().sum())
    found = swift_pieces(part, config, left)
    return [replace(piece, ids=ids[piece.ids], energy=piece.energy * share) for piece in found]
