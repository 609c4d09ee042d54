"""The islands that a mesh has, packed anew.   f faces · k islands."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .asked import faces_of, pack_asked
from .config import PackConfig
from .islands import islands_of
from .packing import Packed, atlas_from_uv, atlas_of_corners
from .pages import on_tiles, pack_pages

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Asset
    from .square import Square

FLAT = "flat_islands"
"""Among the changes: islands without area, left in one point."""
INVALID = "invalid_islands"
"""Islands in which triangles overlap or are turned over, as they did in the file."""


class Repacked(NamedTuple):
    """Islands in their new places.

    packed: as `Packed`, uv of each page in its UDIM tile.  page: (f,) that of each face.
    """

    packed: Packed
    page: NDArray[np.int64]


def repack_pages(
    asset: Asset, square: Square, count: int, *, equal: bool = True, seed: int = 0, config: PackConfig | None = None
) -> Repacked:
    """As `repack`, onto so many pages.  Raises: as that."""
    config = config or PackConfig()
    islands = islands_of(asset, equal=equal, config=config.islands)
    paged = pack_pages(faces_of(asset, islands.faces), islands.charts, square, count, seed, config)
    report = {**paged.report, "islands": len(islands.charts.method)}
    report["changes"] = {FLAT: islands.flat, INVALID: len(paged.invalid)}
    corner_uv, page = np.zeros((len(asset.faces), 3, 2), dtype=np.float32), np.zeros(len(asset.faces), np.int64)
    corner_uv[islands.faces], page[islands.faces] = on_tiles(paged), paged.page
    chart = np.full(len(asset.faces), len(islands.charts.method))
    chart[islands.faces] = islands.charts.face_chart
    like = replace(atlas_from_uv(asset), size=square.size, padding=paged.report["padding"])
    return Repacked(Packed(atlas_of_corners(asset, chart, corner_uv, like), paged.invalid, report), page)


def repack(
    asset: Asset, square: Square, *, equal: bool = True, seed: int = 0, config: PackConfig | None = None
) -> Packed:
    """Packs the islands of the uv that a mesh has; their shapes stay as they are.

    Args:
        asset: with uv.
        square: the atlas that is asked for.
        equal: whether all islands get the same texel density; otherwise they keep theirs beside each other.
        seed: of the search for a good layout.
        config: numbers.

    Returns:
        The atlas of all faces; those of islands without area lie in its lower left corner.  `changes` of the report
        counts these islands, and those that are not valid.

    Raises:
        InputError: there are no uv with an area, or as `pack_asked`.
    """
    config = config or PackConfig()
    islands = islands_of(asset, equal=equal, config=config.islands)
    packed = pack_asked(faces_of(asset, islands.faces), islands.charts, square, seed, config)
    report = {**packed.report, "islands": len(islands.charts.method)}
    report["changes"] = {FLAT: islands.flat, INVALID: len(packed.invalid)}
    corner_uv = np.zeros((len(asset.faces), 3, 2), dtype=np.float32)
    corner_uv[islands.faces] = packed.atlas.uv[packed.atlas.faces]
    chart = np.full(len(asset.faces), len(islands.charts.method))
    chart[islands.faces] = islands.charts.face_chart
    return Packed(atlas_of_corners(asset, chart, corner_uv, packed.atlas), packed.invalid, report)
