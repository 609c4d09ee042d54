"""Wavefront OBJ → RawMesh, in the file's own order.

trimesh groups faces by material, reorders what a quad becomes and reads relative indices from the end of the file; here
face i of the file is face i of the mesh, polygons are fans from their first corner, and vertices are split only where
uv or normals differ.  v, vt, vn: positions, uv (v up), normals of the file; c corners of all polygons.  Indices in the
file count from 1, or back from the last element so far when negative; 0 means "absent" until they are resolved.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import MeshError
from ..material import Material
from .materials import read_mtl
from .rawmesh import RawMesh

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

COLOR_COLUMNS = {6: 3, 7: 4}  # x y z r g b, and x y z w r g b: numbers in a line → first colour
# (slashes, two in a row) of every corner of a file → which of v, vt, vn its numbers are
UNIFORM = {(0, False): (0,), (1, False): (0, 1), (2, True): (0, 2), (2, False): (0, 1, 2)}


@dataclass(frozen=True, eq=False)
class _Lines:
    """The file by kind of line: text (after the keyword) and line number of each."""

    text: dict[str, list[str]]
    number: dict[str, NDArray[np.int64]]


def read_obj(data: bytes, read_sibling: Callable[[str], bytes | None]) -> RawMesh:
    """Read an OBJ file.

    Args:
        data: the bytes of the file.
        read_sibling: name of a file beside it → its bytes, or None where there is none.

    Raises:
        MeshError: unreadable numbers, indices out of range, polygons under three corners, points without faces.
    """
    lines = _split(data)
    if lines.text["v"] and not lines.text["f"]:
        raise MeshError("the file holds points and no faces, expected faces; give points as .ply, .xyz or .npy")
    if not lines.text["f"]:
        raise MeshError(
            "no face in this OBJ file (no line that starts with 'f'), expected a triangle mesh; check the export"
        )
    positions, colors = _vertices(lines.text["v"])
    corners, polygon_size = _corners(lines, len(positions))
    triangles, polygon = _fans(polygon_size)
    file_uv, file_normals = _numbers("vt", lines.text["vt"], 1), _numbers("vn", lines.text["vn"], 3)
    vertex, faces = _split_vertices(corners, triangles)
    materials, face_material, changes = _materials(lines, polygon, read_sibling)
    has_uv, has_normals = bool((corners[:, 1] >= 0).any()), bool((corners[:, 2] >= 0).all())
    if has_uv and (missing := int(np.count_nonzero((corners[triangles, 1] < 0).any(axis=1)))):
        changes["faces_without_uv"] = missing
    return RawMesh(
        positions=positions[vertex[:, 0]],
        faces=faces,
        normals=file_normals[vertex[:, 2], :3] if has_normals else None,
        colors=None if colors is None else colors[vertex[:, 0]],
        uv=_uv(file_uv, vertex[:, 1]) if has_uv else None,
        materials=materials,
        face_material=face_material,
        changes=changes,
    )


def _split(data: bytes) -> _Lines:
    text = data.decode("utf-8", errors="replace").replace("\\\r\n", " ").replace("\\\n", " ").replace("\t", " ")
    kinds = ("v", "vt", "vn", "f", "usemtl", "mtllib")
    found: dict[str, list[str]] = {kind: [] for kind in kinds}
    number: dict[str, list[int]] = {kind: [] for kind in kinds}
    for index, line in enumerate(text.splitlines()):
        kind, _, rest = line.lstrip().partition(" ")
        if kind in found:
            found[kind].append(rest.partition("#")[0] if kind in ("v", "vt", "vn", "f") else rest.strip())
            number[kind].append(index)
    return _Lines(text=found, number={kind: np.array(value, dtype=np.int64) for kind, value in number.items()})


def _numbers(kind: str, lines: list[str], least: int) -> NDArray[np.float64]:
    """(n, columns) float64: as many columns as the shortest line has, at least `least`."""
    if not lines:
        return np.zeros((0, 3))
    rows = [line.split() for line in lines]
    columns = min(map(len, rows))
    if columns < least:
        short = next(index for index, row in enumerate(rows) if len(row) < least)
        raise MeshError(
            f"line '{kind} {lines[short].strip()[:40]}' has under {least} numbers; the file is damaged: export it again"
        )
    try:
        return np.array([float(word) for row in rows for word in row[:columns]]).reshape(-1, columns)
    except ValueError as error:
        raise MeshError(f"a '{kind}' line of the OBJ file is no list of numbers ({error}); export it again") from error


def _vertices(lines: list[str]) -> tuple[NDArray[np.float64], NDArray[np.uint8] | None]:
    numbers = _numbers("v", lines, 3)
    first = COLOR_COLUMNS.get(numbers.shape[1])
    if first is None:
        return numbers[:, :3], None
    rgb = np.nan_to_num(numbers[:, first : first + 3])
    rgb = np.clip(rgb if rgb.max(initial=0.0) > 1.0 else rgb * 255.0, 0.0, 255.0)
    alpha = np.full((len(rgb), 1), 255.0)
    return numbers[:, :3], np.rint(np.hstack([rgb, alpha])).astype(np.uint8)


def _corners(lines: _Lines, vertex_count: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(c, 3) int64 indices from 0 of (v, vt, vn), -1 where absent; and the (polygons,) int64 corner counts."""
    words = [line.split() for line in lines.text["f"]]
    size = np.array([len(polygon) for polygon in words], dtype=np.int64)
    if size.min() < 3:
        raise MeshError(
            f"face {int(np.argmin(size))} has {int(size.min())} corners, expected three or more; export the mesh again"
        )
    try:
        table = _index_table([word for polygon in words for word in polygon])
    except (ValueError, OverflowError) as error:
        raise MeshError(f"a face of the OBJ file has a corner that is no index ({error}); export it again") from error
    polygon = np.repeat(np.arange(len(size)), size)
    sizes = (vertex_count, len(lines.text["vt"]), len(lines.text["vn"]))
    for column, (kind, count) in enumerate(zip(("v", "vt", "vn"), sizes, strict=True)):
        so_far = np.searchsorted(lines.number[kind], lines.number["f"])[polygon]
        index = table[:, column]
        resolved = np.where(index > 0, index - 1, np.where(index < 0, so_far + index, -1))
        outside = (resolved >= count) | ((resolved < 0) & ((index != 0) | (column == 0)))
        if outside.any():
            first = int(np.argmax(outside))
            raise MeshError(
                f"face {int(polygon[first])} refers to '{kind}' number {int(index[first])}, expected 1 to {count}; "
                "the OBJ file is damaged: export it again"
            )
        table[:, column] = resolved
    return table, size


