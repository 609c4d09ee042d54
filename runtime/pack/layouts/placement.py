"""The search for a layout: the size at which charts fill the page, then orders and widths that need less of it.

k charts · cells: the unit of length on the way, the width of a column of the skyline (`skyline`).  A layout that needs
a page of R cells along its longer side becomes the atlas by a division by R; the smaller R, the larger the charts.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ...errors import NoRoomError
from ..growing.outlines import rotation as rotation_by
from .skyline import Drop, Profile, drop, profile

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import PlaceConfig, Rotation

UNIT = np.ones(2)
"""Extent of a square page."""


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the charts of one atlas lie, in sides of the page.

    angle: (k,) radians by which each is turned, on top of standing upright.  origin: (k, 2) where the origin of its
    turned coordinates goes.  scale: of a source unit.
    """

    angle: NDArray[np.float64]
    origin: NDArray[np.float64]
    scale: float


@dataclass(frozen=True, eq=False)
class _Shapes:
    """The profiles of charts at one size: unit cells per source unit.  extent: (k,) their longer sides, cells.

    narrowest: columns that the widest chart needs at least.
    """

    charts: list[list[Profile]]
    angle: list[NDArray[np.float64]]
    unit: float
    extent: NDArray[np.float64]
    narrowest: int


@dataclass(frozen=True, eq=False)
class _Found:
    """What the search has: where charts lie, the page's longer side in cells, and the keys (k,) that order them."""

    drop: Drop
    side: float
    keys: NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class _Outlines:
    """Upright outlines (k of (s, 2, 2)) of charts of that area, source units, and how they may be turned.

    long: length of a chart, in sides of a square of the area, from which diagonals are tried, unless it is alone: it
    stands at the angle that needs least then.  extent: of the page.
    """

    outlines: list[NDArray[np.float64]]
    area: float
    rotation: Rotation
    long: float
    extent: NDArray[np.float64]

    def shapes(self, unit: float, padding: float) -> _Shapes:
        """Profiles at that size, at each angle they may have."""
        charts, angles, slanting = [], [], self.rotation == "any" and len(self.outlines) > 1
        for outline in self.outlines:
            long = slanting and np.ptp(outline, axis=(0, 1)).max() > self.long * math.sqrt(self.area)
            quarters = range(1 if self.rotation == "off" else 2)
            turns = [0.5 * number for number in quarters]
            shapes = [profile(outline @ rotation_by(turn * math.pi).T * unit, padding) for turn in turns]
            turned = [shape.turned for shape in shapes]
            alike = all(one.looks_like(other) for one, other in zip(shapes, turned, strict=True))
            if not alike and self.rotation != "off":
                turns, shapes = [*turns, 1.0, 1.5], [*shapes, *turned]
            if long:
                turns = [*turns, 0.25, 0.75]
                shapes += [profile(outline @ rotation_by(turn * math.pi).T * unit, padding) for turn in turns[-2:]]
            charts.append(shapes)
            angles.append(np.array(turns) * math.pi)
        extent = np.array([max(len(chart[0].low), chart[0].top) for chart in charts])
        narrowest = max(min(len(shape.low) for shape in chart) for chart in charts)
        return _Shapes(charts, angles, unit, extent, narrowest)


def find_layout(
    outlines: list[NDArray[np.float64]],
    area: float,
    padding: float,
    config: PlaceConfig,
    rng: np.random.Generator,
    *,
    rotation: Rotation = "any",
    extent: NDArray[np.float64] = UNIT,
) -> Layout:
    """The best layout found.

    Args:
        outlines: k upright outlines (s, 2, 2), source units.
        area: of all charts, source units squared.
        padding: share of the side of the page.
        config: numbers.
        rng: for the orders that are tried.
        rotation: how charts may be turned.
        extent: (2,) width and height of the page, the longer one 1.

    Raises:
        NoRoomError: the padding leaves no room for the charts.
    """
    columns = int(min(max(config.columns * math.sqrt(len(outlines)), config.least), config.most))
    shapes, found = _sized(_Outlines(outlines, area, rotation, config.long, extent), padding, columns, config)
    found = _improved(shapes, found, config, rng, extent)
    chosen, rows = found.drop.angle.tolist(), range(len(outlines))
    offset = np.array([shapes.charts[chart][chosen[chart]].offset for chart in rows])
    angle = np.array([shapes.angle[chart][chosen[chart]] for chart in rows])
    return Layout(angle, (found.drop.origin + offset) / found.side, shapes.unit / found.side)


