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
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import MeshError
from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.io.polygons import fans

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset

READ_BACK = 500_000
"""Faces up to which files are read back; of larger meshes the arrays that were serialized are judged."""
COMPONENTS = {5123: "<u2", 5125: "<u4", 5126: "<f4"}
"""glTF's numbers of component types."""
PLY_TYPES = {"double": "<f8", "float": "<f4", "int": "<i4", "uchar": "u1"}


@dataclass(frozen=True)
class PartUv:
    """Where uv lie in a glTF file: a primitive, the set of its uv, whether its faces wind the other way."""

    mesh: int = 0
    primitive: int = 0
    coordinates: int = 0
    mirrored: bool = False


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


@dataclass(frozen=True, eq=False)
class Reading:
    """What is read of files.

    apart: whether no two triangles are known to overlap; files that hold the same are not tested again.
    parts: of files with several meshes, in the order of the faces.  fans: (g, 3, 2) uv of other files, whose polygons
    are read as fans from their first corner; None where all are triangles.  faces: (f,) int64 of triangles in them,
    None is all.  most: faces of a file that is read.
    """

    apart: bool = False
    parts: Sequence[PartUv] = (PartUv(),)
    fans: NDArray[np.float32] | None = None
    faces: NDArray[np.int64] | None = None
    most: int = READ_BACK


def parts_of(asset: Asset, coordinates: int = 0) -> tuple[NDArray[np.int64], list[PartUv]]:
    """The order (f,) of faces in a glTF file, part after part, and where the uv of each part lie in it.

    coordinates: the set that the uv are.
    """
    if asset.document is None or asset.part is None:
        return np.arange(len(asset.faces)), [PartUv(coordinates=coordinates)]
    parts = [asset.document.parts[int(number)] for number in np.unique(asset.part)]
    places = [PartUv(part.mesh, part.primitive, coordinates, part.mirrored) for part in parts]
    return np.argsort(asset.part, kind="stable"), places


def written_report(
    files: Mapping[str, Path | None], corner_uv: NDArray[np.float32], reading: Reading | None = None
) -> dict[str, dict[str, Any]]:
    """Format → fields of `WrittenUv`.

    Args:
        files: format → the file, or None for one that is not kept.
        corner_uv: (f, 3, 2) float32 v up, what was to be written.
        reading: what is read of them; None is everything.

    Raises: MeshError when a file does not hold what its format asks for.
    """
    reading, wanted = reading or Reading(), corner_uv.astype(np.float64)
    judged = _judged(wanted, apart=reading.apart)
    known = [(wanted, judged)]
    if reading.fans is not None and len(reading.fans) == len(wanted):  # as fans the same polygons are other triangles
        known.append((reading.fans.astype(np.float64), judged))
    report: dict[str, dict[str, Any]] = {}
    for kind, path in files.items():
        reads = path is not None and len(wanted) <= reading.most
        uv = corner_uv_of(path, reading) if path is not None and reads else serialized(corner_uv, kind)
        same = next((found for other, found in known if np.array_equal(other, uv)), None)
        found = _judged(uv) if same is None else same
        known.append((uv, found))
        report[kind] = asdict(WrittenUv(len(uv), *found, read_back=reads))
    return report


def serialized(corner_uv: NDArray[np.float32], kind: str) -> NDArray[np.float64]:
    """(f, 3, 2) float64 v up: uv as a file of that kind holds them, which rounds 1 − v to float32 if it is glTF."""
    uv = corner_uv.astype(np.float64)
    if kind in ("glb", "gltf"):
        uv[..., 1] = 1.0 - (1.0 - uv[..., 1]).astype(np.float32).astype(np.float64)
    return uv


def corner_uv_of(path: Path, reading: Reading | None = None) -> NDArray[np.float64]:
    """(f, 3, 2) float64 v up of a .glb, .gltf, .obj, .ply or .usda file.

    reading: the parts of a glTF or USD file, or the faces of another, that are read; None is one mesh, all of it.

    Raises: MeshError for another ending or a file without such uv.
    """
    reading = reading or Reading()
    readers = {".obj": _obj_uv, ".ply": _ply_uv, ".usda": partial(_usda_uv, parts=reading.parts)}
    if path.suffix not in (*readers, ".glb", ".gltf"):
        known = ", ".join((".glb", ".gltf", *readers))
        raise MeshError(f"{path.name}: expected one of {known}; name a mesh file that flexpara wrote")
    try:
        if path.suffix in readers:
            uv = readers[path.suffix](path.read_bytes())
            return uv if reading.faces is None else uv[reading.faces]
        document, data = _gltf_chunks(path)
        return np.concatenate([_primitive_uv(document, data, part) for part in reading.parts])
    except (ValueError, KeyError, IndexError, AttributeError, struct.error) as error:
        raise MeshError(f"{path.name} holds no triangles with uv ({error}); it was not written whole") from error


