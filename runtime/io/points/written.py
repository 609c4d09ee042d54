"""What is written of a point cloud: its points with their uv and chart, as .ply and .npz.   n points."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..ply.write import write_cloud_ply
from .cloudfile import write_cloud_npz

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from ...files import OutputFolder
    from .cloud import PointCloud


def point_files(stem: str) -> tuple[str, str]:
    """The files that hold the points of a cloud."""
    return f"{stem}.ply", f"{stem}.npz"


def write_points(output: OutputFolder, cloud: PointCloud, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> None:
    """The points with their uv (n, 2) and chart (n,).  Raises: ShapeError where these don't fit the cloud."""
    for name, write in zip(point_files(output.stem), (write_cloud_ply, write_cloud_npz), strict=True):
        output.write(name, lambda path, write=write: write(path, cloud, uv, chart))
