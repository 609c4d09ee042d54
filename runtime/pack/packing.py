"""Packing: charts → Atlas, at an exact size, with padding kept and every chart at the same texel density.

k charts · P padding in texels.  Chart coordinates are source units, v up.  A chart is turned to its smallest bounding
rectangle, then by quarter turns, moved, and turned a little where it grows; never mirrored, never stretched.  Outlines
of two charts stay 2·P apart, and P from the border of the page.  Until the lattice, lengths are in sides of the page:
its longer side is 1.

Charts are dropped on a skyline (`skyline`, `placement`), grow where they lie until they jam (`growth`), keep the
padding exactly (`padding`), and go to a lattice on which the exact tests are made (`lattice`): what was proven is what
is written.
"""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from ..errors import FinishError, InputError, NoRoomError
from ..geometry.metrics import uv_charts
from ..geometry.triangles import signed_areas
from ..mesh import Asset, Atlas, Charts
from ..pagesize import PageSize
from .config import PackConfig
from .exact.lattice import STEPS
from .exact.seamvertices import atlas_normals, split_vertices
from .growing.growth import grown
from .growing.outlines import chart_outlines, is_straight, outline_edges, rotation, upright_angle
from .layouts.nesting import find_nested, find_separated
from .layouts.placement import Layout, find_layout
from .layouts.texels import aligned
from .room import demand_room, no_room
from .sheet import Fitted, Sheet, in_rows, in_uv, on_lattice

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..pagesize import Size


@dataclass(frozen=True, eq=False)
class Packed:
    """Packed charts.

    atlas: complete, whatever `invalid` says.
    invalid: (i,) int64 charts in which triangles overlap, or lie upside down, on the numbers written: to be cut anew.
    report: settings, and what happened; ready for JSON.  longest_chart: its number; longest_chart_share: its length
        over the longer side before charts grow; length_limits: no square of the charts' area can hold it, so it decides
        the scale of all: cutting it would pay.  chart_scale: sides of the page per source unit.  moved_vertices,
        moved_farthest: of slivers, atlas units.  skipped_growth_steps: linear programs without a solution.
    """

    atlas: Atlas
    invalid: NDArray[np.int64]
    report: dict[str, Any]


def pack(
    asset: Asset,
    charts: Charts,
    *,
    size: Size | PageSize,
    padding: int,
    seed: int = 0,
    config: PackConfig | None = None,
) -> Packed:
    """Packs charts onto one page of exactly that many texels.

    Args:
        asset: the mesh; its faces are those of the charts.
        charts: k charts, each id in [0, k) with a face.
        size: of the page, each side ≥ 1 texel.
        padding: texels kept free around each chart and along the border, ≥ 0.
        seed: of the search for a good layout; same seed, same bytes.
        config: numbers of placing and growing; None takes the defaults.

    Returns:
        The atlas: uv are multiples of 2⁻²⁴, so float32 holds them and 1 − v; ``placement`` holds where each chart
        went: on the page similarities, of the same scale for all.  And which charts are not valid there.

    Raises:
        InputError: size or padding is out of range.
        NoRoomError: the padding leaves no room for the charts; with numbers that do.
        FinishError: a chart has no outline or no finite uv.
    """
    config = config or PackConfig()
    page = PageSize.of(size)
    _check(asset, charts, page, padding)
    edges = outline_edges(asset.surface.faces, charts)
    lay_out = in_rows if config.hurried else _close_together
    try:
        fitted, report = lay_out(Sheet(asset.surface.faces, charts, edges, page, padding), config, seed)
    except NoRoomError as error:
        raise no_room(int(charts.face_chart.max()) + 1, page, padding) from error
    scale = scale_of(fitted.placement)
    if config.whole_texels:
        placement = aligned(in_uv(fitted.placement, page), chart_outlines(charts, edges), page, config)
        faces, snapped = on_lattice(asset.surface.faces, charts, edges, placement, config)
        fitted = fitted._replace(uv_placement=placement, faces=faces, snapped=snapped)
    snapped = fitted.snapped
    atlas = as_atlas(asset, charts, fitted, page, padding)
    report |= {
        "padding": padding,
        "chart_scale": scale,
        "skipped_growth_steps": fitted.skipped,
    }
    report |= {"moved_vertices": snapped.moved, "moved_farthest": snapped.farthest / STEPS}
    report |= {"invalid_charts": snapped.invalid.tolist(), "settings": asdict(config)}
    return Packed(atlas, snapped.invalid, report)


