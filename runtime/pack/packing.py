"""Packing: charts → Atlas, at an exact size, with padding kept and every chart at the same texel density.

k charts · S texels per side · P padding in texels · R cells per side of the coarse grid on which xatlas works.
Chart coordinates are source units, v up.  A chart is turned to its smallest bounding rectangle, then by quarter turns,
and moved; never mirrored, never stretched.  Outlines of two charts stay 2·P apart, and P from the border of the atlas.

The charts' size in cells is fixed and R is searched for: the smaller the square that still holds them, the larger they
become when it is stretched to S.  A local search over quarter turns lowers R; then all charts grow where they lie,
moved apart where that helps, until they jam.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from ..errors import FinishError, InputError
from ..geometry.metrics import uv_charts
from ..geometry.topology import edge_table
from ..geometry.triangles import signed_areas
from ..mesh import Asset, Atlas, Charts
from .config import PackConfig, PlaceConfig
from .growth import apply_placement, grown
from .placement import Relief, place, relief, solid, turned
from .seams import atlas_normals, rounded_uv, split_vertices

if TYPE_CHECKING:
    from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class _Layout:
    """A placement on the coarse grid: quarter turns (k,), origins (k, 2) in cells after the turn, cells R per side."""

    quarters: NDArray[np.int64]
    origin: NDArray[np.float64]
    cells: int


def pack(
    asset: Asset, charts: Charts, *, size: int, padding: int, seed: int = 0, config: PackConfig | None = None
) -> Atlas:
    """Packs charts into one square atlas of exactly size × size texels.

    Args:
        asset: the mesh; its faces are those of the charts.
        charts: k charts, each id in [0, k) with a face.
        size: texels per side, ≥ 1.
        padding: texels kept free around each chart and along the border, ≥ 0.
        seed: of the search for a good layout; same seed, same bytes.
        config: numbers of placing and growing; None takes the defaults.

    Returns:
        The atlas; ``placement`` holds the similarity of each chart, of the same scale for all.

    Raises:
        InputError: size or padding is out of range, or the padding leaves no room for the charts.
        FinishError: a chart has no outline or no finite uv, or a triangle is too thin for float32.
    """
    config = config or PackConfig()
    _check(asset, charts, size, padding)
    outlines = _outlines(asset.surface.faces, charts)
    angles = np.array([_upright_angle(outline, square=len(outlines) == 1) for outline in outlines])
    upright = [outline @ _rotation(angle).T for outline, angle in zip(outlines, angles, strict=True)]
    area = float(np.abs(signed_areas(charts.corner_uv)).sum())
    layout, unit = _search(upright, area, padding / size, config.place, np.random.default_rng(seed))
    placement = _placement(angles, layout, unit)
    placement = grown(placement, outlines, size, padding, config.growth)
    corner_uv = apply_placement(placement, charts.face_chart, charts.corner_uv)
    faces, source_vertex, uv = split_vertices(asset.faces, charts.face_chart, corner_uv)
    return Atlas(
        positions=asset.positions[source_vertex],
        faces=faces,
        uv=rounded_uv(uv, faces),
        normals=atlas_normals(asset, source_vertex),
        face_chart=charts.face_chart,
        source_vertex=source_vertex,
        size=size,
        padding=padding,
        placement=placement,
    )


def atlas_from_uv(asset: Asset) -> Atlas:
    """The atlas a mesh already carries: its own uv, charts by uv connectivity, size and padding 0, no placement.

    Raises:
        InputError: the mesh has no uv.
    """
    if asset.uv is None:
        raise InputError(f"{asset.stem} carries no uv coordinates; unwrap it first: flexpara unwrap MESH -o OUT")
    used, faces = np.unique(asset.faces, return_inverse=True)
    chart, _ = uv_charts(asset.surface.faces, asset.uv[asset.faces])
    return Atlas(
        positions=asset.positions[used],
        faces=faces.reshape(-1, 3).astype(np.int64),
        uv=asset.uv[used].astype(np.float32),
        normals=atlas_normals(asset, used),
        face_chart=chart,
        source_vertex=used,
        size=0,
        padding=0,
    )


def _check(asset: Asset, charts: Charts, size: int, padding: int) -> None:
    if size < 1 or padding < 0:
        raise InputError(f"size {size} and padding {padding}: expected size ≥ 1 and padding ≥ 0 texels")
    if charts.corner_uv.shape != (len(asset.faces), 3, 2) or charts.face_chart.shape != (len(asset.faces),):
        raise FinishError(
            f"charts cover {len(charts.face_chart)} faces, the mesh has {len(asset.faces)}; please report"
        )
    if not np.isfinite(charts.corner_uv).all():
        raise FinishError("a chart has uv that are not finite; please report the mesh")
    empty = np.flatnonzero(np.bincount(charts.face_chart) == 0)
    if len(empty):
        raise FinishError(f"chart {empty[0]} has no face; every chart id needs one")


def _outlines(faces: NDArray[np.int64], charts: Charts) -> list[NDArray[np.float64]]:
    """Per chart its directed outline segments (s, 2, 2) in chart coordinates."""
    table = edge_table(faces)
    _, seam = uv_charts(faces, charts.corner_uv, table)
    side = charts.face_chart[table.edge_faces]
    outline = (seam | ~table.manifold | (side[:, 0] != side[:, 1]))[table.face_edges]
    segments = np.stack([charts.corner_uv, np.roll(charts.corner_uv, -1, axis=1)], axis=2)[outline]
    chart = np.repeat(charts.face_chart, outline.sum(axis=1))
    order = np.argsort(chart, kind="stable")
    counts = np.bincount(chart, minlength=int(charts.face_chart.max()) + 1)
    if not counts.all():
        raise FinishError(f"chart {int(counts.argmin())} is closed and has no outline; cut it open first")
    return np.split(segments[order], np.cumsum(counts)[:-1])


def _rotation(angle: float) -> NDArray[np.float64]:
    return np.array([[math.cos(angle), -math.sin(angle)], [math.sin(angle), math.cos(angle)]])


def _upright_angle(outline: NDArray[np.float64], *, square: bool) -> float:
    """Angle (radians) that turns an outline (s, 2, 2) into its smallest bounding rectangle (or square, to a degree).

    One side of that rectangle lies along an edge of the convex hull (Freeman and Shapira 1975).
    """
    points = outline.reshape(-1, 2)
    try:
        points = points[ConvexHull(points).vertices]
    except QhullError:  # all points on a line: the hull has no edges, the points do
        points = points[np.lexsort((points[:, 1], points[:, 0]))[[0, -1]]]
    edge = np.roll(points, -1, axis=0) - points
    angles = -np.arctan2(edge[:, 1], edge[:, 0])
    if square:
        angles = np.concatenate([angles, np.deg2rad(np.arange(90.0))])
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]
    width = np.ptp(points[:, 0] * cosine - points[:, 1] * sine, axis=1)
    height = np.ptp(points[:, 0] * sine + points[:, 1] * cosine, axis=1)
    return float(angles[np.argmin(np.maximum(width, height) if square else width * height)])


def _search(
    outlines: list[NDArray[np.float64]], area: float, padding: float, config: PlaceConfig, rng: np.random.Generator
) -> tuple[_Layout, float]:
    """The best layout found, and the cells per source unit it was found with; padding is a share of the atlas side."""
    target = int(config.cells * min(max(math.sqrt(len(outlines) / 24.0), 1.0), 4.0))
    length = sum(float(np.linalg.norm(outline[:, 1] - outline[:, 0], axis=1).sum()) for outline in outlines)
    unit = _unit(area, length, len(outlines), padding * target, config.fill * target**2)
    for _ in range(config.shrinks):
        cells = int(target * config.spare)
        if math.pi * len(outlines) * (padding * cells) ** 2 > cells**2:
            break
        reliefs = [relief(outline * unit, padding * cells) for outline in outlines]
        layout = _attempt(reliefs, np.zeros(len(outlines), dtype=np.int64), padding, cells, config)
        if layout is not None:
            return _improved(reliefs, layout, padding, config, rng), unit
        unit *= config.shrink
    raise InputError(
        f"{len(outlines)} charts with a padding of {100.0 * padding:.3g} % of the atlas side leave no room for texels; "
        "lower the padding or raise the size"
    )


def _unit(area: float, length: float, k: int, reach: float, filled: float) -> float:
    """Cells per source unit at which k charts of area and outline length, padded by reach cells, fill so many cells."""
    room = filled - math.pi * k * reach**2
    half = length * reach / 2.0
    return max((math.sqrt(half**2 + area * max(room, 0.0)) - half) / area, 2.0 / math.sqrt(area))


def _attempt(
    reliefs: list[Relief], quarters: NDArray[np.int64], padding: float, cells: int, config: PlaceConfig
) -> _Layout | None:
    """The layout with these quarter turns on cells² cells, if xatlas finds one."""
    masks: list[NDArray[np.bool_]] = []
    corners: list[NDArray[np.float64]] = []
    for chart, quarter in zip(reliefs, quarters.tolist(), strict=True):
        silhouette = chart.silhouette(padding * cells)
        low, high = chart.origin, chart.origin + silhouette.shape[::-1]
        mask, offset = solid(turned(silhouette, quarter))
        masks.append(mask)
        corners.append((np.stack([low, high]) @ _quarter_turn(quarter).T).min(axis=0) + offset)
    offset = place(masks, cells, exhaustive=len(masks) <= config.few)
    return None if offset is None else _Layout(quarters, offset.astype(np.float64) - np.array(corners), cells)


def _quarter_turn(quarter: int) -> NDArray[np.float64]:
    return np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), quarter)


def _improved(
    reliefs: list[Relief], layout: _Layout, padding: float, config: PlaceConfig, rng: np.random.Generator
) -> _Layout:
    """Lowers the number of cells: first by bisection as it stands, then by trying other quarter turns."""
    k = len(reliefs)
    filled = sum(int(chart.silhouette(0.0).sum()) for chart in reliefs)
    low, best = math.isqrt(filled) - 1, layout
    close = 1 if k <= config.few else int(config.coarse * best.cells)
    while best.cells - low > close:
        middle = (best.cells + low) // 2
        found = _attempt(reliefs, best.quarters, padding, middle, config)
        low, best = (middle, best) if found is None else (low, found)
    tries = min(config.tries, config.tried_charts // k) if k > 1 else 4
    for number in range(tries):
        quarters = rng.integers(0, 4, k)
        if number >= tries // 3:
            kept = rng.random(k) >= 1.5 / k
            quarters = np.where(kept, best.quarters, quarters)
        step = 1
        while (found := _attempt(reliefs, quarters, padding, best.cells - step, config)) is not None:
            best, step = found, step * 2
    return best


def _placement(angles: NDArray[np.float64], layout: _Layout, unit: float) -> NDArray[np.float64]:
    """(k, 2, 3) similarities chart coordinates → atlas uv of a layout found with unit cells per source unit."""
    total = angles + layout.quarters * (math.pi / 2.0)
    cosine, sine = np.cos(total) * unit, np.sin(total) * unit
    linear = np.stack([np.stack([cosine, -sine], axis=1), np.stack([sine, cosine], axis=1)], axis=1)
    return np.concatenate([linear, layout.origin[:, :, None]], axis=2) / layout.cells
