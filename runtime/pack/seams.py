"""Vertices of an atlas: split along seams, given normals, and rounded to float32 without flipping a triangle.

n file vertices · a atlas vertices · f faces.  uv is v up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import FinishError
from ..geometry.normals import smooth_normals
from ..geometry.overlap import orientation_sign

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Asset

_REPAIR_ROUNDS = 8
_STEPS = np.stack(np.meshgrid(np.arange(-2, 3), np.arange(-2, 3)), axis=-1).reshape(-1, 2)


def split_vertices(
    faces: NDArray[np.int64], face_chart: NDArray[np.int64], corner_uv: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """One atlas vertex per (file vertex, chart, distinct uv).

    Args:
        faces: (f, 3) int64 file vertices.
        face_chart: (f,) int64.
        corner_uv: (f, 3, 2) float64.

    Returns:
        (f, 3) int64 faces over atlas vertices, (a,) int64 the file vertex of each, ascending, and (a, 2) float64 uv.
    """
    vertex, chart, uv = faces.reshape(-1), np.repeat(face_chart, 3), corner_uv.reshape(-1, 2)
    order = np.lexsort((uv[:, 1], uv[:, 0], chart, vertex))
    fresh = np.ones(len(order), dtype=bool)
    fresh[1:] = (vertex[order][1:] != vertex[order][:-1]) | (chart[order][1:] != chart[order][:-1])
    fresh[1:] |= (uv[order][1:] != uv[order][:-1]).any(axis=1)
    of_corner = np.zeros(len(order), dtype=np.int64)
    of_corner[order] = np.cumsum(fresh) - 1
    first = order[fresh]
    return of_corner.reshape(-1, 3), vertex[first], uv[first]


def atlas_normals(asset: Asset, source_vertex: NDArray[np.int64]) -> NDArray[np.float32]:
    """(a, 3) float32 unit normals: the file's own where it has them, else smooth normals of the welded surface."""
    if asset.normals is None:
        return smooth_normals(asset.surface)[asset.weld[source_vertex]].astype(np.float32)
    normals = asset.normals[source_vertex]
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    smooth = smooth_normals(asset.surface)[asset.weld[source_vertex]]
    with np.errstate(invalid="ignore"):
        return np.where(length > 0.0, normals / length, smooth).astype(np.float32)


def rounded_uv(uv: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float32]:
    """Atlas uv (a, 2) in float32, with every triangle of faces (f, 3) oriented as it was in float64 (exact).

    Rounding can flip slivers.  Their corners are then moved by up to two units in the last place.

    Raises:
        FinishError: a triangle is too thin for any such position.
    """
    before = _signs(uv, faces)
    rounded = uv.astype(np.float32)
    for _ in range(_REPAIR_ROUNDS):
        for face in _wrong(rounded, faces, before).tolist():
            _nudge(rounded, uv, faces, before, face)
    wrong = len(_wrong(rounded, faces, before))
    if wrong:
        raise FinishError(f"{wrong} triangles are too thin for float32 uv and would flip; remove slivers from the mesh")
    return rounded


def _wrong(rounded: NDArray[np.float32], faces: NDArray[np.int64], before: NDArray[np.int8]) -> NDArray[np.int64]:
    return np.flatnonzero((_signs(rounded, faces) != before) & (before != 0))


def _signs(uv: NDArray[np.float64] | NDArray[np.float32], faces: NDArray[np.int64]) -> NDArray[np.int8]:
    corner = uv.astype(np.float64)[faces]
    return orientation_sign(corner[:, 0], corner[:, 1], corner[:, 2])


def _nudge(
    rounded: NDArray[np.float32],
    uv: NDArray[np.float64],
    faces: NDArray[np.int64],
    before: NDArray[np.int8],
    face: int,
) -> None:
    """Move one corner of a face, in place, to the position near uv that leaves the fewest wrong triangles around it."""
    best: tuple[int, float, int, NDArray[np.float32]] | None = None
    for vertex in faces[face].tolist():
        around = np.flatnonzero((faces == vertex).any(axis=1) & (before != 0))
        unit = np.spacing(rounded[vertex])
        for step in _STEPS:
            place = (uv[vertex].astype(np.float32) + step.astype(np.float32) * unit).astype(np.float32)
            trial = rounded[faces[around]].astype(np.float64)
            trial[faces[around] == vertex] = place
            sign = orientation_sign(trial[:, 0], trial[:, 1], trial[:, 2])
            wrong = int((sign != before[around]).sum())
            move = float(np.abs(place - uv[vertex]).max())
            if best is None or (wrong, move) < best[:2]:
                best = (wrong, move, vertex, place)
    if best is not None:
        rounded[best[2]] = best[3]
