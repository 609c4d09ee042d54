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
    doubtful: float = 0.5
    """A fitted plane whose cosine with the file's normal is smaller gives way to that normal."""
    decisive: float = 0.5
    """Two linked normals whose cosine is smaller in size say nothing about orientation."""
    reorient: float = 0.2
    """`normals.disagreement` from which on the normals of a file are oriented anew (random signs have 0.5)."""
    star_points: int = 20
    """The most neighbours on the hull of a Delaunay star; stars with more are left open there."""
    opposite: float = -0.3
    """Points whose normals have a smaller cosine are no neighbours: they lie on the other side of a thin sheet."""
    steep: float = 0.2
    """Points whose direction has a smaller cosine with the tangent plane have no place in it."""
    facing: float = -0.1
    """Least cosine between a triangle's normal and those of its corners."""
    circumradius: float = 2.0
    """Largest circumradius of a triangle."""
    hole_facing: float = -0.5
    """Least mean cosine between a triangle that closes a hole and the normals of its corners."""
    hole_turn: float = 2.0
    """What a triangle that closes a hole costs is its circumradius times this less that cosine."""
    hole_edges: int = 12
    """Longest boundary loop that is closed."""
    touching_holes: int = 4
    """Loops longer than so many times hole_edges are no chains of small holes that touch at vertices."""
    hole_width: float = 5.0
    """Widest extent of a loop that is closed."""
    folded: float = 0.2
    """Cosine between a triangle's normal and its corners' below which it is folded, on the calm shape, and of one that
    closes over what was cut out."""
    noise_rings: int = 4
    """Rings around a fold or a small handle that are cut out at most, until what is left can be closed."""
    noise_reach: int = 10
    """Rings around all such places that are looked at after the first time."""
    handle_edges: int = 16
    """Longest way around and through a handle that is cut out."""
    noise_edges: int = 48
    """Longest boundary loop that is closed where something was cut out …"""
    noise_width: float = 12.0
    """… and its widest extent."""
    noise: float = 0.1
    """Typical distance of a point from the mean of its neighbours, beyond theirs, from which charts are found on a
    calmer shape …"""
    calming: int = 5
    """… that so many rounds of moving points there lead to …"""
    farthest: float = 2.0
    """… by so many times that distance at most: at creases the mean lies far off."""
    rounds: int = 4
    """Times pinches are removed and holes closed."""
    extrapolation: float = 0.5
    """How far, in barycentric weights, a point without a triangle may lie outside the nearest one."""
    least_faces: int = 12
    """Pieces of fewer triangles are taken for outliers."""
