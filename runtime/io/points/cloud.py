"""Point clouds in memory: checked, and the distinct points beneath.

n points of the user · d distinct points.  Positions are float64 in source units, normals unit, colours uint8 sRGB.
The user's points stay as they are, in their order; work is done on the distinct ones.  Arrays are read-only by
convention, as in mesh.py.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...brief import Brief
from ...errors import InputError, ShapeError
from ...geometry.rows import first_of_each
from ..clean.weld import SMALLEST_DIAGONAL, weld_vertices
from ..pictures.colors import as_rgba
from ..rawmesh import LARGEST_DIAGONAL, to_float64, unit_vectors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from ...mesh import Asset, Atlas

FEWEST_POINTS = 4


@dataclass(frozen=True, eq=False, repr=False)
class PointCloud(Brief):
    """Points of a surface, as the user gave them.

    points: (n, 3) float64, finite.  normals: (n, 3) float64 unit (zero where the file has none), or None.
    colors: (n, 4) uint8 sRGB or None.  stem: base name for outputs.  sha256: hex digest of the source file's bytes
    ("" when made in memory).  changes: what reading and work on it could not take as it was, name → count.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64] | None = None
    colors: NDArray[np.uint8] | None = None
    stem: str = "points"
    sha256: str = ""
    changes: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class DistinctPoints:
    """A cloud without its repeated points.

    points: (d, 3) float64.  normals: (d, 3) float64, zero where unknown, or None.
    first: (d,) int64, the user's point of each (ascending).  weld: (n,) int64 in [0, d): points[weld] are the user's.
    """

    points: NDArray[np.float64]
    normals: NDArray[np.float64] | None
    first: NDArray[np.int64]
    weld: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class CloudMesh:
    """Triangles over a cloud, and where each of the user's points lies on them.

    asset: the triangles; its vertices are points of the cloud, in their order, its surface is what is trained.
    point_face: (n,) int64, the face that answers for each point of the user: the largest one it is a corner of, else
    the nearest.  point_weight: (n, 3) float64 weights of that face's corners, sum 1; negative ones extrapolate.
    """

    asset: Asset
    point_face: NDArray[np.int64]
    point_weight: NDArray[np.float64]


def cloud_from_arrays(
    points: ArrayLike,
    *,
    normals: ArrayLike | None = None,
    colors: ArrayLike | None = None,
    stem: str = "points",
    sha256: str = "",
) -> PointCloud:
    """A checked cloud.

    Args:
        points: (n, 3) finite numbers, source units, n ≥ 4.
        normals: (n, 3), made unit; zero or not-finite rows count as unknown; None where there are none.
        colors: (n, 3 or 4), uint8 sRGB, or float sRGB in [0, 1], or None.
        stem: base name for outputs.
        sha256: of the source file.

    Raises:
        ShapeError: an array of another shape or kind.
        InputError: too few points, NaN or infinite coordinates, or a size that float64 areas can't hold.
    """
    position = to_float64(_columns("points", points, (3,), None))
    _check_positions(position)
    count = len(position)
    normal = None if normals is None else unit_vectors(to_float64(_columns("normals", normals, (3,), count)))
    normal = normal if normal is not None and normal.any() else None  # splats write zeros
    color = None if colors is None else as_rgba(_columns("colors", colors, (3, 4), count))
    changes: dict[str, int] = {}
    if normal is not None:
        unknown = int(np.count_nonzero(~normal.any(axis=1)))
        changes = {"points_without_normal": unknown} if unknown else {}
    return PointCloud(position, normal, color, stem, sha256, changes)


def distinct_points(cloud: PointCloud) -> DistinctPoints:
    """The cloud without points that repeat an earlier one (equal, or closer than `weld.WELD_TOLERANCE`).

    Of repeated points the first known normal in their order stays.
    """
    weld = weld_vertices(cloud.points)
    first = first_of_each(weld)
    normals = cloud.normals
    if normals is not None:
        known = np.flatnonzero(normals.any(axis=1))
        chosen = np.zeros((len(first), 3))
        label, place = np.unique(weld[known], return_index=True)
        chosen[label] = normals[known[place]]
        normals = chosen
    return DistinctPoints(cloud.points[first], normals, first, weld)


def point_uv(mesh: CloudMesh | None, atlas: Atlas) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Where the user's points lie in an atlas: uv (n, 2) float32 in [0, 1], v up, and chart (n,) int64.

    A point on a seam has several; it gets those of the largest face around it.

    Raises: InputError where there are no points.
    """
    if mesh is None:
        raise InputError("point_uv of a mesh, expected a point cloud; use result.atlas")
    corner = atlas.corner_uv[mesh.point_face]
    uv = np.einsum("ni,nic->nc", mesh.point_weight, corner)
    return np.clip(uv, 0.0, 1.0).astype(np.float32), atlas.face_chart[mesh.point_face]


def with_changes(cloud: PointCloud, **counts: int) -> PointCloud:
    """The cloud with counts added to its changes, zero ones left out."""
    return replace(cloud, changes={**cloud.changes, **{name: count for name, count in counts.items() if count}})


def check_uv(cloud: PointCloud, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> None:
    """Raises ShapeError where uv or chart don't fit the cloud."""
    n = len(cloud.points)
    if uv.shape != (n, 2) or chart.shape != (n,):
        raise ShapeError(f"uv and chart have shapes {uv.shape} and {chart.shape}, expected {(n, 2)} and {(n,)}")


def _columns(name: str, values: ArrayLike, columns: tuple[int, ...], rows: int | None) -> NDArray[Any]:
    array = np.asarray(values)
    if (
        array.ndim != 2
        or array.shape[1] not in columns
        or array.dtype.kind not in "iuf"
        or rows not in (None, len(array))
    ):
        expected = f"({'n' if rows is None else rows}, {' or '.join(map(str, columns))}) numbers"
        raise ShapeError(f"{name} has shape {array.shape} and dtype {array.dtype}, expected {expected}; convert it")
    return array


def _check_positions(points: NDArray[np.float64]) -> None:
    if len(points) < FEWEST_POINTS:
        raise InputError(f"the cloud has {len(points)} points, expected {FEWEST_POINTS} or more; check the export")
    broken = ~np.isfinite(points).all(axis=1)
    if broken.any():
        raise InputError(
            f"{np.count_nonzero(broken)} of {len(points)} points have NaN or infinite coordinates (first: point "
            f"{int(np.argmax(broken))}), expected finite numbers; remove them"
        )
    largest = float(np.abs(points).max())
    diagonal = float(np.linalg.norm(np.ptp(points, axis=0))) if largest <= LARGEST_DIAGONAL else largest
    if not SMALLEST_DIAGONAL <= diagonal <= LARGEST_DIAGONAL:
        raise InputError(
            f"the cloud's bounding box has diagonal {diagonal:.3g}, expected {SMALLEST_DIAGONAL:g} to "
            f"{LARGEST_DIAGONAL:g}; check the points and their unit"
        )
