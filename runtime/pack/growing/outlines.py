"""Outlines of charts, and the angle at which each stands upright.   k charts · s outline segments."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ...errors import FinishError
from ...geometry.metrics import uv_charts
from ...geometry.topology import edge_table
from ...geometry.triangles import signed_areas

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...mesh import Charts
    from ..config import GrowthConfig


def outline_edges(faces: NDArray[np.int64], charts: Charts) -> NDArray[np.bool_]:
    """(f, 3) bool: edge i of the face lies on the outline of its chart; faces (f, 3) over welded vertices.

    Where a chart is folded over, as other tools' may be, the fold is a part of its outline.
    """
    table = edge_table(faces)
    _, seam = uv_charts(faces, charts.corner_uv, table)
    side, turn = charts.face_chart[table.edge_faces], np.sign(signed_areas(charts.corner_uv))[table.edge_faces]
    apart = (side[:, 0] != side[:, 1]) | (turn[:, 0] != turn[:, 1])
    return (seam | ~table.manifold | apart)[table.face_edges]


def chart_outlines(charts: Charts, outline: NDArray[np.bool_]) -> list[NDArray[np.float64]]:
    """Per chart its directed outline segments (s, 2, 2) in chart coordinates, from `outline_edges`.

    Raises:
        FinishError: a chart is closed.
    """
    segments = np.stack([charts.corner_uv, np.roll(charts.corner_uv, -1, axis=1)], axis=2)[outline]
    chart = np.repeat(charts.face_chart, outline.sum(axis=1))
    order = np.argsort(chart, kind="stable")
    counts = np.bincount(chart, minlength=int(charts.face_chart.max()) + 1)
    if not counts.all():
        raise FinishError(f"chart {int(counts.argmin())} is closed and has no outline; cut it open first")
    return np.split(segments[order], np.cumsum(counts)[:-1])


def rotation(angle: float) -> NDArray[np.float64]:
    """(2, 2) matrix that turns columns by an angle (radians), counter-clockwise."""
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def upright_angle(outline: NDArray[np.float64], extent: NDArray[np.float64] | None = None) -> float:
    """Angle (radians) that turns an outline (s, 2, 2) into its smallest bounding rectangle.

    extent: (2,) of a page that it shall fill alone, upright or lying: the angle, to a degree, at which it needs least.
    One side of that rectangle lies along an edge of the convex hull (Freeman and Shapira 1975).
    """
    points = outline.reshape(-1, 2)
    points = points[hull_corners(points)]
    edge = np.roll(points, -1, axis=0) - points
    angles = -np.arctan2(edge[:, 1], edge[:, 0])
    if extent is not None:
        angles = np.concatenate([angles, np.deg2rad(np.arange(90.0))])
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    width = np.ptp(points[:, 0] * cosine - points[:, 1] * sine, axis=1)
    height = np.ptp(points[:, 0] * sine + points[:, 1] * cosine, axis=1)
    if extent is None:
        return float(angles[np.argmin(width * height)])
    wide, high = extent.tolist()
    needed = np.minimum(np.maximum(width / wide, height / high), np.maximum(width / high, height / wide))
    return float(angles[np.argmin(needed)])


def hull_corners(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """(c,) which of the points (n, 2) are corners of their convex hull, counter-clockwise."""
    try:
        return ConvexHull(points).vertices.astype(np.int64)
    except QhullError:  # all points on a line: the hull has no edges, the points do
        return np.lexsort((points[:, 1], points[:, 0]))[[0, -1]]


def is_rectangle(outline: NDArray[np.float64], accuracy: float = 1e-6) -> bool:
    """Whether an upright outline (s, 2, 2) fills its bounding box, to a part of its area."""
    start, end = outline[:, 0], outline[:, 1]
    area = 0.5 * float((start[:, 0] * end[:, 1] - start[:, 1] * end[:, 0]).sum())
    return abs(area) >= (1.0 - accuracy) * float(np.prod(np.ptp(outline, axis=(0, 1))))


def is_straight(outline: NDArray[np.float64], config: GrowthConfig) -> bool:
    """Whether most of an outline (s, 2, 2) runs along the axes, so that its borders lie along texels as it stands."""
    step = outline[:, 1] - outline[:, 0]
    length = np.linalg.norm(step, axis=1)
    along = np.abs(step).min(axis=1) <= math.sin(math.radians(config.askew)) * length
    return float(length[along].sum()) >= config.straight * float(length.sum())
