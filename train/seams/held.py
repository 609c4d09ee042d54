"""Pieces laid out within scaffolds, from a start that lies over itself nowhere: a layout with more cuts, or the circle.

v vertices.  Energies are shares of the surface's area.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.overlap import flipped_triangles
from ..finish.arap import unfolded
from ..finish.contact import is_valid
from ..finish.flaps import Trimmed
from ..finish.flatten import circle_map, fill_holes, sorted_loops
from ..finish.pieces import measured
from ..finish.scaffold import held_apart
from ..finish.slits import Flat

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..finish.pieces import Overlapping, Piece, Start
    from ..search.search import Search


def laid_within(search: Search, found: Overlapping, goal: float, given: Start | None) -> Trimmed | None:
    """A flattening that overlaps laid out anew within scaffolds; None where it can't be, or not as well as ``goal``."""
    disk, contact = found.flat.surface, search.config.slit.contact
    start = None if given is None else without_flips(disk, given(disk), contact.unfolding)
    if start is None or not is_valid(disk, start):
        outer, *holes = sorted_loops(disk)
        start = circle_map(fill_holes(disk, holes), outer)[: len(disk.vertices)]
    uv = held_apart(disk, start, contact.scaffold, goal * search.area) if is_valid(disk, start) else None
    if uv is None or not is_valid(disk, uv):
        return None
    return Trimmed(
        measured(search.surface, found.ids, Flat(disk, uv, {}), search.area, found.slits, search.config.slit.seams),
        (),
        0.0,
    )


def without_flips(disk: Surface, uv: NDArray[np.float64], steps: int) -> NDArray[np.float64] | None:
    """A layout after rigid steps, where it has flips; None where it has some still."""
    return unfolded(disk, uv, steps) if flipped_triangles(uv[disk.faces]).any() else uv


def sewn_up(piece: Piece, disk: Surface) -> NDArray[np.float64]:
    """Uv (v, 2) of the same faces with fewer cuts: each vertex half way between the places that it had.

    disk: those faces, and fans that fill holes after them; the middle of a fan lies in the middle of its border.
    """
    own = len(piece.ids)
    corner = piece.flat.uv[piece.flat.surface.faces].reshape(-1, 2)
    uv = mean_at(disk.faces[:own].reshape(-1), corner, len(disk.vertices))
    if len(disk.faces) > own:
        border, middle = disk.faces[own:, :1], disk.faces[own:, 2]
        filled = np.unique(middle)
        uv[filled] = mean_at(middle, uv[border[:, 0]], len(disk.vertices))[filled]
    return uv


def mean_at(vertex: NDArray[np.int64], places: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """(size, 2) the mean of the places (n, 2) that each vertex (n,) has; 0 for one that has none."""
    count = np.maximum(np.bincount(vertex, minlength=size), 1)
    return np.stack([np.bincount(vertex, at, minlength=size) for at in places.T], axis=1) / count[:, None]
