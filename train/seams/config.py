"""The numbers of closing seams, in a frozen dataclass saved with each result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class ClosingConfig:
    """How seams are closed."""

    charts: int = 8
    """Charts that the search aims at before seams are closed, whatever is asked for."""
    shares: tuple[float, ...] = (1.0, 0.5, 0.25, 0.05)
    """Lengths of the runs tried, as shares of the chain that they are part of."""
    least: int = 1
    """Edges of a run."""
    tries: int = 60
    """Runs flattened at the price of seams …"""
    tries_dearer: int = 24
    """… at each higher price, where stretch was asked for …"""
    tries_fine: int = 8
    """… and the same on the surface itself."""
    hopeless: float = 0.03
    """Share of a first layout that may lie over the rest; beyond it, it is not relaxed."""
    rounds: int = 2
    """Rounds in which a little overlap may be drawn apart."""
    patience: int = 12
    """Runs flattened in vain before the rest, foretold worse, are believed not to pay."""
    looks: int = 4
    """Runs flattened at a time."""
    doubt: float = 0.0005
    """How much better than foretold a run may turn out."""
    prices: tuple[float, ...] = (0.006, 0.015, 0.04, 0.2)
    """Prices of a seam at which more and more is closed, as long as stretch is within its bound."""
    cheaper: float = 0.5
    """Factor from one price of slits to the next, lower one, where the stretch is out of bounds."""
    cheapest: float = 0.05
    """The last such price, as a multiple of what a seam costs."""
