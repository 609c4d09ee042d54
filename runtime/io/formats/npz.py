"""Atlas → .npz for programs.

positions (n, 3) float64 · faces (f, 3) int64 · uv (n, 2) float32 v up · charts (f,) int64 · normals (n, 3) float32 ·
source_vertex (n,) int64, of the vertices as the file has them · polygons (f,) int64, which of the file's polygons each
triangle is of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING
from zipfile import BadZipFile, ZipFile

import numpy as np

from ...geometry.metrics import face_distortion, uv_charts
from ..asset.shading import with_file_vertices

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...mesh import Asset, Atlas


def write_npz(atlas: Atlas, asset: Asset, path: Path) -> None:
    """Write the arrays named above; numpy.load reads them without pickle."""
    np.savez(
        path,
        positions=atlas.positions,
        faces=atlas.faces,
        uv=atlas.uv,
        charts=atlas.face_chart,
        normals=atlas.normals,
        source_vertex=with_file_vertices(atlas, asset).source_vertex,
        polygons=polygons_of(asset),
    )


def is_faces(path: Path) -> bool:
    """Whether `write_faces` wrote a file: its arrays have these names, and there is no other."""
    return array_names(path) == {"charts", "distortion", "polygons"}


def array_names(path: Path) -> set[str]:
    """Names of the arrays of an .npz file, none of a file that is no such; nothing of them is read."""
    try:
        with ZipFile(path) as archive:
            return {name.removesuffix(".npy") for name in archive.namelist()}
    except (BadZipFile, OSError):
        return set()


def write_faces(path: Path, asset: Asset) -> None:
    """Write charts (f,) int64, distortion (f,) float64 and polygons (f,) int64 of a mesh with uv.

    Raises: InputError as `metrics.measure`.
    """
    assert asset.uv is not None
    corner_uv = asset.uv[asset.faces]
    chart, _ = uv_charts(asset.surface.faces, corner_uv)
    np.savez(path, charts=chart, distortion=face_distortion(asset.surface, corner_uv), polygons=polygons_of(asset))


def polygons_of(asset: Asset) -> NDArray[np.int64]:
    """(f,) int64: which of the file's polygons each triangle is of; its own number in a format of triangles."""
    if asset.polygons is not None and len(asset.polygons.corner) == len(asset.faces):
        return asset.polygons.of_faces
    return np.arange(len(asset.faces))
