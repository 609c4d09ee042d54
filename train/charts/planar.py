"""Flat regions of a surface: faces joined across edges that do not bend.   f faces · r regions.

Two faces lie in one plane where the angle between their normals is below what rounding the vertices to float32 can do
to it.  A region is then checked as a whole: a finely divided curved surface bends little at each edge, and much in all.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.rows import first_of_each
from ...runtime.geometry.topology import face_components
from ...runtime.geometry.triangles import corner_angles

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.geometry.topology import EdgeTable
    from ...runtime.mesh import Surface
    from ..config import PlanarConfig

FLOAT32_STEP = 2.0**-24
"""Relative rounding of a coordinate that was stored as float32."""


def flat_regions(surface: Surface, table: EdgeTable, config: PlanarConfig) -> NDArray[np.int64]:
    """(f,) number of the flat region of each face, numbered by the lowest face; a region is connected.

    Faces of a region that turns out to be curved as a whole are regions of their own.
    """
    normals, extent = surface.face_normals(), float(np.ptp(surface.vertices, axis=0).max())
    pairs = table.edge_faces[table.manifold]
    sine = np.linalg.norm(np.cross(normals[pairs[:, 0]], normals[pairs[:, 1]]), axis=1)
    facing = np.einsum("ec,ec->e", normals[pairs[:, 0]], normals[pairs[:, 1]]) > 0.0
    height = heights(surface)
    noise = config.rounding * FLOAT32_STEP * extent / np.maximum(height[pairs].min(axis=1), 1e-300)
    allowed = np.clip(noise, config.angle, config.largest_angle)
    region = face_components(len(surface.faces), pairs[facing & (sine <= allowed)])
    curved = deviations(surface, region) > config.deviation * extent
    lonely = curved[region]
    count = int(region.max(initial=-1)) + 1
    region = np.where(lonely, count + np.arange(len(region)), region)
    first = np.unique(region, return_index=True, return_inverse=True)
    rank = np.argsort(np.argsort(first[1]))
    return rank[first[2]].astype(np.int64)


def heights(surface: Surface) -> NDArray[np.float64]:
    """(f,) least height of each triangle: twice its area over its longest side."""
    corner = surface.triangles
    longest = np.linalg.norm(corner - np.roll(corner, -1, axis=1), axis=2).max(axis=1)
    return 2.0 * surface.face_areas() / np.maximum(longest, 1e-300)


def deviations(surface: Surface, region: NDArray[np.int64]) -> NDArray[np.float64]:
    """(r,) greatest distance of a region's vertices from its plane: at its area centroid, across its mean normal."""
    count = int(region.max(initial=-1)) + 1
    cross, centroid = surface.face_cross(), surface.triangles.mean(axis=1)
    area = surface.face_areas()
    weight = np.maximum(np.bincount(region, area, minlength=count), 1e-300)
    origin = np.stack([np.bincount(region, area * c, minlength=count) for c in centroid.T], axis=1) / weight[:, None]
    normal = np.stack([np.bincount(region, c, minlength=count) for c in cross.T], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    offset = np.abs(np.einsum("fic,fc->fi", surface.triangles - origin[region][:, None], normal[region])).max(axis=1)
    greatest = np.zeros(count)
    np.maximum.at(greatest, region, offset)
    return greatest


def laid_flat(surface: Surface, region: NDArray[np.int64]) -> NDArray[np.float64]:
    """(f, 3, 2) uv of each region (f,) of numbers 0, 1, … in its own plane.

    The plane lies across the region's mean normal; its first axis runs along the region's longest edge, seen from
    outside.
    """
    corner, count = surface.triangles, int(region.max(initial=-1)) + 1
    normal = np.stack([np.bincount(region, across, minlength=count) for across in surface.face_cross().T], axis=1)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-300)
    edges = (np.roll(corner, -1, axis=1) - corner).reshape(-1, 3)
    length, owner = np.linalg.norm(edges, axis=1), np.repeat(region, 3)
    first = edges[np.lexsort((-length, owner))[np.searchsorted(np.sort(owner), np.arange(count))]]
    first = first - (first * normal).sum(axis=1, keepdims=True) * normal
    first /= np.maximum(np.linalg.norm(first, axis=1, keepdims=True), 1e-300)
    axes = np.stack([first, np.cross(normal, first)], axis=1)
    origin = corner[first_of_each(region), 0]
    return np.einsum("fcj,fij->fci", corner - origin[region][:, None], axes[region])


def least_seam(surface: Surface, table: EdgeTable, bent: float) -> float:
    """A lower bound on the seams of any charts without stretch, in √(area): each bent vertex lies on one.

    Bent is a vertex inside the surface whose corners add up to 2π by no better than ``bent`` radians.
    """
    count = len(surface.vertices)
    turn = np.bincount(surface.faces.reshape(-1), corner_angles(surface.triangles).reshape(-1), minlength=count)
    ends = surface.vertices[table.edges]
    shortest = np.full(count, np.inf)
    np.minimum.at(shortest, table.edges, np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[:, None])
    inside = np.isfinite(shortest)
    inside[table.edges[~table.manifold]] = False
    return float(
        shortest[inside & (np.abs(turn - 2.0 * np.pi) > bent)].sum() / 2.0 / np.sqrt(surface.face_areas().sum())
    )
