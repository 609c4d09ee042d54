"""What is packed, and what comes of it on the lattice; charts in rows, where there is no time to lay them close.

k charts · f faces.  Lengths are in sides of the page: its longer side is 1.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .exact.lattice import STEPS, Snapped, snap
from .exact.seamvertices import split_vertices
from .growing.growth import apply_placement
from .growing.outlines import chart_outlines
from .layouts.rows import laid_in_rows

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from ..mesh import Charts
    from ..pagesize import PageSize
    from .config import PackConfig


class Sheet(NamedTuple):
    """What is laid out: faces mesh (f, 3), their charts, edges (f, 3) on outlines; where, with what padding."""

    mesh: NDArray[np.int64]
    charts: Charts
    edges: NDArray[np.bool_]
    page: PageSize
    padding: int


class Fitted(NamedTuple):
    """Charts that jammed, on the lattice: faces (f, 3) over its points, one for each place of a vertex in a chart.

    placement: (k, 2, 3) in sides of the page.  uv_placement: the same in uv, rectangles on whole texels.
    """

    placement: NDArray[np.float64]
    uv_placement: NDArray[np.float64]
    skipped: int
    snapped: Snapped
    faces: NDArray[np.int64]
    slack: float


def in_rows(sheet: Sheet, config: PackConfig, _seed: int) -> tuple[Fitted, dict[str, Any]]:
    """Charts in rows of their boxes, found at once."""
    place = partial(laid_in_rows, chart_outlines(sheet.charts, sheet.edges), rotation=config.rotation)
    fitted = _rows_with(sheet, place, config, config.rows.slack)
    for _ in range(config.lattice.retries):
        if fitted.snapped.farthest <= fitted.slack:
            break
        fitted = _rows_with(sheet, place, config, fitted.snapped.farthest + 2.0)
    return fitted, {"rows": True}


def _rows_with(sheet: Sheet, place: Callable[..., NDArray[np.float64]], config: PackConfig, slack: float) -> Fitted:
    """Charts in rows, on the lattice, with so much kept free beyond the padding."""
    mesh, charts, edges, page, padding = sheet
    placement = place(padding / page.side + slack / STEPS, page.extent, config.rows)
    placed = in_uv(placement, page)
    faces, snapped = on_lattice(mesh, charts, edges, placed, config)
    return Fitted(placement, placed, 0, snapped, faces, slack)


def in_uv(placement: NDArray[np.float64], page: PageSize) -> NDArray[np.float64]:
    """A placement (k, 2, 3) in sides of the page as one in uv; the very array on a square page."""
    return placement if page.is_square else placement / page.extent[:, None]


def on_lattice(
    mesh: NDArray[np.int64],
    charts: Charts,
    edges: NDArray[np.bool_],
    placement: NDArray[np.float64],
    config: PackConfig,
) -> tuple[NDArray[np.int64], Snapped]:
    """Charts of faces mesh (f, 3) where they are placed in uv (k, 2, 3): faces, and their vertices snapped."""
    faces, _, flat = split_vertices(mesh, charts.face_chart, charts.corner_uv)
    chart = np.zeros(len(flat), dtype=np.int64)
    chart[faces] = charts.face_chart[:, None]
    uv = apply_placement(placement, chart, flat[:, None])[:, 0]
    return faces, snap(uv, faces, charts.face_chart, edges, config.lattice)