def _close_together(sheet: Sheet, config: PackConfig, seed: int) -> tuple[Fitted, dict[str, Any]]:
    """Charts grown from the better of their first placements, and what limits them."""
    mesh, charts, edges, page, padding = sheet
    places, report = _placed(charts, chart_outlines(charts, edges), page, padding, config, seed)
    if len(places) > config.finalists:
        places = _finalists(charts, edges, [_Place(first, page, padding) for first in places], config)
    jammed = [_grown(charts, edges, _Place(first, page, padding), config, 2.0) for first in places]
    best = max(range(len(jammed)), key=lambda number: scale_of(jammed[number][0]))
    fit = partial(fitted_charts, mesh, charts, edges, _Place(places[best], page, padding), config)
    fitted = fit(2.0, jammed[best])
    for _ in range(config.lattice.retries):
        if fitted.snapped.farthest <= fitted.slack:
            break
        fitted = fit(fitted.snapped.farthest + 2.0)  # what the repair of slivers moves must not cost padding
    return fitted, report


def _finalists(
    charts: Charts, edges: NDArray[np.bool_], places: list[_Place], config: PackConfig
) -> list[NDArray[np.float64]]:
    """The placements (k, 2, 3) in which charts have grown most after one round, as they are then."""
    quick = replace(config, growth=replace(config.growth, rounds=1))
    begun = [_grown(charts, edges, place, quick, 2.0)[0] for place in places]
    return sorted(begun, key=scale_of, reverse=True)[: config.finalists]


def _placed(
    charts: Charts, outlines: list[NDArray[np.float64]], page: PageSize, padding: int, config: PackConfig, seed: int
) -> tuple[list[NDArray[np.float64]], dict[str, Any]]:
    """First placements (k, 2, 3) of the charts, of which the better is to be found, and what limits them."""
    angles = np.zeros(len(outlines))
    if config.rotation == "any":
        angles = np.array([upright_angle(outline, page.extent if len(outlines) == 1 else None) for outline in outlines])
    upright = [outline @ rotation(angle).T for outline, angle in zip(outlines, angles, strict=True)]
    areas = np.bincount(charts.face_chart, np.abs(signed_areas(charts.corner_uv))).astype(np.float64)
    area = float(areas.sum())
    # a hair more than the padding: charts that touch could not be parted by letting them shrink
    room, extent = padding / page.side + 4.0 / STEPS, page.extent
    turns, rngs = config.rotation, [np.random.default_rng(seed) for _ in range(3)]
    layout = find_layout(upright, area, room, config.place, rngs[0], rotation=turns, extent=extent)
    folded = _folded(charts)
    nested = find_nested(upright, folded, area, room, config.nest, rngs[1], rotation=turns, extent=extent)
    layouts = [layout] if nested is None else [layout, nested]
    apart = config.separation
    layouts += find_separated(upright, folded, areas, room, apart, rngs[2], rotation=turns, extent=extent)
    length = np.array([np.ptp(outline.reshape(-1, 2), axis=0).max() for outline in upright])
    longest = int(length.argmax())
    limits = {
        "longest_chart": longest,
        "longest_chart_share": float(length[longest] * layout.scale),
        "length_limits": bool(length[longest] > config.place.long * math.sqrt(area)),
    }
    return [_placement(found, angles) for found in layouts], limits


def _placement(layout: Layout, upright: NDArray[np.float64]) -> NDArray[np.float64]:
    """(k, 2, 3) of charts that stand upright at these angles (k,)."""
    linear = np.stack([layout.scale * rotation(angle) for angle in upright + layout.angle])
    return np.concatenate([linear, layout.origin[:, :, None]], axis=2)


def _folded(charts: Charts) -> NDArray[np.bool_]:
    """(k,) bool: charts in which some triangles lie the other way round than others."""
    area = signed_areas(charts.corner_uv)
    both = np.bincount(charts.face_chart, np.abs(area)), np.abs(np.bincount(charts.face_chart, area))
    return both[1] < both[0] * (1.0 - 1e-9)


