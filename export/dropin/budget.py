"""What a time budget of `flexpara.xatlas` has to leave for packing, and how slow the machine is.   f faces · k charts.

Seconds were measured on one core of an AMD EPYC.  How long a mesh took to clean, beside what is usual there, says how
many times as long everything else will take.
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class BudgetConfig:
    """Seconds that are foreseen."""

    cleaning: float = 2.5e-6
    """Of cleaning a face …"""
    begun: float = 0.05
    """… and of any mesh."""
    slowest: float = 5.0
    """How many times as long may be believed."""
    packing: float = 6e-6
    """Of what is done for each face, charts in rows: they are put on the lattice, proven and handed back."""
    close: float = 2.5e-3
    """More for each chart, where they are laid close together."""

    def pace(self, faces: int, seconds: float) -> float:
        """How many times as long as foreseen so many faces took to clean; never less than once."""
        return min(max(seconds / (self.begun + self.cleaning * faces), 1.0), self.slowest)

    def packs(self, faces: int, charts: int) -> float:
        """Seconds that charts take that are laid close together."""
        return self.packing * faces + self.close * charts
