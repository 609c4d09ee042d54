"""Points in, uv out: a table or PLY → (n, 3), and the answer of a session → .npz or .csv.

n points in the units of the source mesh.  Files may come from anyone: nothing is unpickled, sizes are checked first.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError, MissingFileError, ShapeError
from ..formats.npz import array_names
from ..ply.read import read_ply_points
from .tables import TEXT, read_table

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

MAX_POINTS = 200_000_000
READ = (".npy", ".npz", *TEXT, ".ply")
WRITTEN = (".npz", ".csv")
ARRAYS = ("points", "uv", "chart", "score")
HEADER = "x,y,z,u,v,chart,score"


def read_points(path: Path) -> NDArray[np.float32] | NDArray[np.float64]:
    """Read points.

    Args:
        path: .npy; .npz (the array "points", or the only one); .csv .txt .xyz (x, y, z first, see tables.py); .ply (its
            vertices).

    Returns:
        (n, 3) float32 where the file holds float32, else float64; n may be 0.

    Raises:
        MissingFileError: nothing lies there.
        InputError: another extension, unreadable, NaN or infinite, more than MAX_POINTS points.
        ShapeError: not (n, 3) numbers.
    """
    kind = path.suffix.lower()
    if kind not in READ:
        raise InputError(f"{path}: extension {path.suffix!r}, expected {' '.join(READ)}; convert the points")
    if not path.is_file():
        raise MissingFileError(f"{path} does not exist, expected a file of points; check the path")
    if path.stat().st_size > 24 * MAX_POINTS:
        raise InputError(f"{path} has {path.stat().st_size} bytes, at most {24 * MAX_POINTS} are read; split it")
    try:
        points = _points(path.read_bytes(), kind)
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error
    return _checked(points, path)


def _points(data: bytes, kind: str) -> NDArray[Any]:
    if kind == ".ply":
        return read_ply_points(data)["points"]
    table = read_table(data, kind, columns=3)
    if isinstance(table, dict):
        return table["points"] if "points" in table else next(iter(table.values()))
    return table


def check_output(path: Path) -> None:
    """Refuse a name that write_unwrapped can't write: call it before the work.

    Raises: InputError.
    """
    if path.suffix.lower() not in WRITTEN:
        raise InputError(f"{path}: extension {path.suffix!r}, expected {' or '.join(WRITTEN)}; choose another -o")


def is_unwrapped(path: Path) -> bool:
    """Whether `write_unwrapped` wrote a file: its arrays or columns have these names, and there is no other."""
    if path.suffix.lower() == ".csv":
        with path.open("rb") as file:
            return file.readline(len(HEADER) + 2).rstrip() == HEADER.encode()
    return array_names(path) == set(ARRAYS)


def write_unwrapped(
    path: Path,
    points: NDArray[np.floating[Any]],
    uv: NDArray[np.float32],
    chart: NDArray[np.int64],
    score: NDArray[np.float32],
) -> None:
    """Write points and what a session answered: .npz with these four arrays, or .csv with x,y,z,u,v,chart,score.

    Args:
        path: .npz or .csv.
        points: (n, 3) float32 or float64.
        uv: (n, 2) float32.
        chart: (n,) int64.
        score: (n,) float32.

    Raises:
        InputError: another extension.
        ShapeError: lengths that differ.
    """
    check_output(path)
    shapes = [points.shape, uv.shape, chart.shape, score.shape]
    n = len(points)
    if shapes != [(n, 3), (n, 2), (n,), (n,)]:
        raise ShapeError(f"points, uv, chart, score have shapes {shapes}, expected (n, 3), (n, 2), (n,), (n,)")
    if path.suffix.lower() == ".npz":
        np.savez(path, **dict(zip(ARRAYS, (points, uv, chart, score), strict=True)))
        return
    table = np.zeros(n, dtype=[(name, "f8") for name in ("x", "y", "z", "u", "v")] + [("chart", "i8"), ("score", "f8")])
    for name, column in zip(table.dtype.names or (), (*points.T, *uv.T, chart, score), strict=True):
        table[name] = column
    exact = "%.9g" if points.dtype == np.float32 else "%.17g"
    form = [exact, exact, exact, "%.9g", "%.9g", "%d", "%.9g"]
    np.savetxt(path, table, fmt=form, delimiter=",", header=HEADER, comments="", encoding="utf-8")


def _checked(points: NDArray[Any], path: Path) -> NDArray[np.float32] | NDArray[np.float64]:
    if points.ndim != 2 or points.shape[1] != 3 or points.dtype.kind not in "iuf":
        hint = "did you pass the transpose?" if points.ndim == 2 and points.shape[0] == 3 else "convert the array"
        raise ShapeError(f"{path}: shape {points.shape}, dtype {points.dtype}, expected (n, 3) numbers; {hint}")
    if len(points) > MAX_POINTS:
        raise InputError(f"{path} holds {len(points)} points, at most {MAX_POINTS} are read; split it")
    single = points.dtype == np.float32
    result = np.array(points, dtype=np.float32) if single else np.array(points, dtype=np.float64)
    broken = ~np.isfinite(result).all(axis=1)
    if broken.any():
        raise InputError(
            f"{path}: {np.count_nonzero(broken)} of {len(result)} points are NaN or infinite (first: point "
            f"{int(np.argmax(broken))}), expected finite numbers; remove them"
        )
    return result
