"""Every number of building triangles over a point cloud, in one frozen dataclass that is saved with each result.

The spacing of a point is the distance to its sixth neighbour over 1.4: about 1/√(points per area).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class CloudConfig:
    """From points to a surface.  Lengths are multiples of the local spacing; all numbers were chosen by measurement."""

    neighbours: int = 24
    """Nearest points that the Delaunay star of a point is made from."""
    closest: float = 0.01
    """A point closer than this to an earlier one makes no triangles: they would be slivers."""
    plane_neighbours: int = 16
    """Nearest points that a tangent plane is fitted to."""
    plane_rounds: int = 2
    """Reweighted fits after the first: points off the plane count less (Tukey's idea, Cauchy weights)."""
    plane_scale: float = 0.3
    """Distance from the plane at which a point counts half, in spacings."""
    tree_neighbours: int = 10
    """Nearest points along whose links orientation spreads."""
    unruly: float = 0.2
    """`normals.disagreement` from which on the normals of a file are oriented anew (random signs have 0.5)."""
    opposite: float = -0.3
    """Points whose normals have a smaller cosine are no neighbours: they lie on the other side of a thin sheet."""
    steep: float = 0.2
    """Points whose direction has a smaller cosine with the tangent plane have no place in it."""
    facing: float = -0.1
    """Least cosine between a triangle's normal and those of its corners."""
    circumradius: float = 2.0
    """Largest circumradius of a triangle."""
    hole_edges: int = 12
    """Longest boundary loop that is closed."""
    hole_width: float = 5.0
    """Widest extent of a loop that is closed."""
    rounds: int = 4
    """Times pinches are removed and holes closed."""
    extrapolation: float = 0.5
    """How far, in barycentric weights, a point without a triangle may lie outside the nearest one."""
    least_faces: int = 12
    """Pieces of fewer triangles are taken for outliers."""
