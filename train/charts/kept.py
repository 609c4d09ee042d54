"""The islands of the uv that a mesh has, as charts: they stay, and only the distortion inside is lowered.

Each is relaxed by SLIM from the very uv it has, in the unit ball of the surface.   f faces.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import InputError
from ...runtime.geometry.rows import grouped
from ...runtime.geometry.triangles import signed_areas
from ...runtime.mesh import Frame, Surface
from ...runtime.pack.config import IslandConfig
from ...runtime.pack.islands import islands_of
from ..finish.contact import excess_energy, is_valid
from ..finish.energies import finished_by
from ..finish.pieces import Piece
from ..finish.slits import Flat
from .charts import Finished
from .notes import kept_isometric

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset
    from ..config import FinishConfig


def kept_islands(asset: Asset, config: FinishConfig) -> Finished:
    """The islands as finished charts, in the unit ball; a mirrored one is turned over.

    Those whose triangles overlap or are turned over in the file stay as they are, and a sentence counts them: packing
    cuts out what is not valid.
    Raises: InputError where there are no uv, or an island has no area.
    """
    islands = islands_of(asset, equal=True, config=IslandConfig())
    if islands.flat:
        raise InputError(f"{islands.flat} islands of {asset.stem} have no area in uv, expected none; unwrap it anew")
    frame = Frame.of(asset.surface.vertices)
    ball = Surface(frame.apply(asset.surface.vertices), asset.surface.faces)
    charts = islands.charts
    total, pieces, broken = float(ball.face_areas().sum()), list[Piece](), 0
    for ids in grouped(charts.face_chart):
        flat = Flat.of(ball, ids, _turned(charts.corner_uv[ids] / frame.scale))
        valid = is_valid(flat.surface, flat.uv)
        broken += not valid
        flat = _relaxed(flat, config) if valid else flat
        pieces.append(Piece(ids, flat, excess_energy(flat.surface, flat.uv) / total, 0.0))
    notes = (f"{broken} islands overlap or are turned over in the file and are not relaxed",) if broken else ()
    pieces, left = finished_by(pieces, total, config.energy)
    notes += tuple(kept_isometric(left, config))
    return Finished(pieces, sum(piece.energy for piece in pieces), {"kept": len(pieces)}, notes)


def _turned(corner_uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Uv (m, 3, 2) turned over where they are mirrored."""
    return corner_uv * (-1.0, 1.0) if signed_areas(corner_uv).sum() < 0.0 else corner_uv


def _relaxed(flat: Flat, config: FinishConfig) -> Flat:
    """The flattening with less distortion, where that leaves it valid."""
    found = flat.relaxed(config.slit.contact)
    valid = is_valid(found.surface, found.uv)
    return found if valid and excess_energy(flat.surface, found.uv) < excess_energy(flat.surface, flat.uv) else flat
