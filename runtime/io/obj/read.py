"""Wavefront OBJ → RawMesh, in the file's own order.

trimesh groups faces by material, reorders what a quad becomes and reads relative indices from the end of the file; here
face i of the file is face i of the mesh, and vertices are split only where uv or normals differ.  v, vt, vn: positions,
uv (v up), normals of the file; c corners of all polygons.  Indices in the file count from 1, or back from the last
element so far when negative; 0 means "absent" until they are resolved.  What other programs read is read: vertices of
two numbers lie at z = 0, faces of under three corners are skipped, references to uv and normals that are not there
count as absent.  Each of these is counted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ...errors import MeshError
from ...material import Material
from ...mesh import Polygons
from ..polygons import triangulate
from ..rawmesh import RawMesh
from ..text import lines_of, shown
from .lines import split
from .materials import read_mtl
from .text import ObjText

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from .lines import Lines

COLOR_COLUMNS = {6: 3, 7: 4}  # x y z r g b, and x y z w r g b: numbers in a line → first colour
OFF = ("off", "0")
# (slashes, two in a row) of every corner of a file → which of v, vt, vn its numbers are
UNIFORM = {(0, False): (0,), (1, False): (0, 1), (2, True): (0, 2), (2, False): (0, 1, 2)}


@dataclass(frozen=True, eq=False)
class _Polygons:
    """corners: (c, 3) int64 indices from 0 of (v, vt, vn), −1 where absent.  size: (p,) corners of each, ≥ 3.

    number: (p,) line number of each.
    """

    corners: NDArray[np.int64]
    size: NDArray[np.int64]
    number: NDArray[np.int64]


def read_obj(data: bytes, read_sibling: Callable[[str], bytes | None]) -> RawMesh:
    """Read an OBJ file.

    Args:
        data: the bytes of the file.
        read_sibling: name of a file beside it → its bytes, or None where there is none.

    Raises:
        MeshError: unreadable numbers, vertices that are not there or not finite, no faces; it names the line.
    """
    lines = split(data)
    changes: dict[str, int] = {}
    positions, colors = _vertices(lines, changes)
    polygons = _polygons(lines, changes)
    _check_positions(positions, lines, polygons)
    triangles, polygon = triangulate(positions, polygons.corners[:, 0], polygons.size)
    corners = polygons.corners
    file_uv, uv_width = lines.numbers("vt", 1, 2)
    file_normals, _ = lines.numbers("vn", 3, 3)
    vertex, faces = _split_vertices(corners, triangles)
    materials, face_material = _materials(lines, polygons.number[polygon], read_sibling, changes)
    has_uv, has_normals = bool((corners[:, 1] >= 0).any()), bool((corners[:, 2] >= 0).all())
    if has_uv:
        changes["faces_without_uv"] = int(np.count_nonzero((corners[triangles, 1] < 0).any(axis=1)))
    return RawMesh(
        positions=positions[vertex[:, 0]],
        faces=faces,
        normals=file_normals[vertex[:, 2]] if has_normals else None,
        colors=None if colors is None else colors[vertex[:, 0]],
        uv=_uv(file_uv, uv_width, vertex[:, 1]) if has_uv else None,
        materials=materials,
        face_material=face_material,
        changes=changes,
        polygons=Polygons(triangles, polygons.size),
        smoothing=_smoothing(lines, polygons.number[polygon]),
        obj=ObjText(data, polygons.number, corners, polygons.size, _library_text(lines, read_sibling)),
    )


def _vertices(lines: Lines, changes: dict[str, int]) -> tuple[NDArray[np.float64], NDArray[np.uint8] | None]:
    """(n, 3) float64 positions, and (n, 4) uint8 colours where the lines have them; changes grow."""
    numbers, width = lines.numbers("v", 2, 8)
    if numbers.shape[1] < 3:
        numbers = np.column_stack([numbers, np.zeros(len(numbers))])
    numbers[width < 3, 2] = 0.0
    changes["vertices_without_z"] = int(np.count_nonzero(width < 3))
    first = COLOR_COLUMNS.get(numbers.shape[1])
    if first is None:
        return numbers[:, :3], None
    plain = width < numbers.shape[1]
    changes["vertices_without_colors"] = int(np.count_nonzero(plain))
    rgb = np.nan_to_num(numbers[:, first : first + 3])
    rgb = np.clip(rgb, 0.0, 255.0) if rgb.max(initial=0.0) > 1.0 else np.clip(rgb, 0.0, 1.0) * 255.0
    rgb[plain] = 255.0
    alpha = np.full((len(rgb), 1), 255.0)
    return numbers[:, :3], np.rint(np.hstack([rgb, alpha])).astype(np.uint8)


def _polygons(lines: Lines, changes: dict[str, int]) -> _Polygons:
    """The faces of three corners or more, every index resolved; changes grow."""
    changes["faces_under_three_corners"] = 0
    if lines.faces is None:
        table, size, number = _corners(lines, changes)
    else:
        (table, size), number = lines.faces, lines.number["f"]
    at_line = np.repeat(number, size)
    changes["missing_uv_or_normals"] = 0
    for column, kind in enumerate(("v", "vt", "vn")):
        count, index = lines.count(kind), table[:, column]
        so_far = np.searchsorted(lines.number[kind], at_line) if index.min() < 0 else np.zeros_like(index)
        resolved = np.where(index > 0, index - 1, np.where(index < 0, so_far + index, -1))
        outside = (resolved >= count) | ((resolved < 0) & ((index != 0) | (column == 0)))
        if column == 0 and outside.any():
            first = int(np.argmax(outside))
            before = int(np.searchsorted(lines.number[kind], at_line[first]))
            raise MeshError(
                f"line {at_line[first]} refers to vertex {index[first]}, expected 1 to {count} or −{before} to "
                "−1; the OBJ file is damaged: export it again"
            )
        changes["missing_uv_or_normals"] += int(np.count_nonzero(outside))
        table[:, column] = np.where(outside, -1, resolved)
    return _Polygons(table, size, number)


def _corners(lines: Lines, changes: dict[str, int]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Corners (c, 3) as the file counts, how many each face has (p,), and the line of each (p,); changes grow."""
    words = [line.split() for line in lines.text["f"]]
    whole = [index for index, polygon in enumerate(words) if len(polygon) >= 3]
    changes["faces_under_three_corners"] = len(words) - len(whole)
    if not whole:
        raise MeshError(
            f"all {len(words)} faces have under three corners (first: line {lines.number['f'][0]}), expected "
            "triangles or polygons; export the mesh again"
        )
    number = lines.number["f"][whole]
    size = np.array([len(words[index]) for index in whole], dtype=np.int64)
    flat = [word for index in whole for word in words[index]]
    try:
        return _index_table(flat), size, number
    except (ValueError, OverflowError) as error:
        place = next(index for index, word in enumerate(flat) if not _is_corner(word))
        raise MeshError(
            f"line {np.repeat(number, size)[place]} has the corner {shown(flat[place])}, expected indices such as 7, "
            "7/8 or 7/8/9; mend or remove that line"
        ) from error


