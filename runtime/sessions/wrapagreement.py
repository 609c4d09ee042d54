"""How well an exported inverse (uv → point) agrees with the surface it was fitted to; and the normals it answers with.

n points · f faces.  Positions in source units; errors relative to the surface's bounding-sphere radius; angles in
radians.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..geometry.triangles import corner_angles
from ..mesh import Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Atlas, Surface
    from .wrapsession import Wrapped

CREASE = np.deg2rad(40.0)
"""Faces at a vertex whose normals differ by more don't share a vertex normal there."""


class InverseMap(Protocol):
    """What is judged: a WrapSession, or anything that answers like one."""

    def wrap(self, uv: NDArray[np.float64], chart: NDArray[np.int64]) -> Wrapped:
        """Points and normals at atlas uv (n, 2) of charts (n,)."""
        ...


@dataclass(frozen=True)
class InverseAgreement:
    """What `inverse_agreement` found at random surface points.

    rms, p99: distance between answer and surface point, as a share of the bounding-sphere radius.
    normal_mean: mean angle to the surface normal, radians.  points: how many were tried.
    """

    rms: float
    p99: float
    normal_mean: float
    points: int

    def to_dict(self) -> dict[str, float | int]:
        """Field name → number, ready for JSON."""
        return asdict(self)


def inverse_agreement(
    inverse: InverseMap, surface: Surface, atlas: Atlas, *, count: int = 50_000, seed: int = 0
) -> InverseAgreement:
    """Compare an inverse with a surface: random surface points, their atlas uv, and back.

    ``surface`` and ``atlas`` have the same faces in the same order; positions in source units.
    """
    rng = np.random.default_rng(seed)
    area = surface.face_areas()
    face = rng.choice(len(area), size=count, p=area / area.sum())
    weight = rng.dirichlet(np.ones(3), size=count)
    points = np.einsum("nc,ncx->nx", weight, surface.triangles[face])
    uv = np.einsum("nc,ncx->nx", weight, atlas.corner_uv[face])
    normals = interpolated_normals(corner_normals(surface), face, weight)
    answer = inverse.wrap(uv, atlas.face_chart[face])
    distance = np.linalg.norm(answer.points - points, axis=1) / Frame.of(surface.vertices).scale
    cosine = np.einsum("nx,nx->n", answer.normals, normals).clip(-1.0, 1.0)
    return InverseAgreement(
        rms=float(np.sqrt(np.mean(distance**2))),
        p99=float(np.percentile(distance, 99.0)),
        normal_mean=float(np.arccos(cosine).mean()),
        points=count,
    )


def corner_normals(surface: Surface, *, crease: float = CREASE) -> NDArray[np.float64]:
    """(f, 3, 3) float64 unit normals of the corners of faces: smooth across edges, sharp along creases.

    A corner averages the faces around its vertex whose normals lie within ``crease`` (radians) of its own face's,
    weighted by their angle there.
    """
    normal = surface.face_normals()
    weighted = (normal[:, None, :] * corner_angles(surface.triangles)[:, :, None]).reshape(-1, 3)
    vertex = surface.faces.reshape(-1)
    order = np.argsort(vertex, kind="stable")
    valence = np.bincount(vertex, minlength=len(surface.vertices))
    first = np.cumsum(valence) - valence
    count = valence[vertex]
    corner = np.repeat(np.arange(len(vertex)), count)
    step = np.arange(len(corner)) - np.repeat(np.cumsum(count) - count, count)
    other = order[first[vertex[corner]] + step]
    alike = np.einsum("nx,nx->n", normal[corner // 3], normal[other // 3]) > np.cos(crease)
    corner, other = corner[alike], other[alike]
    total = np.zeros((len(vertex), 3))
    for axis in range(3):
        total[:, axis] = np.bincount(corner, weighted[other, axis], len(vertex))
    return unit(total, normal[np.arange(len(vertex)) // 3]).reshape(-1, 3, 3)


def interpolated_normals(
    corners: NDArray[np.float64], face: NDArray[np.int64], barycentric: NDArray[np.float64]
) -> NDArray[np.float64]:
    """(n, 3) float64 unit normals inside faces (n,), from those of their corners (f, 3, 3)."""
    return unit(np.einsum("nc,ncx->nx", barycentric, corners[face]), corners[face, 0])


def unit(vectors: NDArray[np.float64], otherwise: NDArray[np.float64]) -> NDArray[np.float64]:
    """Vectors (n, 3) at unit length; ``otherwise`` (n, 3) where they vanish."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    return np.where(length > 1e-12, vectors / np.maximum(length, 1e-12), otherwise)
