"""Atlas or point cloud with uv → binary PLY.

n vertices or points · f faces.  uv is v up; positions are float64 in source units and read back exactly.  The names s
and t are those that Blender and MeshLab take for uv.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..pictures.colors import source_colors
from ..points.cloud import check_uv

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...mesh import Atlas
    from ..loops import Loops
    from ..points.cloud import PointCloud

    Column = tuple[str, str, NDArray[Any]]

WORDS = {"<f8": "double", "<f4": "float", "<i4": "int", "u1": "uchar"}


def write_ply(
    atlas: Atlas,
    path: Path,
    *,
    colors: NDArray[np.uint8] | None = None,
    loops: Loops | None = None,
    texture: str | None = None,
) -> None:
    """Write binary little-endian PLY: double x y z, float nx ny nz s t, and with colours uchar red green blue alpha.

    PLY has one uv per vertex, so vertices are split along seams.

    Args:
        atlas: what to write.
        path: the .ply file.
        colors: (source vertices, 4) uint8, those of the Asset that the atlas came from, or None.
        loops: the polygons to write; None writes the triangles.
        texture: name of the picture with the base colour, beside the file, in the comment that MeshLab reads; a name
            that would break the line is left out.

    Raises:
        ShapeError: colours of another shape or dtype, or too few of them.
    """
    columns = [
        *_columns("x y z", "<f8", atlas.positions),
        *_columns("nx ny nz", "<f4", atlas.normals),
        *_columns("s t", "<f4", atlas.uv),
    ]
    if colors is not None:
        columns += _columns("red green blue alpha", "u1", source_colors(atlas, colors))
    size = np.full(len(atlas.faces), 3) if loops is None else loops.size
    corner = atlas.faces.reshape(-1) if loops is None else loops.vertex
    kind = "uchar" if int(size.max()) < 256 else "int"
    named = [f"comment TextureFile {texture}"] if texture is not None and texture.isprintable() else []
    head = _ply(columns, [*named, f"element face {len(size)}", f"property list {kind} int vertex_indices"])
    path.write_bytes(head + _lists(size, corner, 1 if kind == "uchar" else 4))


def _lists(size: NDArray[np.int64], corner: NDArray[np.int64], width: int) -> bytes:
    """Each list's length, in width bytes, and its numbers (int), one after the other."""
    start = np.cumsum(width + 4 * size) - (width + 4 * size)
    data = np.zeros(int((width + 4 * size).sum()), dtype=np.uint8)
    data[start[:, None] + np.arange(width)] = size.astype("<i4").view(np.uint8).reshape(-1, 4)[:, :width]
    step = np.arange(len(corner)) - np.repeat(np.cumsum(size) - size, size)
    place = np.repeat(start + width, size) + 4 * step
    data[place[:, None] + np.arange(4)] = corner.astype("<i4").view(np.uint8).reshape(-1, 4)
    return data.tobytes()


def write_cloud_ply(path: Path, cloud: PointCloud, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> None:
    """Write binary little-endian PLY without faces.

    double x y z [, float nx ny nz], float s t, int chart [, uchar red green blue alpha]; normals and colours are
    written where the cloud has them.

    Args:
        path: the .ply file.
        cloud: n points.
        uv: (n, 2) float32.
        chart: (n,) int64, below 2³¹.

    Raises:
        ShapeError: uv or chart don't fit the cloud.
    """
    check_uv(cloud, uv, chart)
    columns = _columns("x y z", "<f8", cloud.points)
    if cloud.normals is not None:
        columns += _columns("nx ny nz", "<f4", cloud.normals)
    columns += [*_columns("s t", "<f4", uv), ("chart", "<i4", chart)]
    if cloud.colors is not None:
        columns += _columns("red green blue alpha", "u1", cloud.colors)
    path.write_bytes(_ply(columns, []))


def _columns(names: str, kind: str, values: NDArray[Any]) -> list[Column]:
    """(name, numpy type, values) of each column of a table."""
    return [(name, kind, column) for name, column in zip(names.split(), values.T, strict=True)]


def _ply(columns: list[Column], more: list[str]) -> bytes:
    """The header, with more lines for what follows the vertices, and the vertices."""
    table = np.zeros(len(columns[0][2]), dtype=[(name, kind) for name, kind, _ in columns])
    for name, _, values in columns:
        table[name] = values
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment flexpara: s t are the atlas uv, v up",
        f"element vertex {len(table)}",
        *(f"property {WORDS[kind]} {name}" for name, kind, _ in columns),
        *more,
        "end_header",
    ]
    return ("\n".join(header) + "\n").encode() + table.tobytes()
