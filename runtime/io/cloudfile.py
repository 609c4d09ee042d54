"""Point cloud file → PointCloud.

.ply without faces · .xyz .txt .csv with x y z [nx ny nz | red green blue] · .npy (n, 3) or (n, 6), the same ·
.npz with "points" [, "normals", "colors"].  Positions are float64 in the units of the file, in its order.  A file may
come from anyone: nothing is unpickled, and sizes are checked before anything is allocated.
"""

from __future__ import annotations

import hashlib
import io
import zipfile
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError, MissingFileError, ShapeError
from .cloud import PointCloud, cloud_from_arrays
from .plycloud import MAX_HEADER, ply_header, read_ply_points

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

TEXT = (".xyz", ".txt", ".csv")
READ = (".ply", *TEXT, ".npy", ".npz")
MAX_BYTES = 8 << 30
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
    return header.faces == 0 and any(element.name == "vertex" and element.count for element in header.elements)


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
        return cloud_from_arrays(**arrays, stem=path.stem, sha256=hashlib.sha256(data).hexdigest())
    except InputError as error:
        raise type(error)(f"{path}: {error}") from error


def _read(data: bytes, kind: str) -> Arrays:
    if kind == ".ply":
        return dict(read_ply_points(data))
    if kind == ".npz":
        return _read_npz(data)
    return _split(_read_npy(data) if kind == ".npy" else _read_text(data))


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


def _read_npy(data: bytes) -> NDArray[Any]:
    """The array of a .npy file; numpy compares no size with the header's promise, so that comes first."""
    try:
        file = io.BytesIO(data)
        version = np.lib.format.read_magic(file)
        shape, _, kind = (
            np.lib.format.read_array_header_1_0(file)
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0(file)
        )
        if kind.hasobject:
            raise InputError("the array holds Python objects, expected plain numbers; write it with numpy.save")
        promised = kind.itemsize * int(np.prod(np.array(shape, dtype=object)))
        if promised > len(data):
            raise InputError(
                f"the header promises {promised} bytes, the file has {len(data)}; it is cut off: copy it again"
            )
        return np.load(io.BytesIO(data), allow_pickle=False)
    except InputError:
        raise
    except (ValueError, OSError, EOFError) as error:
        raise InputError(f"no .npy file of plain numbers ({error}); write it with numpy.save") from error


def _read_npz(data: bytes) -> Arrays:
    """The array "points" or the only one, and "normals" and "colors" where they are."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            sizes = {entry.filename.removesuffix(".npy"): entry.file_size for entry in archive.infolist()}
            wanted = _wanted(list(sizes))
            total = sum(sizes[name] for name in wanted.values())
            if total > MAX_BYTES:
                raise InputError(f"it unpacks to {total} bytes, at most {MAX_BYTES} are read; thin the points out")
            arrays = {group: _read_npy(archive.read(f"{name}.npy")) for group, name in wanted.items()}
    except InputError:
        raise
    except (ValueError, OSError, EOFError, KeyError, zipfile.BadZipFile, NotImplementedError, RuntimeError) as error:
        raise InputError(f"no .npz file of plain numbers ({error}); write it with numpy.savez") from error
    return arrays if "normals" in arrays else {**arrays, **_split(arrays["points"])}


def _wanted(names: list[str]) -> dict[str, str]:
    """Group → the archive's name for it."""
    if "points" not in names and len(names) == 1:
        return {"points": names[0]}
    if "points" not in names:
        raise InputError(f"the file holds {names}, expected an array 'points', or a single one; save it so")
    return {group: group for group in ("points", "normals", "colors") if group in names}


def _read_text(data: bytes) -> NDArray[np.float64]:
    """Lines of three or six numbers; comma, semicolon, tab or spaces between; # starts a comment."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(f"no UTF-8 text ({error.reason}); save it as UTF-8") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    delimiter = next((mark for mark in (",", ";", "\t") if lines and mark in lines[0]), None)
    body = lines if lines and _is_number(lines[0].split(delimiter)[0]) else lines[1:]
    if not body:
        raise InputError("the file holds no numbers, expected lines of x y z; check the export")
    try:
        return np.loadtxt(body, delimiter=delimiter, ndmin=2, comments=None)
    except ValueError as error:
        reason = str(error).splitlines()[0].rstrip(".")
        raise InputError(f"{reason}; expected lines of x y z, or x y z nx ny nz: mend or remove that line") from error


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
