"""What was written, read back: the uv of a mesh file, and whether they are valid as they stand in it.

f faces.  Each format has a reader of its own here, which knows nothing of the writer and looks at uv and corners alone.
glTF stores v downwards, the others upwards; uv are returned v up, and 1 − v is exact in float64, so a flip or an
overlap in the file is one in the numbers returned.
"""

from __future__ import annotations

import json
import re
import struct
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import MeshError
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from numpy.typing import NDArray

READ_BACK = 500_000
"""Faces up to which files are read back; of larger meshes the arrays that were serialized are judged."""
COMPONENTS = {5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""glTF's numbers of component types."""
PLY_TYPES = {"double": "<f8", "float": "<f4", "int": "<i4", "uchar": "u1"}


@dataclass(frozen=True)
class WrittenUv:
    """What a file holds.

    faces: how many.  flipped: triangles that are clockwise or without area, exact.  overlapping: pairs of triangles
    whose interiors meet, exact.  read_back: whether the file was read, or else the arrays that went into it.
    """

    faces: int
    flipped: int
    overlapping: int
    read_back: bool


def written_report(
    files: Mapping[str, Path | None],
    corner_uv: NDArray[np.float32],
    *,
    apart: bool = False,
    read_back: int = READ_BACK,
) -> dict[str, dict[str, Any]]:
    """Format → fields of `WrittenUv`.

    Args:
        files: format → the file, or None for one that is not kept.
        corner_uv: (f, 3, 2) float32 v up, what was to be written.
        apart: whether no two of their triangles are known to overlap; files that hold the same are not tested again.
        read_back: most faces of a file that is read.

    Raises: MeshError when a file does not hold what its format asks for.
    """
    wanted = corner_uv.astype(np.float64)
    known = [(wanted, _judged(wanted, apart=apart))]
    report: dict[str, dict[str, Any]] = {}
    for kind, path in files.items():
        reads = path is not None and len(wanted) <= read_back
        uv = corner_uv_of(path) if path is not None and reads else serialized(corner_uv, kind)
        same = next((found for other, found in known if np.array_equal(other, uv)), None)
        found = _judged(uv) if same is None else same
        known.append((uv, found))
        report[kind] = asdict(WrittenUv(len(uv), *found, read_back=reads))
    return report


def serialized(corner_uv: NDArray[np.float32], kind: str) -> NDArray[np.float64]:
    """(f, 3, 2) float64 v up: uv as a file of that kind holds them, which rounds 1 − v to float32 if it is glTF."""
    uv = corner_uv.astype(np.float64)
    if kind == "glb":
        uv[..., 1] = 1.0 - (1.0 - uv[..., 1]).astype(np.float32).astype(np.float64)
    return uv


def corner_uv_of(path: Path) -> NDArray[np.float64]:
    """(f, 3, 2) float64 v up of a .glb, .obj, .ply or .usda file of one mesh of triangles.

    Raises: MeshError for another ending or a file without such uv.
    """
    readers = {".glb": _glb_uv, ".obj": _obj_uv, ".ply": _ply_uv, ".usda": _usda_uv}
    if path.suffix not in readers:
        raise MeshError(f"{path.name}: expected one of {', '.join(readers)}; name a mesh file that flexpara wrote")
    try:
        return readers[path.suffix](path.read_bytes())
    except (ValueError, KeyError, IndexError, AttributeError, struct.error) as error:
        raise MeshError(f"{path.name} holds no triangles with uv ({error}); it was not written whole") from error


def _judged(uv: NDArray[np.float64], *, apart: bool = False) -> tuple[int, int]:
    """Flipped triangles and overlapping pairs; apart: whether there are known to be none of the latter."""
    return int(flipped_triangles(uv).sum()), 0 if apart else len(overlapping_pairs(uv))


def _glb_uv(data: bytes) -> NDArray[np.float64]:
    """Accessors of the first primitive, out of the two chunks of a GLB file."""
    (size,) = struct.unpack_from("<I", data, 12)
    document, start = json.loads(data[20 : 20 + size]), 28 + size
    primitive = document["meshes"][0]["primitives"][0]

    def accessor(number: int) -> NDArray[Any]:
        found = document["accessors"][number]
        view = document["bufferViews"][found["bufferView"]]
        offset = start + view.get("byteOffset", 0) + found.get("byteOffset", 0)
        width = {"SCALAR": 1, "VEC2": 2}[found["type"]]
        values = np.frombuffer(data, COMPONENTS[found["componentType"]], found["count"] * width, offset)
        return values.reshape(found["count"], width)

    uv = accessor(primitive["attributes"]["TEXCOORD_0"]).astype(np.float64)
    uv[:, 1] = 1.0 - uv[:, 1]
    return uv[accessor(primitive["indices"]).reshape(-1, 3).astype(np.int64)]


def _obj_uv(data: bytes) -> NDArray[np.float64]:
    """Lines vt and f."""
    lines = data.decode("utf-8").splitlines()
    uv = np.array([line.split()[1:3] for line in lines if line.startswith("vt ")], np.float32).astype(np.float64)
    corners = [[word.split("/")[1] for word in line.split()[1:]] for line in lines if line.startswith("f ")]
    return uv[np.array(corners, np.int64).reshape(-1, 3) - 1]


def _ply_uv(data: bytes) -> NDArray[np.float64]:
    """Columns s and t, and the lists of three corners behind the vertices, of a binary file."""
    head, start = data.split(b"end_header\n", 1)[0].decode("ascii"), data.index(b"end_header\n") + 11
    counts = {kind: int(count) for kind, count in re.findall(r"element (\w+) (\d+)", head)}
    vertex = np.dtype([(name, PLY_TYPES[kind]) for kind, name in re.findall(r"property (\w+) (\w+)\n", head)])
    table = np.frombuffer(data, vertex, counts["vertex"], start)
    face = np.dtype([("count", "u1"), ("corner", "<i4", (3,))])
    faces = np.frombuffer(data, face, counts["face"], start + table.nbytes)
    return np.column_stack([table["s"], table["t"]]).astype(np.float64)[faces["corner"]]


def _usda_uv(data: bytes) -> NDArray[np.float64]:
    """Attributes primvars:st and faceVertexIndices of the one mesh."""
    text = data.decode("utf-8")
    index, st = (re.search(rf"{name} = \[([^\]]*)\]", text) for name in ("faceVertexIndices", "primvars:st"))
    if index is None or st is None:
        raise ValueError("no faceVertexIndices or primvars:st")
    numbers = np.array(re.findall(r"[-+.\deE]+", st[1]), np.float32).astype(np.float64)
    return numbers.reshape(-1, 2)[np.array(index[1].split(","), np.int64).reshape(-1, 3)]