def _is_corner(word: str) -> bool:
    return all((part.lstrip("+-").isdecimal() and len(part) < 19) or not part for part in word.split("/")[:3])


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


def _check_positions(positions: NDArray[np.float64], lines: Lines, polygons: _Polygons) -> None:
    """Refuse vertices of faces that are not finite, by their line."""
    broken = ~np.isfinite(positions[polygons.corners[:, 0]]).all(axis=1)
    if broken.any():
        vertex = int(polygons.corners[np.argmax(broken), 0])
        raise MeshError(
            f"vertex {vertex + 1} (line {lines.number['v'][vertex]}) has NaN or infinite coordinates and belongs to a "
            "face, expected finite numbers; delete or repair it"
        )


def _split_vertices(
    corners: NDArray[np.int64], triangles: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The distinct (v, vt, vn) in that order: (n, 3) int64, and faces (f, 3) int64 into them."""
    order = np.lexsort((corners[:, 2], corners[:, 1], corners[:, 0]))
    new = np.concatenate([[True], (np.diff(corners[order], axis=0) != 0).any(axis=1)])
    vertex = np.zeros(len(corners), dtype=np.int64)
    vertex[order] = np.cumsum(new) - 1
    return corners[order][new], vertex[triangles]


def _uv(file_uv: NDArray[np.float64], width: NDArray[np.int64], index: NDArray[np.int64]) -> NDArray[np.float64]:
    """(n, 2) float64; a corner without uv gets (0, 0), a one-dimensional coordinate v = 0."""
    table = np.zeros((len(file_uv) + 1, 2))
    columns = file_uv.shape[1]
    table[:-1, :columns] = file_uv
    if columns == 2:
        table[:-1, 1][width < 2] = 0.0
    return table[index]


def _smoothing(lines: Lines, at_line: NDArray[np.int64]) -> NDArray[np.int64] | None:
    """(f,) smoothing group of each triangle, by its line: 0 is off; None where the file has no such line."""
    if not lines.text["s"]:
        return None
    words = [OFF[0], *(text.strip().lower() or OFF[0] for text in lines.text["s"])]
    groups = (word for word in dict.fromkeys(words) if word not in OFF)
    place = {word: index for index, word in enumerate(groups, start=1)}
    number = np.array([place.get(word, 0) for word in words], dtype=np.int64)
    return number[np.searchsorted(lines.number["s"], at_line)]


def _libraries(lines: Lines, read_sibling: Callable[[str], bytes | None]) -> list[str]:
    """Names of material libraries: a line is one name with spaces in it where such a file is there, else several."""
    names: list[str] = []
    for line in lines.text["mtllib"]:
        names += [line] if read_sibling(line) is not None else line.split()
    return list(dict.fromkeys(names))


def _library_text(lines: Lines, read_sibling: Callable[[str], bytes | None]) -> str:
    """The lines of all material libraries that are there."""
    found = [data for name in _libraries(lines, read_sibling) if (data := read_sibling(name)) is not None]
    return "\n".join("\n".join(lines_of(data)) for data in found)


def _materials(
    lines: Lines,
    at_line: NDArray[np.int64],
    read_sibling: Callable[[str], bytes | None],
    changes: dict[str, int],
) -> tuple[tuple[Material, ...], NDArray[np.int64] | None]:
    """Materials in the order of first use and the (f,) material of each triangle, by its line; changes grow."""
    if not lines.text["usemtl"]:
        return (), None
    known: dict[str, Material] = {}
    for name in _libraries(lines, read_sibling):
        found = read_sibling(name)
        changes["missing_materials"] = changes.get("missing_materials", 0) + (found is None)
        if found is not None:
            library, counts = read_mtl(found, read_sibling)
            known.update(library)
            changes.update({kind: changes.get(kind, 0) + count for kind, count in counts.items()})
    names = ["default", *lines.text["usemtl"]]
    used = np.searchsorted(lines.number["usemtl"], at_line)
    distinct = list(dict.fromkeys(names[index] for index in dict.fromkeys(used.tolist())))
    number = {name: index for index, name in enumerate(distinct)}
    place = np.array([number.get(name, -1) for name in names], dtype=np.int64)
    return tuple(known.get(name, Material(name=name)) for name in distinct), place[used]
