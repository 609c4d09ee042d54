"""Charts on several pages, where one would be too coarse: the same texel density on all of them.

f faces · k charts · p pages.  Page 0, 1, … are the UDIM tiles 1001, 1002, …: page number a + 10 b lies at uv (a, b).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..geometry.rows import grouped
from ..geometry.triangles import signed_areas
from .asked import faces_of, pack_asked, some_charts
from .config import PackConfig
from .density import ALIKE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Asset, Charts
    from .packing import Packed
    from .square import Square

ACROSS = 10
"""Pages in a row."""


class Paged(NamedTuple):
    """Packed charts: the page of each face (f,), and uv (f, 3, 2) float32 of its corners in the unit square there.

    invalid: (i,) charts that are not valid as written.  report: of the packing; "pages" counts the charts of each.
    """

    page: NDArray[np.int64]
    corner_uv: NDArray[np.float32]
    invalid: NDArray[np.int64]
    report: dict[str, Any]


def chart_pages(charts: Charts, count: int) -> NDArray[np.int64]:
    """(k,) the page of each chart: from the largest on, each goes where least area is.

    No page stays empty while there are charts for it.
    """
    area = np.bincount(charts.face_chart, np.abs(signed_areas(charts.corner_uv)))
    page, filled = np.zeros(len(area), np.int64), np.zeros(count)
    for chart in np.argsort(-area, kind="stable").tolist():
        page[chart] = int(np.argmin(filled))
        filled[page[chart]] += area[chart]
    return page


def pack_pages(
    asset: Asset, charts: Charts, square: Square, count: int, seed: int = 0, config: PackConfig | None = None
) -> Paged:
    """Packs charts onto so many pages, each as `pack_asked`; all get the density of the one that holds least.

    Raises: as `pack_asked`.
    """
    asked, config, square = square, square.config(config), square.of(asset.surface.faces, charts, count)
    page = chart_pages(charts, count)[charts.face_chart]
    used = grouped(page, count)
    found = [_packed(asset, charts, faces, square, seed, config) for faces in used if len(faces)]
    scale = min(packed.report["chart_scale"] for packed in found)
    corner_uv, invalid = np.zeros((len(page), 3, 2), np.float32), []
    for faces, first in zip((own for own in used if len(own)), found, strict=True):
        packed = first
        if scale < (1.0 - ALIKE) * first.report["chart_scale"]:
            even = square._replace(texel_density=scale * square.page.side)
            packed = _packed(asset, charts, faces, even, seed, config)
        corner_uv[faces] = packed.atlas.uv[packed.atlas.faces]
        invalid.append(np.unique(charts.face_chart[faces])[packed.invalid])
    every = np.sort(np.concatenate(invalid))
    report = {**found[0].report, "padding": square.padding, **asked.spared(square)}
    report |= {"chart_scale": scale, "invalid_charts": every.tolist()}
    report["pages"] = [len(np.unique(charts.face_chart[own])) for own in used]
    return Paged(page, corner_uv, every, report)


def on_tiles(paged: Paged) -> NDArray[np.float32]:
    """(f, 3, 2) uv of the corners with each page in a square of its own."""
    return paged.corner_uv + tile_corners(paged.page)[:, None]


def tile_corners(page: NDArray[np.int64] | int) -> NDArray[np.float32]:
    """(…, 2) float32 uv of the lower left corners of the tiles of pages (…)."""
    up, across = np.divmod(page, ACROSS)
    return np.stack([across, up], axis=-1).astype(np.float32)


def _packed(
    asset: Asset, charts: Charts, faces: NDArray[np.int64], square: Square, seed: int, config: PackConfig
) -> Packed:
    return pack_asked(faces_of(asset, faces), some_charts(charts, faces), square, seed, config)
