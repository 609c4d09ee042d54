"""Points with uv and chart → .ply or .npz: the user's points, all of them, in their order.

n points.  uv is in [0, 1]², v up; positions are float64 in source units and read back exactly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import ShapeError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from .cloud import PointCloud


def write_cloud_ply(path: Path, cloud: PointCloud, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> None:
    """Write binary little-endian PLY without faces.

    double x y z [, float nx ny nz], float s t, int chart [, uchar red green blue alpha].  The names s and t are those
    that Blender and MeshLab take for uv; normals and colours are written where the cloud has them.

    Args:
        path: the .ply file.
        cloud: n points.
        uv: (n, 2) float32.
        chart: (n,) int64, below 2³¹.

    Raises:
        ShapeError: uv or chart don't fit the cloud.
    """
    _check(cloud, uv, chart)
    fields = [(axis, "<f8") for axis in "xyz"]
    columns = [*cloud.points.T]
    if cloud.normals is not None:
        fields += [(name, "<f4") for name in ("nx", "ny", "nz")]
        columns += [*cloud.normals.T]
    fields += [("s", "<f4"), ("t", "<f4"), ("chart", "<i4")]
    columns += [*uv.T, chart]
    if cloud.colors is not None:
        fields += [(name, "u1") for name in ("red", "green", "blue", "alpha")]
        columns += [*cloud.colors.T]
    table = np.zeros(len(cloud.points), dtype=fields)
    for (name, _), column in zip(fields, columns, strict=True):
        table[name] = column
    words = {"<f8": "double", "<f4": "float", "<i4": "int", "u1": "uchar"}
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment flexpara: s t are the atlas uv, v up",
        f"element vertex {len(table)}",
        *(f"property {words[kind]} {name}" for name, kind in fields),
        "end_header",
    ]
    path.write_bytes(("\n".join(header) + "\n").encode("ascii") + table.tobytes())


def write_cloud_npz(path: Path, cloud: PointCloud, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> None:
    """Write .npz: points (n, 3) float64, uv (n, 2) float32, chart (n,) int64, and normals, colors where there are any.

    Args and Raises as write_cloud_ply.
    """
    _check(cloud, uv, chart)
    extra = {"normals": cloud.normals, "colors": cloud.colors}
    known = {name: values for name, values in extra.items() if values is not None}
    with path.open("wb") as file:
        np.savez(file, points=cloud.points, uv=uv, chart=chart, **known)


def _check(cloud: PointCloud, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> None:
    n = len(cloud.points)
    if uv.shape != (n, 2) or chart.shape != (n,):
        raise ShapeError(f"uv and chart have shapes {uv.shape} and {chart.shape}, expected {(n, 2)} and {(n,)}")
