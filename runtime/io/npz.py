"""Atlas → .npz for programs.

positions (n, 3) float64 · faces (f, 3) int64 · uv (n, 2) float32 v up · charts (f,) int64 · normals (n, 3) float32 ·
source_vertex (n,) int64, of the vertices as the file has them · polygons (f,) int64, which of the file's polygons each
triangle is of.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .shading import with_file_vertices

if TYPE_CHECKING:
    from pathlib import Path

    from ..mesh import Asset, Atlas


def write_npz(atlas: Atlas, asset: Asset, path: Path) -> None:
    """Write the arrays named above; numpy.load reads them without pickle."""
    polygons = np.arange(len(atlas.faces))
    if asset.polygons is not None and len(asset.polygons.corner) == len(atlas.faces):
        polygons = asset.polygons.of_faces
    np.savez(
        path,
        positions=atlas.positions,
        faces=atlas.faces,
        uv=atlas.uv,
        charts=atlas.face_chart,
        normals=atlas.normals,
        source_vertex=with_file_vertices(atlas, asset).source_vertex,
        polygons=polygons,
    )
