"""uv beyond the unit square, where a texture repeats: faces are drawn where they lie in it after whole steps.

f faces.  A face that no whole steps bring into the square (it spans several repeats) is not drawn.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..runtime.geometry.layout import EDGE
from ..runtime.pack.exact.seamvertices import split_vertices

if TYPE_CHECKING:
    from ..runtime.mesh import Atlas


def into_square(atlas: Atlas) -> tuple[Atlas, int]:
    """The atlas with all faces in the unit square, and how many are not drawn: they lie in one point.

    The very atlas where all lie in the square already.
    """
    uv = atlas.corner_uv
    if uv.min(initial=0.0) >= -EDGE and uv.max(initial=1.0) <= 1.0 + EDGE:
        return replace(atlas, uv=np.clip(atlas.uv, 0.0, 1.0)), 0
    step = np.floor(uv.min(axis=1) + EDGE)
    moved = uv - step[:, None]
    fits = (moved <= 1.0 + EDGE).all(axis=(1, 2))
    moved = np.where(fits[:, None, None], np.clip(moved, 0.0, 1.0), 0.0)
    faces, source, new_uv = split_vertices(atlas.faces, atlas.face_chart, moved)
    found = replace(
        atlas,
        positions=atlas.positions[source],
        faces=faces,
        uv=new_uv.astype(np.float32),
        normals=atlas.normals[source],
        source_vertex=atlas.source_vertex[source],
    )
    return found, int(np.count_nonzero(~fits))