def _index_table(words: list[str]) -> NDArray[np.int64]:
    """'7', '7/8', '7//9' and '7/8/9' → (c, 3) int64, 0 where absent."""
    forms = {(word.count("/"), "//" in word) for word in words}
    columns = UNIFORM.get(next(iter(forms)), ()) if len(forms) == 1 else ()
    if columns:
        numbers = " ".join(words).replace("//", " ").replace("/", " ").split()
        if len(numbers) == len(words) * len(columns):
            table = np.zeros((len(words), 3), dtype=np.int64)
            table[:, columns] = np.array(list(map(int, numbers)), dtype=np.int64).reshape(-1, len(columns))
            return table
    flat = (index for word in words for index in (word + "//").split("/")[:3])
    return np.array([int(index or 0) for index in flat], dtype=np.int64).reshape(-1, 3)


def _fans(size: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Polygons as fans from their first corner: (f, 3) int64 corner numbers and (f,) int64 polygon of each triangle."""
    count = size - 2
    polygon = np.repeat(np.arange(len(size)), count)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(count) - count, count)
    start = (np.cumsum(size) - size)[polygon]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygon


def _split_vertices(
    corners: NDArray[np.int64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct (v, vt, vn) in that order: (n, 3) int64, and faces (f, 3) int64 into them."""
    order = np.lexsort((corners[:, 2], corners[:, 1], corners[:, 0]))
    new = np.concatenate([[True], (np.diff(corners[order], axis=0) != 0).any(axis=1)])
    vertex = np.zeros(len(corners), dtype=np.int64)
    vertex[order] = np.cumsum(new) - 1
    return corners[order][new], vertex[triangles]


def _uv(file_uv: NDArray[np.float64], index: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, 2) float64; a corner without uv gets (0, 0), a one-dimensional coordinate v = 0."""
    table = np.zeros((len(file_uv) + 1, 2))
    columns = min(file_uv.shape[1], 2)
    table[:-1, :columns] = file_uv[:, :columns]
    return table[index]


def _materials(
    lines: _Lines, polygon: NDArray[np.int64], read_sibling: Callable[[str], bytes | None]
) -> tuple[tuple[Material, ...], NDArray[np.int64] | None, dict[str, int]]:
    """Materials in the order of first use, the (f,) material of each triangle, and what was missing."""
    if not lines.text["usemtl"]:
        return (), None, {}
    known: dict[str, Material] = {}
    changes = {"missing_materials": 0, "missing_textures": 0}
    for name in lines.text["mtllib"]:
        found = read_sibling(name)
        changes["missing_materials"] += found is None
        if found is not None:
            library, missing = read_mtl(found, read_sibling)
            known.update(library)
            changes["missing_textures"] += missing
    names = ["default", *lines.text["usemtl"]]
    used = np.searchsorted(lines.number["usemtl"], lines.number["f"])[polygon]
    distinct = list(dict.fromkeys(names[index] for index in dict.fromkeys(used.tolist())))
    place = np.array([distinct.index(name) if name in distinct else -1 for name in names], dtype=np.int64)
    return tuple(known.get(name, Material(name=name)) for name in distinct), place[used], changes
