"""An Asset whose file has no normals gets some: facets, smoothing groups, or smooth up to a crease angle.

n file vertices · f faces.  A file vertex at which faces don't share a normal is split; uv, charts, and the surface
don't change by it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ...geometry.creases import fan_normals
from ...geometry.rows import equal_rows, first_places

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...mesh import Asset, Atlas

ALIKE = 2.0**-16
"""Step on which components of normals are compared: those of facets in one plane differ by rounding."""


def shaded(asset: Asset, crease_angle: float) -> Asset:
    """The asset with normals: its own where the file has them, else as its smoothing groups or the angle say.

    Args:
        asset: as it was read.
        crease_angle: degrees between two faces, above which the edge between them is sharp.
    """
    if asset.normals is not None:
        return asset
    place = None if asset.polygons is None else asset.polygons.corner
    normals = fan_normals(asset.surface, np.deg2rad(crease_angle), smoothing=asset.smoothing, place=place)
    return with_corner_normals(asset, normals)


def with_corner_normals(asset: Asset, normals: NDArray[np.float64]) -> Asset:
    """The asset with normals (f, 3, 3) of its corners; a file vertex is split where they differ.

    The first of its pieces stays in its place, the others go to the end.
    """
    vertex, rows = asset.faces.reshape(-1), normals.reshape(-1, 3)
    steps = np.rint(rows / ALIKE).astype(np.int64)
    corner = np.zeros(len(asset.positions), dtype=np.int64)
    corner[vertex] = np.arange(len(vertex))
    alike = (steps == steps[corner[vertex]]).all(axis=1)
    if alike.all():
        return replace(asset, normals=rows[corner])
    creased = np.zeros(len(corner), dtype=bool)
    creased[vertex[~alike]] = True
    several, piece = np.flatnonzero(creased[vertex]), vertex.copy()
    piece[several] = len(corner) + equal_rows(np.column_stack([vertex, steps])[several])
    first = first_places(piece)
    used = first < len(piece)
    piece, first = (np.cumsum(used) - 1)[piece], first[used]
    chosen = vertex[first]
    later = np.ones(len(first), dtype=np.bool_)
    later[np.unique(chosen, return_index=True)[1]] = False
    order = np.lexsort((first, chosen, later))
    number = np.zeros(len(order), dtype=np.int64)
    number[order] = np.arange(len(order))
    source = chosen[order]
    return replace(
        asset,
        positions=asset.positions[source],
        faces=number[piece].reshape(-1, 3),
        weld=asset.weld[source],
        normals=rows[first[order]],
        unsplit=source,
        colors=None if asset.colors is None else asset.colors[source],
        uv=None if asset.uv is None else asset.uv[source],
        origin=None if asset.origin is None else asset.origin[source],
    )


def with_file_vertices(atlas: Atlas, asset: Asset) -> Atlas:
    """The atlas with source_vertex into the vertices as the file has them, which are the first of a whole asset's."""
    return atlas if asset.unsplit is None else replace(atlas, source_vertex=asset.unsplit[atlas.source_vertex])
