"""Charts too long for a page, cut across: one strip would set the scale of all others.

A chart of length L and width W needs a page of side L, or (L + W)/√2 along its diagonal, whatever else lies on it; two
of half the length need about half of that.
Cuts run across the long axis of the chart in the plane, where edges of the mesh are shortest.   m faces of a chart.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.topology import edge_table
from ..carry.arcs import straight_pieces
from ..carry.carry import WALL
from ..finish.flaps import restricted
from ..finish.pieces import Piece, measured
from ..search.labels import connected_pieces, dual_graph, smooth_labels
from .develop import least_rectangle

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..config import FinishConfig


def shortened(surface: Surface, pieces: list[Piece], page: float, most: int, config: FinishConfig) -> list[Piece]:
    """The charts of a part of area 1, those too long for the page cut across, as far as the part may have more.

    page: √(area of all that is unwrapped), in the part's units.  most: charts that the part may have.
    """
    found = list(pieces)
    for piece in sorted(pieces, key=lambda piece: -page_side(piece)):
        if page_side(piece) <= config.shorten.above * page:
            break
        start, length = along(piece)
        room = most - len(found) + 1
        count = min(int(np.ceil(length / (config.shorten.to * page))), room)
        parts = cut_across(piece, start, count, config) if count > 1 else []
        if 1 < len(parts) <= room:
            found.remove(piece)
            found += [
                measured(surface, piece.ids[rows], restricted(piece.flat, rows), 1.0, piece.slits) for rows in parts
            ]
    return straight_pieces(surface, found, config) if len(found) > len(pieces) else found


def page_side(piece: Piece) -> float:
    """Side of the least square that holds the box around a chart, straight or along the diagonal."""
    sides = least_rectangle(piece.flat.uv[piece.flat.surface.faces])
    return float(min(sides.max(), sides.sum() / np.sqrt(2.0)))


def along(piece: Piece) -> tuple[NDArray[np.float64], float]:
    """Where each face lies along the longest direction of a chart, from 0 to 1 (m,), and the length of the whole."""
    corners = piece.flat.uv[piece.flat.surface.faces]
    points = corners.reshape(-1, 2) - corners.reshape(-1, 2).mean(axis=0)
    place = corners @ np.linalg.svd(points.T @ points)[0][:, 0]
    lowest, length = float(place.min()), float(np.ptp(place))
    return (place.mean(axis=1) - lowest) / max(length, 1e-300), length


def cut_across(piece: Piece, place: NDArray[np.float64], count: int, config: FinishConfig) -> list[NDArray[np.int64]]:
    """Rows of the faces of each part of a chart that is cut in ``count`` of like length, at the shortest edges near.

    place: (m,) of the faces along the chart, from 0 to 1.
    """
    flat = piece.flat.surface
    graph = dual_graph(flat, edge_table(flat.faces), config.labels.seams)
    ahead = np.arange(count)
    # a label may reach over into its neighbours' shares
    near = np.abs(place[:, None] * count - (ahead + 0.5)) < 0.5 + config.shorten.shift
    doubt = np.where(near, 0.0, WALL)
    doubt[np.arange(len(place)), np.clip((place * count).astype(np.int64), 0, count - 1)] -= 1e-9
    number = connected_pieces(smooth_labels(doubt, graph), graph)
    return [np.flatnonzero(number == each) for each in range(int(number.max()) + 1)]