def _judged(uv: NDArray[np.float64], *, apart: bool = False) -> tuple[int, int]:
    """Flipped triangles and overlapping pairs; apart: whether there are known to be none of the latter."""
    return int(flipped_triangles(uv).sum()), 0 if apart else len(overlapping_pairs(uv))


def _gltf_chunks(path: Path) -> tuple[dict[str, Any], bytes]:
    """JSON and buffer: the two chunks of a GLB file, or a .gltf file and the one beside it."""
    data = path.read_bytes()
    if path.suffix == ".gltf":
        document = json.loads(data)
        return document, path.with_name(document["buffers"][0]["uri"]).read_bytes()
    (size,) = struct.unpack_from("<I", data, 12)
    return json.loads(data[20 : 20 + size]), data[28 + size :]


def _primitive_uv(document: dict[str, Any], data: bytes, part: PartUv) -> NDArray[np.float64]:
    """(f, 3, 2) uv of the triangles of one primitive."""
    primitive = document["meshes"][part.mesh]["primitives"][part.primitive]

    def accessor(number: int) -> NDArray[Any]:
        found = document["accessors"][number]
        view = document["bufferViews"][found["bufferView"]]
        offset = view.get("byteOffset", 0) + found.get("byteOffset", 0)
        width = {"SCALAR": 1, "VEC2": 2}[found["type"]]
        values = np.frombuffer(data, COMPONENTS[found["componentType"]], found["count"] * width, offset)
        return values.reshape(found["count"], width)

    uv = accessor(primitive["attributes"][f"TEXCOORD_{part.coordinates}"]).astype(np.float64)
    uv[:, 1] = 1.0 - uv[:, 1]
    faces = accessor(primitive["indices"]).reshape(-1, 3).astype(np.int64)
    return uv[faces[:, [0, 2, 1]] if part.mirrored else faces]


def _fans(size: NDArray[np.int64], corner: NDArray[np.int64]) -> NDArray[np.int64]:
    """(t, 3) int64: polygons of these sizes as fans from their first corner."""
    return corner[fans(size)[0]]


def _obj_uv(data: bytes) -> NDArray[np.float64]:
    """Lines vt and f; polygons without uv are left out."""
    lines = data.decode("utf-8").splitlines()
    uv = np.array([line.split()[1:3] for line in lines if line.startswith("vt ")], np.float32).astype(np.float64)
    rows = [line.split()[1:] for line in lines if line.startswith("f ")]
    corners = [[word.split("/")[1] for word in words] for words in rows if not words[0].count("//")]
    size = np.array([len(row) for row in corners], np.int64)
    flat = np.array([number for row in corners for number in row], np.int64)
    return uv[_fans(size, flat) - 1]


def _ply_uv(data: bytes) -> NDArray[np.float64]:
    """Columns s and t, and the lists of corners behind the vertices, of a binary file."""
    head, start = data.split(b"end_header\n", 1)[0].decode(), data.index(b"end_header\n") + 11
    counts = {kind: int(count) for kind, count in re.findall(r"element (\w+) (\d+)", head)}
    vertex = np.dtype([(name, PLY_TYPES[kind]) for kind, name in re.findall(r"property (\w+) (\w+)\n", head)])
    table = np.frombuffer(data, vertex, counts["vertex"], start)
    (length,) = re.findall(r"property list (\w+) int", head)
    place, width, size, corner = start + table.nbytes, np.dtype(PLY_TYPES[length]).itemsize, [], []
    for _ in range(counts["face"]):
        number = int.from_bytes(data[place : place + width], "little")
        corner.append(np.frombuffer(data, "<i4", number, place + width))
        size.append(number)
        place += width + 4 * number
    faces = _fans(np.array(size, np.int64), np.concatenate(corner).astype(np.int64))
    return np.column_stack([table["s"], table["t"]]).astype(np.float64)[faces]


def _usda_uv(data: bytes, parts: Sequence[PartUv]) -> NDArray[np.float64]:
    """Attributes primvars:st and faceVertexIndices of all meshes; parts: which of them wind the other way."""
    text = data.decode("utf-8")
    names = ("faceVertexCounts", "faceVertexIndices", "primvars:st")
    count, index, st = (re.findall(rf"{name} = \[([^\]]*)\]", text) for name in names)
    found = []
    for sizes, corners, uv, part in zip(count, index, st, parts, strict=True):
        numbers = np.array(re.findall(r"[-+.\deE]+", uv), np.float32).astype(np.float64)
        size, corner = (np.array(numbers_of.split(","), np.int64) for numbers_of in (sizes, corners))
        faces = _fans(size, corner)
        found.append(numbers.reshape(-1, 2)[faces[:, [0, 2, 1]] if part.mirrored else faces])
    return np.concatenate(found)
