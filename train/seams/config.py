"""The numbers of closing seams, in a frozen dataclass saved with each result."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(frozen=True)
class GrowingConfig:
    """How seams are grown.  Lengths are shares of √(surface area)."""

    energies: tuple[float, ...] = (0.8, 1.2, 1.6, 2.0, 2.4, 3.2)
    """Energies foretold at which seams are tried as a start, as multiples of the stretch asked for."""
    looks: int = 6
    """Slits looked at to where a conformal map would squeeze most …"""
    looks_stretched: int = 4
    """… and to where it would stretch most."""
    tries: int = 3
    """Slits, those foretold to save most, that are made to see what they save."""
    near: float = 0.03
    """Distance from seams and border at which a slit's end lies at the least; they lie twice that from each other."""
    shortest: float = 0.05
    """Slits shorter than this are judged as if they had this length."""
    least: float = 1e-4
    """Energy foretold that a slit saves per length at the least."""
    hopeful: float = 1.4
    """Multiple of the stretch asked for above which a chart of seams grown is not gone on with."""
    most_ways: int = 4
    """Charts of seams grown that are gone on with at most, those of least stretch."""
    proxy: float = 1.15
    """Multiple of the stretch asked for that a proxy may have."""
    room: float = 1.3
    """How many times less than it may be stretch has to be for more closing: with scaffolds, or on the proxy anew …"""
    most_room: float = 2.0
    """… up to so many times its stretch."""
    tries_closing: int = 16
    """Runs flattened at each price as they are closed."""
    tips: int = 4
    """Times that the most pointed place is sought as seen from the last."""
    rounds: int = 40
    """Scaffolds in which charts are held apart."""


@dataclass(frozen=True)
class ClosingConfig:
    """How seams are closed."""

    growing: GrowingConfig = field(default_factory=GrowingConfig)
    """Seams grown where few and short ones are asked for."""
    charts: int = 8
    """Charts that the search aims at before seams are closed, whatever is asked for."""
    shares: tuple[float, ...] = (1.0, 0.5, 0.25, 0.05)
    """Lengths of the runs tried, as shares of the chain that they are part of."""
    shares_held: tuple[float, ...] = (1.0, 0.5, 0.25, 0.1, 0.05, 0.02)
    """The same where scaffolds hold charts apart."""
    least: int = 1
    """Edges of a run."""
    tries: int = 60
    """Runs flattened at the price of seams …"""
    tries_dearer: int = 24
    """… at each higher price, where stretch was asked for …"""
    tries_fine: int = 16
    """… and the same on the surface itself."""
    hopeless: float = 0.03
    """Share of a first layout that may lie over the rest; beyond it, it is not relaxed."""
    rounds: int = 2
    """Rounds in which a little overlap may be drawn apart."""
    patience: int = 12
    """Runs flattened in vain before the rest, foretold worse, are believed not to pay."""
    looks: int = 4
    """Runs flattened at a time."""
    hope: float = 0.5
    """Share of what is foretold that a run is trusted to cost at the least, where scaffolds hold charts apart."""
    doubt: float = 0.0005
    """How much better than foretold a run may turn out."""
    prices: tuple[float, ...] = (0.006, 0.015, 0.04, 0.2)
    """Prices of a seam at which more and more is closed, as long as stretch is within its bound."""
    cheaper: float = 0.5
    """Factor from one price of slits to the next, lower one, where the stretch is out of bounds."""
    cheapest: float = 0.05
    """The last such price, as a multiple of what a seam costs."""
