"""An OBJ file with new uv: its own lines, with other vt and other numbers of them in its faces.

Positions, normals, names, groups, smoothing, lines and points are the very lines of the file; where it has no normals,
those of the atlas come in.  Its material libraries become one beside it, in which baked pictures take the place of
those on the old uv.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...geometry.rows import by_first_appearance, equal_rows, first_of_each
from ..loops import loops_of
from .text import PICTURES, is_picture, keyword

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping
    from pathlib import Path

    from numpy.typing import NDArray

    from ...mesh import Asset, Atlas
    from ..loops import Loops
    from .text import ObjText

MADE_UP = "atlas"
"""Name of a material for a file that has none."""


def rewrite_obj(atlas: Atlas, asset: Asset, text: ObjText, path: Path, pictures: Mapping[str, str]) -> Loops:
    """Write the file again, and `<stem>.mtl` beside it where it has materials or pictures.

    Args:
        atlas: the new uv.
        asset: what was read of the file.
        text: the file.
        path: the .obj file.
        pictures: map → name of its file beside the OBJ file.

    Returns: the polygons as they were written.
    """
    loops, library = loops_of(atlas, asset), path.with_suffix(".mtl")
    shown = {PICTURES[name]: file for name, file in pictures.items() if name in PICTURES}
    named = {number: keyword(statement) for number, statement in text.statements.items()}
    has_materials = bool(text.materials) or bool(shown)
    head = ["# flexpara: uv are v up", *([f"mtllib {library.name}"] if has_materials else [])]
    if shown and "usemtl" not in named.values():
        head.append(f"usemtl {MADE_UP}")
    uv, of_uv = _uv(atlas, loops)
    normals, of_normal = ([], text.corners[loops.corner, 2] + 1) if "vn" in named.values() else _normals(atlas, loops)
    numbers = np.column_stack([text.corners[loops.corner, 0] + 1, of_uv, of_normal])
    body = _statements(text, named, _faces(text, loops, numbers), [*uv, *normals])
    path.write_text("\n".join([*head, *body]).rstrip("\n") + "\n", encoding="utf-8")
    if has_materials:
        used = [text.statements[line].partition(" ")[2].strip() for line, kind in named.items() if kind == "usemtl"]
        lines = list(_material_lines(text.materials, used or [MADE_UP], shown))
        library.write_text("\n".join(lines).rstrip("\n") + "\n", encoding="utf-8")
    return loops


def _uv(atlas: Atlas, loops: Loops) -> tuple[list[str], NDArray[np.int64]]:
    """A vt for each uv of a polygon, in the order of atlas vertices, and the number from 1 of that of each corner."""
    used, place = np.unique(loops.vertex, return_inverse=True)
    rows = atlas.uv[used].astype(np.float64)
    label = by_first_appearance(equal_rows(rows))
    return [f"vt {u!r} {v!r}" for u, v in rows[first_of_each(label)].tolist()], label[place.reshape(-1)] + 1


def _normals(atlas: Atlas, loops: Loops) -> tuple[list[str], NDArray[np.int64]]:
    """A vn for each normal of the atlas, and the number from 1 of that of each corner."""
    rows = atlas.normals[loops.vertex].astype(np.float64)
    label = by_first_appearance(equal_rows(rows))
    return [f"vn {x!r} {y!r} {z!r}" for x, y, z in rows[first_of_each(label)].tolist()], label + 1


def _faces(text: ObjText, loops: Loops, numbers: NDArray[np.int64]) -> dict[int, list[str]]:
    """Line number → the lines of its polygon.  numbers: (c, 3) of v, vt and vn of each corner, 0 for none."""
    words = [f"{v}/{vt}/{vn}" if vn else f"{v}/{vt}" for v, vt, vn in numbers.tolist()]
    found, start = dict[int, list[str]](), 0
    for size, polygon in zip(loops.size.tolist(), loops.polygon.tolist(), strict=True):
        found.setdefault(int(text.line[polygon]), []).append("f " + " ".join(words[start : start + size]))
        start += size
    return found


def _statements(text: ObjText, kinds: dict[int, str], faces: dict[int, list[str]], uv: list[str]) -> Iterator[str]:
    """The statements of the new file: uv stand before the first polygon, old ones and names of libraries go.

    A polygon of which no triangle was unwrapped (it has no area, say, or two corners) is left out, as in every
    format: the report's changes count them.  Lines lose their uv.
    """
    waiting = uv
    for index, statement in text.statements.items():
        kind = kinds[index]
        if kind in ("vt", "mtllib") or (kind == "f" and index not in faces):
            continue
        if kind in ("f", "l"):
            yield from waiting
            waiting = []
        if index in faces:
            yield from faces[index]
        elif kind == "l":
            yield " ".join(word.split("/")[0] for word in statement.split())
        elif kind == "v" and len(statement.split()) == 3:
            yield f"{statement} 0"  # readers expect three numbers
        else:
            yield statement
    yield from waiting


def _material_lines(text: str, names: list[str], shown: Mapping[str, str]) -> Iterator[str]:
    """The library with the pictures shown (keyword → file) in each material; those it has on the old uv go."""
    known: set[str] = set()
    for line in text.split("\n") if text else []:
        kind = keyword(line)
        if kind == "newmtl":
            yield line
            known.add(line.split(maxsplit=1)[1].strip() if len(line.split()) > 1 else "")
            yield from (f"{word} {file}" for word, file in shown.items())
        elif is_picture(line):
            continue
        elif kind == "kd" and "map_Kd" in shown:
            yield "Kd 1 1 1"
        else:
            yield line
    for name in dict.fromkeys(name for name in names if name not in known):
        yield from (f"newmtl {name}", "Kd 1 1 1", *(f"{word} {file}" for word, file in shown.items()))
