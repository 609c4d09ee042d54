"""Charts that are crumpled, charted anew as surfaces of their own.   A part has area 1.

Where charts are compared, no face counts for more than `MOST_EXCESS`: a chart of little area may keep faces that are
stretched beyond all use, as the wall of a cup does around its bottom.  At area 1 of its own that is cut.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .parts import extracted, placed

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...runtime.mesh import Surface
    from ...runtime.process.deadline import Late
    from ..finish.pieces import Piece


def uncrumpled(
    surface: Surface, pieces: list[Piece], most: float, chart: Callable[[Surface], list[Piece]], late: Late
) -> list[Piece]:
    """The charts of a part, each crumpled one replaced by what it becomes alone, if that has half its energy or less.

    most: mean excess energy of a chart that is not crumpled.  chart: charts a surface of area 1.
    """
    areas = surface.face_areas()
    found: list[Piece] = []
    for piece in pieces:
        crumpled = piece.energy > most * float(areas[piece.ids].sum()) and len(piece.ids) < len(surface.faces)
        if not crumpled or late():
            found.append(piece)
            continue
        alone = extracted(surface, piece.ids)
        parts = [placed(each, alone, surface, 1.0) for each in chart(alone.surface)]
        better = sum(each.energy for each in parts) <= piece.energy / 2.0
        found += parts if better else [piece]
    return found