def scale_of(placement: NDArray[np.float64]) -> float:
    """Sides of the page per source unit of a placement (k, 2, 3)."""
    return float(np.sqrt(np.linalg.det(placement[0, :, :2])))


def as_atlas(asset: Asset, charts: Charts, fitted: Fitted, page: PageSize, padding: int) -> Atlas:
    """The mesh with vertices doubled along seams, and the lattice points as their uv."""
    faces, source_vertex, _ = split_vertices(asset.faces, charts.face_chart, charts.corner_uv)
    uv = np.zeros((len(source_vertex), 2), dtype=np.float32)
    uv[faces.reshape(-1)] = fitted.snapped.points[fitted.faces.reshape(-1)] / STEPS
    return Atlas(
        positions=asset.positions[source_vertex],
        faces=faces,
        uv=uv,
        normals=atlas_normals(asset, source_vertex),
        face_chart=charts.face_chart,
        source_vertex=source_vertex,
        size=page.stored,
        padding=padding,
        placement=fitted.uv_placement,
    )


def atlas_of_corners(asset: Asset, face_chart: NDArray[np.int64], corner_uv: NDArray[np.float32], like: Atlas) -> Atlas:
    """The mesh with uv (f, 3, 2) for each corner of its faces, of the size and padding of another atlas."""
    faces, source_vertex, uv = split_vertices(asset.faces, face_chart, corner_uv.astype(np.float64))
    return replace(
        like,
        positions=asset.positions[source_vertex],
        faces=faces,
        uv=uv.astype(np.float32),
        normals=atlas_normals(asset, source_vertex),
        face_chart=face_chart,
        source_vertex=source_vertex,
    )


class _Place(NamedTuple):
    """A first placement (k, 2, 3) on a page, with so many texels of padding."""

    placement: NDArray[np.float64]
    page: PageSize
    padding: int


Grown: TypeAlias = "tuple[NDArray[np.float64], int]"
"""A placement (k, 2, 3) of charts that jammed, and how many steps on the way had no solution."""


def _grown(charts: Charts, edges: NDArray[np.bool_], first: _Place, config: PackConfig, slack: float) -> Grown:
    """Charts grown from where they were placed; slack: what is kept free beyond the padding, lattice units."""
    outlines = chart_outlines(charts, edges)
    placed = [flat @ place[:, :2].T for flat, place in zip(outlines, first.placement, strict=True)]
    turning = np.array([config.rotation == "any" and not is_straight(flat, config.growth) for flat in placed])
    kept = slack / STEPS
    return grown(first.placement, outlines, first.page, first.padding, config.growth, slack=kept, turning=turning)


def fitted_charts(
    mesh: NDArray[np.int64],
    charts: Charts,
    edges: NDArray[np.bool_],
    first: _Place,
    config: PackConfig,
    slack: float,
    known: Grown | None = None,
) -> Fitted:
    """Charts of faces mesh (f, 3), grown from where they were placed and snapped to the lattice.

    slack: what is kept free beyond the padding, lattice units.  known: what they grow to with it.
    """
    placement, skipped = known or _grown(charts, edges, first, config, slack)
    placed = in_uv(placement, first.page)
    faces, snapped = on_lattice(mesh, charts, edges, placed, config)
    return Fitted(placement, placed, skipped, snapped, faces, slack)


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


def _check(asset: Asset, charts: Charts, page: PageSize, padding: int) -> None:
    if min(page) < 1 or padding < 0:
        raise InputError(f"size {page.stored} and padding {padding}: expected size ≥ 1 and padding ≥ 0 texels")
    if charts.corner_uv.shape != (len(asset.faces), 3, 2) or charts.face_chart.shape != (len(asset.faces),):
        raise FinishError(
            f"charts cover {len(charts.face_chart)} faces, the mesh has {len(asset.faces)}; please report"
        )
    if not np.isfinite(charts.corner_uv).all():
        raise FinishError("a chart has uv that are not finite; please report the mesh")
    size = np.bincount(charts.face_chart)
    empty = np.flatnonzero(size == 0)
    if len(empty):
        raise FinishError(f"chart {empty[0]} has no face; every chart id needs one")
    demand_room(len(size), page, padding)
