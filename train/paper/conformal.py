"""Angles for areas: SLIM with conformal energy on one disk, from a valid map to a valid map.   v vertices.

Valid means: no flipped triangle, and a border that doesn't cross itself.  uv (v, 2) are at the surface's scale.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.triangles import corner_angles
from ..finish.contact import Relaxed, as_pins, boundary_edges, excess_energy, is_valid, separate
from ..finish.flatten import CONFORMAL, Slim, at_own_area, slim

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface
    from ..finish.config import ContactConfig
    from ..finish.flatten import Pins


@dataclass(frozen=True)
class ConformalConfig:
    """How much distortion of area is accepted for better angles."""

    iterations: int = 20
    """SLIM iterations of conformal energy, at most; 0 leaves the map as it is."""
    enough: float = 0.02
    """Conformality (radians) at which they end: a third of the paper's; below, areas are worth more than angles."""
    growth: float = 4.0
    """Factor by which the symmetric Dirichlet excess energy may grow …"""
    allowance: float = 0.05
    """… beyond this, which is per area."""
    block: int = 2
    """Iterations between two tests."""


def conformal_steps(
    disk: Surface, start: NDArray[np.float64], config: ConformalConfig, contact: ContactConfig
) -> NDArray[np.float64]:
    """The valid uv (v, 2) after SLIM with conformal energy; ``start`` where none is found.

    From an isometric map that took its slits, angles improve fast and areas give way a little; from a circle areas
    vary widely, but little overlaps on the way.  Overlap that comes on the way mostly goes again; where it doesn't,
    contacts hold the chart apart from the last valid map on.
    """
    solver, best, uv = Slim(disk, start, energy=CONFORMAL), start, start
    most_energy = highest_energy(disk, start, config)
    for _ in range(config.iterations // config.block):
        if best is uv and angle_error(disk, best) < config.enough:
            return best
        uv = at_own_area(disk, solver.run(config.block))
        if excess_energy(disk, uv) > most_energy:
            break
        if is_valid(disk, uv):
            best = uv
    return best if best is uv else conformal_contacts(disk, best, most_energy, config, contact)


def conformal_contacts(
    disk: Surface, start: NDArray[np.float64], most_energy: float, config: ConformalConfig, contact: ContactConfig
) -> NDArray[np.float64]:
    """The uv (v, 2) after single conformal iterations from a valid ``start``, each taken apart before the next."""
    edges, best = boundary_edges(disk.faces), start
    state = Relaxed(start, {})
    for _ in range(config.iterations):
        if angle_error(disk, best) < config.enough:
            break
        moved = slim(disk, state.uv, 1, as_pins(state.pins, contact.weight), CONFORMAL)
        apart = separate(disk, Relaxed(moved, state.pins), edges, contact, partial(conformal_step, disk, contact))
        if apart is None:
            break
        state, uv = apart, at_own_area(disk, apart.uv)
        if not is_valid(disk, uv) or excess_energy(disk, uv) > most_energy:
            break
        best = uv
    return best


def conformal_step(
    disk: Surface, contact: ContactConfig, uv: NDArray[np.float64], pins: Pins | None
) -> NDArray[np.float64]:
    """The uv (v, 2) after conformal SLIM that gives way to pins."""
    return slim(disk, uv, contact.iterations, pins, CONFORMAL)


def highest_energy(disk: Surface, start: NDArray[np.float64], config: ConformalConfig) -> float:
    """The excess energy up to which distortion of area is accepted for better angles."""
    return config.growth * excess_energy(disk, start) + config.allowance * float(disk.face_areas().sum())


def angle_error(disk: Surface, uv: NDArray[np.float64]) -> float:
    """Mean |angle − uv angle| over the corners of the faces, radians: the paper's conformality."""
    return float(np.abs(corner_angles(disk.triangles) - corner_angles(uv[disk.faces])).mean())