def _sized(outlines: _Outlines, padding: float, columns: int, config: PlaceConfig) -> tuple[_Shapes, _Found]:
    """Shapes of the largest size tried at which a first layout fits on a page of so many cells, and that layout.

    The search ends where almost all of the page is needed.  What a layout needs jumps as the charts grow, so that a
    guess from the last size may swing to and fro: one beyond what fitted, or beyond what did not, is halved instead.
    The padding is a share of the page's longer side: on a page of as many cells or fewer it is kept.
    """
    k, extent = len(outlines.outlines), outlines.extent
    first = unit = columns * math.sqrt(config.fill * float(extent.prod()) / outlines.area)
    room = 2.0 * padding * columns * math.sqrt(k)  # what padding takes does not shrink with the charts
    fitting, too_large = None, math.inf
    for _ in range(config.sizings + 1):
        shapes = outlines.shapes(unit, padding * columns)
        found = _first(shapes, columns, config, extent)
        if found.side > columns:
            too_large = min(too_large, unit)
        elif fitting is None or unit > fitting[0].unit:
            fitting = shapes, found
        if (1.0 - config.alike) * columns <= found.side <= columns or unit < 1e-4 * first:
            break
        wanted = ((1.0 - config.alike / 2.0) * columns - room) / max(found.side - room, 1e-9)
        unit *= min(max(wanted, 0.25), 2.0) if room < columns else 0.25
        if fitting is not None and not fitting[0].unit < unit < too_large:
            unit = fitting[0].unit * math.sqrt(min(too_large / fitting[0].unit, 4.0))
    if fitting is None:
        raise NoRoomError(
            f"{k} charts with a padding of {100.0 * padding:.3g} % of the atlas side leave no room for "
            "texels; lower the padding or raise the size"
        )
    return fitting


def _first(shapes: _Shapes, columns: int, config: PlaceConfig, extent: NDArray[np.float64]) -> _Found:
    """The layout of charts in the order of their size, on the better of two pages."""
    wide, form = math.ceil(columns * float(extent[0])), float(extent[0] / extent[1])
    found = _dropped(shapes, max(wide, shapes.narrowest), config.tightness, extent)
    width = max(int(math.sqrt(found.drop.width * found.drop.height * form)), shapes.narrowest)
    again = _dropped(shapes, width, config.tightness, extent)
    return again if again.side < found.side else found


def _dropped(shapes: _Shapes, width: int, tightness: float, extent: NDArray[np.float64]) -> _Found:
    found = drop(shapes.charts, np.argsort(-shapes.extent, kind="stable"), width, tightness=tightness)
    assert found is not None, "no chart is wider than the columns"
    return _Found(found, found.side(extent), shapes.extent)


def _improved(
    shapes: _Shapes, found: _Found, config: PlaceConfig, rng: np.random.Generator, extent: NDArray[np.float64]
) -> _Found:
    """Other orders and a narrower page, from the best so far, as often as the number of charts allows."""
    k, (wide, high) = len(shapes.charts), extent.tolist()
    tries = min(config.tries, config.dropped // k) if k > 1 else 0
    for number in range(tries):
        width = max(math.ceil(found.side * wide) - 1 - int(rng.integers(0, 3)), shapes.narrowest)
        spread = config.shuffle * np.exp(rng.normal(size=1))
        source = shapes.extent if number % 4 == 0 else found.keys
        keys = source * np.exp(spread * rng.normal(size=k))
        tightness = config.tightness * float(np.exp(rng.normal()))
        order = np.argsort(-keys, kind="stable")
        moved = drop(shapes.charts, order, width, tightness=tightness, most=found.side * high)
        if moved is not None and moved.side(extent) < found.side:
            found = replace(found, drop=moved, side=moved.side(extent), keys=keys)
    return found
