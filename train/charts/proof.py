"""The exact proof of finished charts: no flipped triangle, no overlap.   f faces."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from ...runtime.errors import FinishError
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.process.deadline import Late, never
from ..finish.config import ProjectConfig
from ..finish.fallback import unwrapped_by_xatlas
from ..finish.flaps import trimmed
from ..finish.pieces import Overlapping
from ..finish.projected import projected
from ..workers import parallel_map

if TYPE_CHECKING:
    from ...runtime.mesh import Surface
    from ..finish.pieces import Piece


def verify(pieces: list[Piece]) -> None:
    """The exact check of each piece: raises FinishError where a triangle is flipped or two overlap."""
    for number, piece in enumerate(pieces):
        uv = piece.flat.uv[piece.flat.surface.faces]
        flips, overlaps = int(flipped_triangles(uv).sum()), len(overlapping_pairs(uv))
        if flips or overlaps:
            raise FinishError(
                f"chart {number} of {len(piece.ids)} faces has {flips} flipped triangles and {overlaps} overlapping "
                "pairs, expected none; please report the mesh"
            )


def all_proven(
    surface: Surface, pieces: list[Piece], config: ProjectConfig | None = None, late: Late = never
) -> list[Piece]:
    """The pieces, each as it is where the exact check passes, else what ``proven`` makes of it.

    Once it is ``late``, those that fail are projected, by the numbers of ``config``.

    Raises: FinishError where that is not valid either (a defect).
    """
    order = sorted(range(len(pieces)), key=lambda number: -len(pieces[number].ids))
    valid = dict(zip(order, parallel_map(lambda number: is_valid(pieces[number]), order), strict=True))
    found: list[Piece] = []
    for number, piece in enumerate(pieces):
        if not valid[number] and late():
            area = float(surface.face_areas().sum())
            found += projected(surface, piece.ids, area, config or ProjectConfig())
            continue
        parts = [piece] if valid[number] else proven(surface, piece)
        if not valid[number]:
            verify(parts)
        found += parts
    return found


def proven(surface: Surface, piece: Piece) -> list[Piece]:
    """The piece, or where the exact check fails, what is left without the faces in its way, and these by themselves.

    Edges that lie upon each other in a layout may cross by one rounding once it is scaled.
    """
    if is_valid(piece):
        return [piece]
    area = float(surface.face_areas().sum())
    less = trimmed(surface, Overlapping(piece.ids, piece.flat, ()), area, 1.0)
    if less is None or not is_valid(less.piece):
        return unwrapped_by_xatlas(surface, piece.ids, area)
    kept = replace(less.piece, resort=piece.resort)
    return [kept, *(part for flap in less.flaps for part in unwrapped_by_xatlas(surface, flap, area))]


def is_valid(piece: Piece) -> bool:
    """True for a piece without flips and overlap, by the exact tests."""
    uv = piece.flat.uv[piece.flat.surface.faces]
    return not flipped_triangles(uv).any() and len(overlapping_pairs(uv)) == 0
