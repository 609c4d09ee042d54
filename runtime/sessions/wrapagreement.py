"""How well an exported inverse (uv → point) agrees with the surface it was fitted to.

n points · f faces.  Positions in source units; errors relative to the surface's bounding-sphere radius; angles in
radians.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

from ..geometry.normals import corner_normals, interpolated_normals
from ..mesh import Frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Atlas, Surface
    from .wrapsession import Wrapped


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
