"""The numbers of charts that are found without a search, in a frozen dataclass saved with each result."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class SwiftConfig:
    """Charts by the thousands, laid flat together, where there is no time for a search."""

    net: int = 60
    """Faces of a closed part up to which it is cut open as a net."""
    reach: float = 0.05
    """Rings of faces that a face takes its direction from, as a share of √(faces) …"""
    rings: tuple[int, int] = (8, 48)
    """… the fewest and the most."""
    votes: int = 4
    """Times that faces take the direction that most of those …"""
    vote_rings: int = 4
    """… so many rings around them have."""
    crumb: int = 200
    """Mean faces below which a cluster of faces that face one way joins one beside it."""
    follow: int = 8
    """Rounds in which faces follow two of their neighbours, before …"""
    follow_cut: int = 4
    """… and after a cut in two."""
    steps: int = 3
    """Rigid steps."""
    unfolding: int = 12
    """Times that the vertices of what is still flipped go to the mean of their neighbours."""
    mended: int = 12
    """Sweeps over the vertices of faces that are turned over or have …"""
    above: float = 2.0
    """… more excess energy than this …"""
    sweeps: int = 4
    """… and then over all."""
    shrunk: float = 4.0
    """Factor that the area of a chart may have lost by that, to be made up for."""
    worst: float = 100.0
    """Symmetric Dirichlet energy of a face that is cut off like one that is turned over."""
    batch: int = 8000
    """Faces that are laid flat at once, but for larger charts."""
    around: int = 1
    """Rings of faces around one that is flipped that are cut off with it …"""
    most_off: float = 0.1
    """… as long as this is no larger share of the chart: else it is cut in two."""
    rounds: int = 24
    """Times that what was cut is laid flat again, before what is left is projected."""
    shared: float = 0.1
    """Share of its border that a chart must have in common with one that it is to join."""
    joins: int = 12
    """Rounds of joining charts to those beside them, at most …"""
    leaves: int = 12
    """… with so many charts that join the same one in one round …"""
    worth: float = 5e-3
    """… as long as one lowers the objective by such a share …"""
    pace: float = 5e-6
    """… and seconds are left for it: for each face, before the first."""
    hope: float = 0.8
    """Share of the objective that joining may leave of it: what a search made lower still is not tried to be beaten."""
    noisy: float = 0.02
    """Mean excess energy of these charts from which a search is not begun: what stretches them is noise."""
