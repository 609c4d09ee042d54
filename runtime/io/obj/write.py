"""Atlas → OBJ.  Faces keep their order and corners; positions are written so that they read back exactly.

n atlas vertices · f faces.  uv is v up.
"""

from __future__ import annotations

from itertools import accumulate
from typing import TYPE_CHECKING

import numpy as np

from ...errors import InputError
from ...geometry.rows import by_first_appearance, equal_rows, first_of_each
from ..pictures.colors import source_colors
from .named import Named, plain_names

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...mesh import Atlas
    from ..loops import Loops


def write_obj(
    atlas: Atlas,
    path: Path,
    *,
    texture: str | None = None,
    colors: NDArray[np.uint8] | None = None,
    loops: Loops | None = None,
    names: Named | None = None,
) -> None:
    """Write Wavefront OBJ, and `<stem>.mtl` beside it when there is a texture or names have materials.

    One `v` per distinct position and one `vt` per atlas vertex, so that seams split uv and nothing else.  Positions
    stand in the order of the source file.  Numbers have the fewest digits that read back as the same float64.

    Args:
        atlas: what to write.
        path: the .obj file.
        texture: name of the picture with the base colour, beside the OBJ file.
        colors: (source vertices, 4) uint8, those of the Asset that the atlas came from, or None: written behind the
            positions as red green blue in [0, 1] (a widespread extension; where vertices share a position, the first).
        loops: the polygons to write; None writes the triangles.
        names: what stands between them; None is one material for the texture.

    Raises:
        InputError: the name of the texture or of the file would break the lines of the format.
        ShapeError: colours of another shape or dtype, or too few of them.
    """
    library = path.with_suffix(".mtl")
    for name in (library.name, texture or ""):
        if not name.isprintable() and name:
            raise InputError(f"{name!r} can't be written into an OBJ file, expected a printable name; rename it")
    first, vertex = _distinct_positions(atlas)
    columns = [atlas.positions[first]]
    if colors is not None:
        columns.append(source_colors(atlas, colors)[first, :3] / 255.0)
    normal = equal_rows(atlas.normals.astype(np.float64))
    normals = atlas.normals[first_of_each(normal)].astype(np.float64)
    names = names or plain_names(texture)
    head = ["# flexpara: uv are v up", *([f"mtllib {library.name}"] if names.library else [])]
    corner = atlas.faces.reshape(-1) if loops is None else loops.vertex
    words = [
        f"{v}/{vt}/{vn}" for v, vt, vn in (np.stack([vertex[corner], corner, normal[corner]], axis=1) + 1).tolist()
    ]
    size = [3] * len(atlas.faces) if loops is None else loops.size.tolist()
    end = list(accumulate(size))
    faces = (f"f {' '.join(words[last - own : last])}" for own, last in zip(size, end, strict=True))
    lines = [
        *head,
        *_rows("v", np.hstack(columns)),
        *_rows("vt", atlas.uv.astype(np.float64)),
        *_rows("vn", normals),
        *(line for number, face in enumerate(faces) for line in (*names.marks.get(number, ()), face)),
    ]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    if names.library:
        library.write_text("\n".join(names.library) + "\n", encoding="utf-8")


def _distinct_positions(atlas: Atlas) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """(m,) the first atlas vertex of each distinct position, and (n,) which of them each atlas vertex shares."""
    order = np.argsort(atlas.source_vertex, kind="stable")
    label = by_first_appearance(equal_rows(atlas.positions[order]))
    vertex = np.zeros(len(order), dtype=np.int64)
    vertex[order] = label
    return order[first_of_each(label)], vertex


def _rows(keyword: str, numbers: NDArray[np.float64]) -> list[str]:
    return [" ".join((keyword, *map(repr, row))) for row in numbers.tolist()]
