"""Valid charts of any surface in the time that laying it flat a few times takes.

Clusters of faces that face one way are laid flat all together.  What folds at a rim is cut off, a chart that lies over
itself is cut in two, and both are laid flat again, until all are valid.  Then charts join those beside them.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

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
    with one_thread_each():
        sheet = Sheet(surface, config)
        settled(sheet)
        Joining(sheet).run(left)
        return sheet.pieces()


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
