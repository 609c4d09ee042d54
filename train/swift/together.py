"""Many charts laid flat at once: one solve for a batch of them, one exact test.

Each face is turned the least that brings it into the plane of its chart, which unrolls what is bent; rigid steps do the
rest.  None of it is done chart by chart: thousands of charts take as long as their faces do.   f faces · k charts.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.distortion import excess, oriented_energy
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.rows import compacted
from ...runtime.geometry.triangles import jacobians, signed_areas
from ...runtime.kernel.choice import kernel
from ...runtime.mesh import Surface
from ..carry.layout import face_frames, turned_into
from ..finish.arap import PIN, RigidSteps, nearest_rotations
from ..finish.flatten import Pins
from .nets import unrolled
from .polish import polished

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .config import SwiftConfig


class Laid(NamedTuple):
    """Charts laid out, each at a place of its own.

    corner_uv: (f, 3, 2), each chart at its size in space.  flipped: (f,) bool, those too that are
    stretched out of bounds.  pairs: (p, 2) faces that overlap.
    energy: (f,) area · (symmetric Dirichlet − 1), in the surface's units.
    """

    corner_uv: NDArray[np.float64]
    flipped: NDArray[np.bool_]
    pairs: NDArray[np.int64]
    energy: NDArray[np.float64]


def laid_together(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], chart: NDArray[np.int64], config: SwiftConfig
) -> Laid:
    """Charts (f,), numbered 0…, of faces (f, 3) that share no vertex with faces of another chart."""
    used, own = compacted(faces)
    surface = Surface(np.take(vertices, used, axis=0), own)
    first = np.zeros(int(chart.max()) + 1, dtype=np.int64)
    first[chart] = surface.faces[:, 0]
    rigid = RigidSteps(surface, pins=Pins(first, np.zeros((len(first), 2)), PIN))
    uv, area = rigid.run(unrolled(surface, chart, turned_flat(surface, chart)), config.steps), surface.face_areas()
    real, flat = np.bincount(chart, area), np.bincount(chart, signed_areas(uv[surface.faces]))
    factor = np.sqrt(real / np.maximum(flat, real / config.shrunk))  # what is mostly flipped is not valid anyway
    scale = np.ones(len(uv))
    scale[surface.faces] = factor[chart, None]
    uv *= scale[:, None]
    uv = polished(surface, uv, config.mended, config.above)
    if kernel():  # its twin would take minutes for all of them
        uv = polished(surface, uv, config.sweeps)
    corner_uv = uv[surface.faces]
    corner_uv = in_a_row(corner_uv, chart)
    stretch = oriented_energy(jacobians(surface.triangles, corner_uv))
    energy = area * excess(stretch)
    flipped = flipped_triangles(corner_uv) | (stretch > config.worst)
    upright = np.flatnonzero(~flipped)
    pairs = upright[overlapping_pairs(corner_uv[upright])]
    return Laid(corner_uv, flipped, pairs, energy)


def turned_flat(surface: Surface, chart: NDArray[np.int64]) -> NDArray[np.float64]:
    """(f, 2, 2) the turn of each face, as Jacobians are written, by which it comes into the plane of its chart."""
    cross = surface.face_cross()
    way = np.stack([np.bincount(chart, axis) for axis in cross.T], axis=1)
    way[(way == 0.0).all(axis=1), 2] = 1.0
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    first = np.cross(way, np.eye(3)[np.abs(way).argmin(axis=1)])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    plane = np.stack([first, np.cross(way, first)], axis=1)
    frame = face_frames(surface)
    turned = turned_into(frame[:, :2], frame[:, 2], way[chart])
    return nearest_rotations(np.einsum("fic,fjc->fji", turned, plane[chart]))


def in_a_row(corner_uv: NDArray[np.float64], chart: NDArray[np.int64]) -> NDArray[np.float64]:
    """Corners (f, 3, 2) of charts (f,) moved until each lies beside the one before it, with room between them."""
    count = int(chart.max()) + 1
    low, high = np.full((count, 2), np.inf), np.full((count, 2), -np.inf)
    for corner in range(3):
        np.minimum.at(low, chart, corner_uv[:, corner])
        np.maximum.at(high, chart, corner_uv[:, corner])
    width = 1.01 * (high - low)[:, 0] + 1e-9
    begin = np.stack([np.cumsum(width) - width, np.zeros(count)], axis=1)
    return corner_uv + (begin - low)[chart][:, None]
