"""Points on a surface: area-weighted samples, normals, tangents.   n samples · xyz in the surface's own frame."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..runtime.mesh import Surface


@dataclass(frozen=True, eq=False)
class Samples:
    """n points of a surface.

    xyz (n, 3) float64.  face (n,) int64.  barycentric (n, 3) float64, ≥ 0, rows sum to 1.  normal (n, 3) float64 unit.
    """

    xyz: NDArray[np.float64]
    face: NDArray[np.int64]
    barycentric: NDArray[np.float64]
    normal: NDArray[np.float64]


def sample_surface(surface: Surface, count: int, rng: np.random.Generator) -> Samples:
    """``count`` points, stratified by area: the same density everywhere.

    One uniform offset per stratum of equal area along the list of faces (systematic sampling), uniform inside a face.
    """
    cumulative = np.cumsum(surface.face_areas())
    picks = (np.arange(count) + rng.random(count)) / count * cumulative[-1]
    face = np.minimum(np.searchsorted(cumulative, picks, side="right"), len(cumulative) - 1)
    return samples_in_faces(surface, face, rng)


def samples_in_faces(surface: Surface, face: NDArray[np.int64], rng: np.random.Generator) -> Samples:
    """One uniform point in each of the faces named, (n,) int64."""
    root, v = np.sqrt(rng.random(len(face))), rng.random(len(face))
    barycentric = np.stack([1.0 - root, root * (1.0 - v), root * v], axis=1)
    xyz = np.einsum("nc,ncd->nd", barycentric, np.take(surface.triangles, face, axis=0))
    normal = np.take(surface.face_normals(), face, axis=0)
    return Samples(xyz=xyz, face=face, barycentric=barycentric, normal=normal)
