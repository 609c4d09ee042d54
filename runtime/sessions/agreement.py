"""How well an exported map agrees with the finished atlas it was fitted to.

n points, uniform on the surface, in source units.  uv in [0, 1]², v up; distances are in texels of a 1024² atlas
whatever its own size, so that figures compare.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Protocol

import numpy as np
from scipy.spatial import KDTree

from ..geometry.topology import edge_table
from ..geometry.triangles import signed_areas, triangle_areas
from .sheets import uv_on_sheet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Atlas
    from .session import Unwrapped

TEXELS = 1024.0
SEAM_REACH = 12.0
"""A point this close to a seam (texels at 1024²) may be taken for one on its other side."""
SEAM_POINTS = 128
"""Points of seams, a texel apart, that are looked at for it: a wire thinner than a texel has thousands that near."""


class PointMap(Protocol):
    """What is judged: an UnwrapSession, or anything that answers like one."""

    def unwrap(self, points: NDArray[np.float64]) -> Unwrapped:
        """Atlas uv, chart and score of points (n, 3) float64."""
        ...


@dataclass(frozen=True)
class Agreement:
    """What `agreement` found.

    chart_agreement: share of points that got the right chart, in [0, 1]; of sheets that coincide either is right.
    seam_agreement: share that also got the right side of the cuts inside that chart: slits are seams too.
    rms_texels, p99_texels: distance between answer and atlas over the points of seam_agreement, texels at 1024²;
    None when there is none.  points: how many were tried.
    """

    rms_texels: float | None
    p99_texels: float | None
    chart_agreement: float
    seam_agreement: float
    points: int

    def to_dict(self) -> dict[str, float | int | None]:
        """Field name → number, ready for JSON."""
        return asdict(self)


def agreement(point_map: PointMap, atlas: Atlas, *, count: int = 50_000, seed: int = 0) -> Agreement:
    """Compare a map with an atlas at random surface points.

    A point given to the wrong side of a seam is counted by the two shares alone: its distance says where the other
    side was packed, or how far a slit gapes.
    """
    points, uv, chart = surface_points(atlas, count, np.random.default_rng(seed))
    answer = point_map.unwrap(points)
    uv, chart = on_the_same_sheet(atlas, points, uv, chart, answer.chart)
    right = answer.chart == chart
    distance = np.linalg.norm(answer.uv - uv, axis=1) * TEXELS
    far = np.flatnonzero(right & (distance > 2.0 * SEAM_REACH))
    same_side = right.copy()
    same_side[far] = ~across_a_seam(atlas, points[far], answer.uv[far].astype(np.float64), distance[far])
    kept = distance[same_side]
    return Agreement(
        rms_texels=float(np.sqrt(np.mean(kept**2))) if len(kept) else None,
        p99_texels=float(np.percentile(kept, 99.0)) if len(kept) else None,
        chart_agreement=float(np.mean(right)),
        seam_agreement=float(np.mean(same_side)),
        points=count,
    )


def on_the_same_sheet(
    atlas: Atlas,
    points: NDArray[np.float64],
    uv: NDArray[np.float64],
    chart: NDArray[np.int64],
    answered: NDArray[np.int64],
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Uv and chart of the points on the chart answered (n,), where that has a face at the very same place."""
    other = np.flatnonzero(answered != chart)
    sheet = uv_on_sheet(atlas, points[other], answered[other])
    lies = np.isfinite(sheet).all(axis=1)
    uv, chart = uv.copy(), chart.copy()
    uv[other[lies]], chart[other[lies]] = sheet[lies], answered[other[lies]]
    return uv, chart


def across_a_seam(
    atlas: Atlas, points: NDArray[np.float64], answer: NDArray[np.float64], error: NDArray[np.float64]
) -> NDArray[np.bool_]:
    """(n,) bool: the answer uv (n, 2) fits a seam point near the point (n, 3) twice as well as that point.

    Near: of the nearest SEAM_POINTS those within SEAM_REACH texels in space.  error (n,): distance of the answer from
    the point's own uv, texels.
    """
    if len(points) == 0:
        return np.zeros(0, dtype=bool)
    corner, flat = atlas.positions[atlas.faces], atlas.corner_uv
    area = triangle_areas(corner).sum()
    texel = float(np.sqrt(area / np.abs(signed_areas(flat)).sum())) / TEXELS
    table = edge_table(atlas.faces)
    rim = table.edges[table.boundary]
    ends, ends_uv = atlas.positions[rim], atlas.uv[rim].astype(np.float64)
    steps = np.ceil(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / texel).astype(np.int64) + 1
    edge = np.repeat(np.arange(len(rim)), steps)
    t = ((np.arange(len(edge)) - np.repeat(np.cumsum(steps) - steps, steps)) / np.repeat(steps, steps))[:, None]
    seam = ends[edge, 0] * (1.0 - t) + ends[edge, 1] * t
    seam_uv = ends_uv[edge, 0] * (1.0 - t) + ends_uv[edge, 1] * t
    if len(seam) == 0:
        return np.zeros(len(points), dtype=bool)
    reach = SEAM_REACH * texel
    _, near = KDTree(seam).query(points, k=min(SEAM_POINTS, len(seam)), distance_upper_bound=reach)
    nowhere = np.full((1, 2), np.inf)  # what the tree answers where fewer are near
    beside = np.concatenate([seam_uv, nowhere])[near.reshape(len(points), -1)]
    gap = np.linalg.norm(beside - answer[:, None], axis=2).min(axis=1)
    return gap * TEXELS < 0.5 * error


def surface_points(
    atlas: Atlas, count: int, rng: np.random.Generator
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Points uniform by area: xyz (n, 3) source units, their atlas uv (n, 2), their chart (n,)."""
    corner = atlas.positions[atlas.faces]
    area = triangle_areas(corner)
    face = rng.choice(len(area), size=count, p=area / area.sum())
    weight = rng.dirichlet(np.ones(3), size=count)
    xyz = np.einsum("nc,ncx->nx", weight, corner[face])
    uv = np.einsum("nc,ncx->nx", weight, atlas.corner_uv[face])
    return xyz, uv, atlas.face_chart[face]
