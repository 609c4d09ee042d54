"""Point cloud file → PointCloud, and back as .npz.

.ply without faces · .xyz .txt .csv with x y z [nx ny nz | red green blue] · .npy (n, 3) or (n, 6), the same ·
.npz with "points" [, "normals", "colors"].  Positions are float64 in the units of the file, in its order.  A file may
come from anyone: nothing is unpickled, and sizes are checked before anything is allocated.
"""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, MissingFileError, ShapeError
from ..ply.header import FACES, MAX_HEADER, ply_header
from ..ply.leftout import left_out
from ..ply.read import read_ply_points
from .cloud import PointCloud, check_uv, cloud_from_arrays, with_changes
from .tables import MAX_BYTES, TEXT, read_table

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

READ = (".ply", *TEXT, ".npy", ".npz")
MAX_POINTS = 200_000_000

Arrays = dict[str, "NDArray[Any]"]


def is_cloud(path: Path) -> bool:
    """Whether a path is to be read as points: by its extension, and for a .ply that exists by its having no faces.

    A .ply whose header can't be read is left to the mesh readers, which say what is wrong with it.
    """
    kind = path.suffix.lower()
    if kind != ".ply":
        return kind in READ
    if not path.is_file():
        return False
    with path.open("rb") as file:
        head = file.read(MAX_HEADER)
    try:
        header = ply_header(head)
    except InputError:
        return False
    return header.count(*FACES) == 0 and header.count("vertex") > 0


def load_cloud(path: Path) -> PointCloud:
    """Read and check a point cloud.

    Args:
        path: one of READ.

    Raises:
        MissingFileError: nothing lies there.
        InputError: another extension, damaged, too large, not finite, or too few points.
        ShapeError: not (n, 3) or (n, 6) numbers.
    """
    kind = path.suffix.lower()
    if kind not in READ:
        raise InputError(f"{path}: extension {path.suffix!r}, expected {' '.join(READ)}; convert the points")
    if not path.is_file():
        raise MissingFileError(f"{path} does not exist, expected a file of points; check the path")
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"{path} has {path.stat().st_size} bytes, at most {MAX_BYTES} are read; thin the points out")
    data = path.read_bytes()
    try:
        arrays = _read(data, kind)
        if len(arrays["points"]) > MAX_POINTS:
            raise InputError(f"{len(arrays['points'])} points, at most {MAX_POINTS} are read; thin them out")
        cloud = cloud_from_arrays(**arrays, stem=path.stem, sha256=hashlib.sha256(data).hexdigest())
        return with_changes(cloud, **left_out(ply_header(data))) if kind == ".ply" else cloud
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error


def _read(data: bytes, kind: str) -> Arrays:
    if kind == ".ply":
        return dict(read_ply_points(data))
    table = read_table(data, kind)
    if not isinstance(table, dict):
        return _split(table)
    named = table if "points" in table else {"points": next(iter(table.values()))}
    return named if "normals" in named else {**named, **_split(named["points"])}


def _split(table: NDArray[Any]) -> Arrays:
    """(n, 3) or (n, 6) → points, and colours where the last three are whole numbers from 0 to 255, else normals."""
    if table.ndim != 2 or table.shape[1] not in (3, 6) or table.dtype.kind not in "iuf":
        hint = "did you pass the transpose?" if table.ndim == 2 and table.shape[0] in (3, 6) else "convert them"
        raise ShapeError(
            f"the points have shape {table.shape} and dtype {table.dtype}, expected (n, 3) or (n, 6) numbers; {hint}"
        )
    if table.shape[1] == 3:
        return {"points": table}
    points, more = table[:, :3], table[:, 3:]
    if more.max(initial=0.0) > 1.0 and ((more >= 0.0) & (more <= 255.0) & (more == np.rint(more))).all():
        return {"points": points, "colors": more.astype(np.uint8)}
    return {"points": points, "normals": more}


def write_cloud_npz(path: Path, cloud: PointCloud, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> None:
    """Write .npz: points (n, 3) float64, uv (n, 2) float32, chart (n,) int64, and normals, colors where there are any.

    Raises: ShapeError where uv or chart don't fit the cloud.
    """
    check_uv(cloud, uv, chart)
    extra = {"normals": cloud.normals, "colors": cloud.colors}
    known = {name: values for name, values in extra.items() if values is not None}
    with path.open("wb") as file:
        np.savez(file, points=cloud.points, uv=uv, chart=chart, **known)
