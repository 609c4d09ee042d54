"""Prices of seams by place: where the surface is hidden a seam is cheap, what is protected is dear.

p places · xyz in the frame that the places are in.  A price is a factor on what a seam costs per length.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import KDTree

from .openness import open_sky

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Surface


@dataclass(frozen=True)
class PlaceConfig:
    """How a place comes by its price."""

    hidden: bool = False
    """Whether places that see less of the sky are cheaper."""
    most: int = 20000
    """Faces looked at; of more, evenly many."""
    rays: int = 32
    """From each."""
    power: float = 2.0
    """Of open sky over its mean, which is the price."""
    range: tuple[float, float] = (0.1, 3.0)
    """Least and greatest price of hidden and of open places."""
    protected: float = 10.0
    """Price where no seam is wanted, as a multiple of what it would be."""


@dataclass(frozen=True, eq=False)
class Places:
    """Points (p, 3) and the price (p,) of a seam there; elsewhere it is that of the nearest."""

    points: NDArray[np.float64]
    price: NDArray[np.float64]

    @cached_property
    def tree(self) -> KDTree:
        """Of the points."""
        return KDTree(self.points)

    def at(self, xyz: NDArray[np.float64]) -> NDArray[np.float64]:
        """(n,) prices at xyz (n, 3)."""
        return self.price[self.tree.query(xyz)[1]]

    def moved(self, origin: NDArray[np.float64], scale: float) -> Places:
        """The same where xyz are (xyz − origin) / scale."""
        return Places((self.points - origin) / scale, self.price)


def priced_places(surface: Surface, config: PlaceConfig, protected: NDArray[np.float64] | None = None) -> Places:
    """Prices at the faces of a surface.

    Args:
        surface: any units.
        config: numbers.
        protected: (f,) how dear a seam is on a face: 0 as elsewhere, 1 for the price of what is protected.

    Raises: MissingDependencyError: hidden ones without flexpara[bake], which has Embree.
    """
    count = min(len(surface.faces), config.most)
    faces = np.linspace(0, len(surface.faces) - 1, count).astype(np.int64)
    points, price = surface.triangles[faces].mean(axis=1), np.ones(count)
    if config.hidden:
        sky = open_sky(surface, faces, config.rays)
        price = np.clip((sky / max(float(sky.mean()), 1e-9)) ** config.power, *config.range)
    if protected is not None:
        price = price * (1.0 + (config.protected - 1.0) * protected[faces])
    return Places(points, price)
