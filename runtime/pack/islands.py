"""The islands of uv that a mesh has, as charts: their shapes stay, only their size and place are open.

f faces · k islands.  uv is v up.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError
from ..geometry.metrics import uv_charts
from ..geometry.triangles import signed_areas
from ..mesh import Charts

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Asset
    from .config import IslandConfig

KEPT = "island"
"""Method of a chart whose shape is another's."""


class Islands(NamedTuple):
    """Islands that can be packed.

    faces: (g,) int64 faces in islands that have an area.  charts: of these faces.  flat: how many islands have none.
    """

    faces: NDArray[np.int64]
    charts: Charts
    flat: int


def islands_of(asset: Asset, *, equal: bool, config: IslandConfig) -> Islands:
    """The islands of the uv that a mesh carries, in source units.

    Args:
        asset: with uv.
        equal: whether each gets the size of its surface; otherwise they keep their sizes beside each other.
        config: numbers.

    Raises:
        InputError: there are no uv, they are not finite, or no island has an area.
    """
    if asset.uv is None:
        raise InputError(f"{asset.stem} carries no uv coordinates; unwrap it first: flexpara unwrap MESH -o OUT")
    corner_uv = asset.uv[asset.faces]
    if not np.isfinite(corner_uv).all():
        raise InputError(f"{asset.stem} has uv that are not finite, expected numbers; unwrap it anew")
    island, _ = uv_charts(asset.surface.faces, corner_uv)
    surface = np.bincount(island, asset.surface.face_areas())
    flat = np.bincount(island, np.abs(signed_areas(corner_uv)))
    solid = flat > config.flat * np.bincount(island) * flat.sum() / len(corner_uv)
    if not solid.any():
        raise InputError(f"the uv of {asset.stem} have no area, expected islands to pack; unwrap it first")
    scale = np.sqrt(surface[solid].sum() / flat[solid].sum())
    scales = np.sqrt(surface / np.where(solid, flat, 1.0)) if equal else np.full(len(solid), scale)
    faces = np.flatnonzero(solid[island])
    chart = (np.cumsum(solid) - 1)[island[faces]]
    k = int(solid.sum())
    shapes = corner_uv[faces] * scales[island[faces], None, None]
    charts = Charts(chart, shapes, chart, np.arange(k), (KEPT,) * k)
    return Islands(faces, charts, int(np.count_nonzero(~solid)))
