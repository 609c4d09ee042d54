"""How well an exported map agrees with the finished atlas it was fitted to.

n points, uniform on the surface, in source units.  uv in [0, 1]², v up; distances are in texels of a 1024² atlas
whatever its own size, so that figures compare.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from .mesh import Atlas
    from .session import Unwrapped

TEXELS = 1024.0


class PointMap(Protocol):
    """What is judged: an UnwrapSession, or anything that answers like one."""

    def unwrap(self, points: NDArray[np.float64]) -> Unwrapped:
        """Atlas uv, chart and score of points (n, 3) float64."""
        ...


@dataclass(frozen=True)
class Agreement:
    """What `agreement` found.

    rms_texels, p99_texels: distance between answer and atlas over the points that got the right chart, texels at 1024²;
    None when no point got it.
    chart_agreement: share of points that got the right chart, in [0, 1].  points: how many were tried.
    """

    rms_texels: float | None
    p99_texels: float | None
    chart_agreement: float
    points: int

    def to_dict(self) -> dict[str, float | int | None]:
        """Field name → number, ready for JSON."""
        return asdict(self)


def agreement(point_map: PointMap, atlas: Atlas, *, count: int = 50_000, seed: int = 0) -> Agreement:
    """Compare a map with an atlas at random surface points.

    A point of the wrong chart is counted by chart_agreement alone: its distance says where the other chart was packed.
    """
    points, uv, chart = surface_points(atlas, count, np.random.default_rng(seed))
    answer = point_map.unwrap(points)
    right = answer.chart == chart
    distance = np.linalg.norm(answer.uv[right] - uv[right], axis=1) * TEXELS
    return Agreement(
        rms_texels=float(np.sqrt(np.mean(distance**2))) if right.any() else None,
        p99_texels=float(np.percentile(distance, 99.0)) if right.any() else None,
        chart_agreement=float(np.mean(right)),
        points=count,
    )


def surface_points(
    atlas: Atlas, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Points uniform by area: xyz (n, 3) source units, their atlas uv (n, 2), their chart (n,)."""
    corner = atlas.positions[atlas.faces]
    area = np.linalg.norm(np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), axis=1)
    face = rng.choice(len(area), size=count, p=area / area.sum())
    weight = rng.dirichlet(np.ones(3), size=count)
    xyz = np.einsum("nc,ncx->nx", weight, corner[face])
    uv = np.einsum("nc,ncx->nx", weight, atlas.corner_uv[face])
    return xyz, uv, atlas.face_chart[face]
