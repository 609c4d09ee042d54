"""Charts finished by another energy than the search's: angles alone, or rigidity.   A chart that would overlap stays.

isometric: symmetric Dirichlet, σ² + 1/σ² · conformal: (σ₁² + σ₂²) / 2σ₁σ₂ · arap: Σ (σ − 1)², for the singular values
σ of a face's derivative.  Each chart finished by one of the latter is then put at the area of its surface.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import igl

from ..workers import parallel_map
from .contact import excess_energy, is_valid
from .flatten import CONFORMAL, at_own_area, slim

if TYPE_CHECKING:
    from .config import EnergyConfig
    from .pieces import Piece

KINDS = {"conformal": CONFORMAL, "arap": igl.MappingEnergyType.ARAP}


def finished_by(pieces: list[Piece], total_area: float, config: EnergyConfig) -> tuple[list[Piece], int]:
    """The charts by the energy asked for, and how many stay by the search's, since they would lie over themselves."""
    if config.kind == "isometric":
        return pieces, 0
    found = parallel_map(lambda piece: by_energy(piece, total_area, config), pieces)
    return [new or old for new, old in zip(found, pieces, strict=True)], sum(new is None for new in found)


def by_energy(piece: Piece, total_area: float, config: EnergyConfig) -> Piece | None:
    """The chart after as many steps of SLIM by that energy as leave it valid; None where not even few do."""
    surface = piece.flat.surface
    for steps in config.steps:
        uv = at_own_area(surface, slim(surface, piece.flat.uv, steps, energy=KINDS[config.kind]))
        if is_valid(surface, uv):
            energy = excess_energy(surface, uv) / total_area
            return replace(piece, flat=piece.flat._replace(uv=uv), energy=energy)
    return None
