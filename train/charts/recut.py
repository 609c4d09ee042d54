"""Charts that float32 could not hold, cut again: the faces that fail the exact test become charts of their own.

Packing proves every chart on the numbers that are written.  Where a triangle lies upside down there or over another (a
sliver whose neighbours left it no room), it is taken out of its chart and laid flat by itself.  A chart whose triangles
are mostly that small (a screw on a ship) is drawn larger instead.   f faces · k charts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from ...runtime.geometry.topology import edge_table, face_components
from ...runtime.mesh import Charts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Surface

MOST = 1e6
"""Times that a chart of no size is drawn larger."""


def drawn_again(
    surface: Surface, charts: Charts, invalid: NDArray[np.int64], written: NDArray[np.float64], least: float
) -> tuple[Charts, str]:
    """Charts for the packer to try next, and what is said of them: the invalid ones `enlarged`, else `recut`."""
    larger, which = enlarged(charts, invalid, written, least)
    if len(which):
        return larger, f"{len(which)} charts are drawn larger: at the size of the others float32 merges their points"
    cut = recut(surface, charts, invalid, written)
    return cut, f"{len(invalid)} charts lost triangles too thin for the numbers of a file: each is its own chart now"


def recut(surface: Surface, charts: Charts, invalid: NDArray[np.int64], written: NDArray[np.float64]) -> Charts:
    """The charts without the faces that make some of them invalid; those faces as charts of method "triangle".

    Args:
        surface: the mesh.
        charts: of its faces.
        invalid: (i,) numbers of the charts that failed.
        written: (f, 3, 2) uv of the corners in the atlas, as written.
    """
    wrong = np.zeros(len(surface.faces), dtype=bool)
    for chart in invalid.tolist():
        ids = np.flatnonzero(charts.face_chart == chart)
        uv = written[ids]
        flipped = flipped_triangles(uv)
        pairs = overlapping_pairs(uv[~flipped])
        wrong[ids[flipped]] = True
        wrong[ids[np.flatnonzero(~flipped)[smaller_of_each(uv[~flipped], pairs)]]] = True
    corner_uv = charts.corner_uv.copy()
    corner_uv[wrong] = laid_flat(surface.triangles[wrong])
    face_chart = renumbered(surface, charts, corner_uv, wrong)
    first = np.unique(face_chart, return_index=True)[1]
    methods = tuple("triangle" if wrong[face] else charts.method[charts.face_chart[face]] for face in first.tolist())
    return Charts(face_chart, corner_uv, face_chart, np.arange(len(methods)), methods)


def enlarged(
    charts: Charts, invalid: NDArray[np.int64], written: NDArray[np.float64], least: float
) -> tuple[Charts, NDArray[np.int64]]:
    """The charts, those of the invalid ones larger whose triangles are too small for the numbers of a file.

    Args:
        charts: of the mesh's faces.
        invalid: (i,) numbers of the charts that failed.
        written: (f, 3, 2) uv of the corners in the atlas, as written.
        least: median length of a chart's edges in the atlas below which it is drawn larger, up to that length.

    Returns:
        The charts, and (j,) which of the invalid ones were drawn larger.
    """
    factor = np.ones(len(charts.method))
    for chart in invalid.tolist():
        uv = written[charts.face_chart == chart]
        edges = np.linalg.norm(uv - np.roll(uv, -1, axis=1), axis=2)
        factor[chart] = max(least / max(float(np.median(edges)), least / MOST), 1.0)
    uv = charts.corner_uv * factor[charts.face_chart, None, None]
    return replace(charts, corner_uv=uv), np.flatnonzero(factor > 1.0)


def smaller_of_each(uv: NDArray[np.float64], pairs: NDArray[np.int64]) -> NDArray[np.int64]:
    """Rows of the smaller triangle of each overlapping pair (p, 2) of uv (m, 3, 2), each once."""
    extent = np.ptp(uv, axis=1).max(axis=1)
    first, second = pairs.T
    return np.unique(np.where(extent[first] <= extent[second], first, second))


def laid_flat(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """(n, 3, 2) uv of triangles (n, 3, 3), each by itself: its first edge along u."""
    along = triangles[:, 1] - triangles[:, 0]
    other = triangles[:, 2] - triangles[:, 0]
    length = np.maximum(np.linalg.norm(along, axis=1), 1e-300)
    uv = np.zeros((len(triangles), 3, 2))
    uv[:, 1, 0] = length
    uv[:, 2, 0] = np.einsum("nc,nc->n", along, other) / length
    uv[:, 2, 1] = np.linalg.norm(np.cross(along, other), axis=1) / length
    return uv


def renumbered(
    surface: Surface, charts: Charts, corner_uv: NDArray[np.float64], wrong: NDArray[np.bool_]
) -> NDArray[np.int64]:
    """(f,) chart numbers, by the lowest face: what is left of a chart is one chart for each connected piece of it."""
    table = edge_table(surface.faces)
    half = table.edge_halfedges[table.manifold]
    face, corner = half // 3, half % 3
    same = charts.face_chart[face[:, 0]] == charts.face_chart[face[:, 1]]
    start, end = corner_uv[face, corner], corner_uv[face, (corner + 1) % 3]
    joined = same & (start[:, 0] == end[:, 1]).all(axis=1) & (end[:, 0] == start[:, 1]).all(axis=1)
    joined &= ~wrong[face].any(axis=1)
    return face_components(len(surface.faces), face[joined])
