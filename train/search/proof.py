"""The exact proof of finished charts: no flipped triangle, no overlap.   f faces."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...runtime.errors import FinishError
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs

if TYPE_CHECKING:
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


def is_valid(piece: Piece) -> bool:
    """True for a piece without flips and overlap, by the exact tests."""
    uv = piece.flat.uv[piece.flat.surface.faces]
    return not flipped_triangles(uv).any() and len(overlapping_pairs(uv)) == 0
