"""What makes a uv layout unfit for baking: triangles that lie on each other, or beyond the unit square."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .overlap import overlapping_pairs

if TYPE_CHECKING:
    from numpy.typing import NDArray

EDGE = 1e-6
"""How far beyond the unit square still counts as on its border."""


def layout_faults(corner_uv: NDArray[np.float64], *, tiles: bool = False) -> list[str]:
    """A sentence for each fault of uv (f, 3, 2), with the share of faces that have it.

    tiles: whether uv beyond the unit square are wanted, as with UDIM.

    >>> layout_faults(np.array([[[0, 0], [1, 0], [0, 1]]] * 2, dtype=float))
    ['100 % of the faces overlap others in uv']
    """
    count = max(len(corner_uv), 1)
    overlapping = len(np.unique(overlapping_pairs(corner_uv)))
    beyond = 0 if tiles else int(((corner_uv < -EDGE) | (corner_uv > 1.0 + EDGE)).any(axis=(1, 2)).sum())
    facts = ((overlapping, "overlap others in uv"), (beyond, "have uv beyond the unit square"))
    return [f"{100.0 * faces / count:.3g} % of the faces {what}" for faces, what in facts if faces]
