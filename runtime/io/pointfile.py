"""Points in, uv out: .npy .npz .csv .ply → (n, 3), and the answer of a session → .npz or .csv.

n points in the units of the source mesh.  Files may come from anyone: nothing is unpickled, sizes are checked first.
"""

from __future__ import annotations

import io
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np
import trimesh

from ..errors import InputError, MissingFileError, ShapeError

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

MAX_POINTS = 200_000_000
READ = (".npy", ".npz", ".csv", ".ply")
WRITTEN = (".npz", ".csv")


def read_points(path: Path) -> NDArray[np.float32] | NDArray[np.float64]:
    """Read points.

    Args:
        path: .npy; .npz (the array "points", or the only one); .csv (an optional line of names, then x, y, z first;
            comma, semicolon, tab or spaces between; lines that start with # are skipped); .ply (its vertices).

    Returns:
        (n, 3) float32 where the file holds float32, else float64; n may be 0.

    Raises:
        MissingFileError: nothing lies there.
        InputError: another extension, unreadable, NaN or infinite, more than MAX_POINTS points.
        ShapeError: not (n, 3) numbers.
    """
    readers = {".npy": _read_npy, ".npz": _read_npz, ".csv": _read_csv, ".ply": _read_ply}
    reader = readers.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: extension {path.suffix!r}, expected {' '.join(READ)}; convert the points")
    if not path.is_file():
        raise MissingFileError(f"{path} does not exist, expected a file of points; check the path")
    if path.stat().st_size > 24 * MAX_POINTS:
        raise InputError(f"{path} has {path.stat().st_size} bytes, at most {24 * MAX_POINTS} are read; split it")
    return _checked(reader(path), path)


def check_output(path: Path) -> None:
    """Refuse a name that write_unwrapped can't write: call it before the work.

    Raises: InputError.
    """
    if path.suffix.lower() not in WRITTEN:
        raise InputError(f"{path}: extension {path.suffix!r}, expected {' or '.join(WRITTEN)}; choose another -o")


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
        np.savez(path, points=points, uv=uv, chart=chart, score=score)
        return
    table = np.zeros(n, dtype=[(name, "f8") for name in ("x", "y", "z", "u", "v")] + [("chart", "i8"), ("score", "f8")])
    for name, column in zip(table.dtype.names or (), (*points.T, *uv.T, chart, score), strict=True):
        table[name] = column
    exact = "%.9g" if points.dtype == np.float32 else "%.17g"
    form = [exact, exact, exact, "%.9g", "%.9g", "%d", "%.9g"]
    np.savetxt(path, table, fmt=form, delimiter=",", header="x,y,z,u,v,chart,score", comments="", encoding="utf-8")


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


def _read_npy(path: Path) -> NDArray[Any]:
    try:
        return np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise InputError(f"{path} is no .npy file of plain numbers ({error}); write it with numpy.save") from error


def _read_npz(path: Path) -> NDArray[Any]:
    try:
        with zipfile.ZipFile(path) as archive:
            size = max((entry.file_size for entry in archive.infolist()), default=0)
        if size > 24 * MAX_POINTS:
            raise InputError(f"{path} unpacks to {size} bytes, at most {24 * MAX_POINTS} are read; split it")
        with np.load(path, allow_pickle=False) as arrays:
            names = list(arrays.files)
            name = "points" if "points" in names else names[0] if len(names) == 1 else None
            if name is None:
                raise InputError(f"{path} holds {names}, expected an array 'points', or a single one; save it so")
            return arrays[name]
    except InputError:
        raise
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, NotImplementedError) as error:
        raise InputError(f"{path} is no .npz file of plain numbers ({error}); write it with numpy.savez") from error


def _read_csv(path: Path) -> NDArray[np.float64]:
    try:
        lines = [line for line in path.read_text(encoding="utf-8-sig").splitlines() if line.strip() and line[0] != "#"]
    except UnicodeDecodeError as error:
        raise InputError(f"{path} is no UTF-8 text ({error.reason}); save it as UTF-8") from error
    if not lines:
        raise InputError(f"{path} is empty, expected lines of x,y,z; check the export")
    delimiter = next((mark for mark in (",", ";", "\t") if mark in lines[0]), None)
    body = lines if _is_number(lines[0].split(delimiter)[0]) else lines[1:]
    if not body:
        return np.zeros((0, 3))
    try:
        return np.loadtxt(body, delimiter=delimiter, usecols=(0, 1, 2), ndmin=2, comments=None)
    except (ValueError, IndexError) as error:
        raise InputError(
            f"{path}: {str(error).rstrip('.')}; expected lines of x,y,z: mend or remove that line"
        ) from error


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _read_ply(path: Path) -> NDArray[np.float64]:
    try:
        scene = trimesh.load_scene(
            io.BytesIO(path.read_bytes()), file_type="ply", process=False, fix_texture=False, skip_materials=True
        )
    except Exception as error:
        raise InputError(
            f"{path} is not readable as .ply ({type(error).__name__}: {error}); export it again"
        ) from error
    clouds = [np.asarray(geometry.vertices, dtype=np.float64) for geometry in scene.geometry.values()]
    if not clouds:
        raise InputError(f"{path} holds no vertices, expected points; check the export")
    return np.concatenate(clouds)
