"""Meshes of `flexpara.xatlas` as they are handed over, and as they are handed back.   n vertices · f faces."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...runtime.geometry.rows import by_first_appearance, equal_rows, first_of_each

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Charts

NOWHERE = 2**32 - 1
"""Chart of a vertex that is in none."""


class Part(NamedTuple):
    """A mesh as handed over: the number of its vertices, its faces (f, 3), and what can be charted of it.

    asset: its origin and face_material are the vertex (of n) and the face (of f) that each of its own is, or None.
    pace: how many times as long as foreseen it took to clean.
    """

    vertices: int
    faces: NDArray[np.int64]
    asset: Asset | None
    charts: Charts | None
    pace: float = 1.0


class Placed(NamedTuple):
    """A mesh of a page: mapping (m,), faces (f, 3), uv (m, 2) in [0, 1]²; chart of faces (f,), −1 for none."""

    mapping: NDArray[np.uint32]
    faces: NDArray[np.uint32]
    uv: NDArray[np.float32]
    face_chart: NDArray[np.int64]

    def vertex_chart(self) -> NDArray[np.uint32]:
        """(m,) the chart of each vertex, NOWHERE for none."""
        chart = np.full(len(self.mapping), -1, dtype=np.int64)
        np.maximum.at(chart, self.faces.reshape(-1), np.repeat(self.face_chart, 3))
        return np.where(chart < 0, NOWHERE, chart).astype(np.uint32)


def handed_back(part: Part, corner_uv: NDArray[np.float64], chart: NDArray[np.int64]) -> Placed:
    """The mesh as it was handed over, its vertices doubled along seams; corner_uv (m, 3, 2) of the faces charted."""
    uv, face_chart = np.zeros((len(part.faces), 3, 2)), np.full(len(part.faces), -1)
    if len(part.faces) == 0:
        return Placed(np.zeros(0, np.uint32), np.zeros((0, 3), np.uint32), np.zeros((0, 2), np.float32), face_chart)
    if part.asset is not None and part.asset.face_material is not None and part.asset.origin is not None:
        kept, corner = part.asset.face_material, part.asset.origin[part.asset.faces]
        turned = corner[:, 1] != part.faces[kept, 1]
        uv[kept] = np.where(turned[:, None, None], corner_uv[:, [0, 2, 1]], corner_uv)
        face_chart[kept] = chart
        left_out = np.flatnonzero(face_chart < 0)
        uv[left_out] = _points(part, uv, kept, left_out)[:, None]
    bits = uv.astype(np.float32).view(np.int32).reshape(-1, 2).astype(np.int64)
    label = by_first_appearance(equal_rows(np.column_stack([part.faces.reshape(-1), bits])))
    first = first_of_each(label)
    return Placed(
        part.faces.reshape(-1)[first].astype(np.uint32),
        label.reshape(-1, 3).astype(np.uint32),
        uv.reshape(-1, 2)[first].astype(np.float32),
        face_chart,
    )


def _points(
    part: Part, uv: NDArray[np.float64], kept: NDArray[np.int64], left_out: NDArray[np.int64]
) -> NDArray[np.float64]:
    """(d, 2) where each face that is no triangle lies: at one of its vertices, (0, 0) where none is charted."""
    place, known = np.zeros((part.vertices, 2)), np.zeros(part.vertices, dtype=np.bool_)
    place[part.faces[kept]] = uv[kept]
    known[part.faces[kept]] = True
    corners = part.faces[left_out]
    chosen = corners[np.arange(len(corners)), np.argmax(known[corners], axis=1)]
    return place[chosen]
