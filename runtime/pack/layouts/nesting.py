"""A layout of charts as bitmaps: the size at which they fill the page, then orders that need less of it.

k charts · cells: the unit of length on the way.  It finds what `placement` can't: holes, bays, and more angles.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...kernel.choice import kernel
from ..growing.outlines import is_rectangle
from ..growing.outlines import rotation as rotation_by
from .bitmap import Mask, Nest, mask_of, nest
from .placement import UNIT, Layout
from .separation import shrunk

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import NestConfig, Rotation, SeparationConfig


def find_nested(
    outlines: list[NDArray[np.float64]],
    folded: NDArray[np.bool_],
    area: float,
    padding: float,
    config: NestConfig,
    rng: np.random.Generator,
    *,
    rotation: Rotation = "any",
    extent: NDArray[np.float64] = UNIT,
) -> Layout | None:
    """The best layout found; None where there are too few or too many charts for it, or the padding leaves no room.

    Args:
        outlines: k upright outlines (s, 2, 2), source units.
        folded: (k,) bool, charts whose holes are none.
        area: of all charts, source units squared.
        padding: share of the side of the page.
        config: numbers.
        rng: for the orders that are tried.
        rotation: how charts may be turned.
        extent: (2,) width and height of the page, the longer one 1.
    """
    if not 1 < len(outlines) <= config.most:
        return None
    quarters = 1 if rotation == "off" else 4
    turns = np.full(len(outlines), 1 if rotation != "any" else config.slants), quarters
    first = _first(_Flat(outlines, folded, area, padding, extent), config, turns)
    if first is None:
        return None
    best = _Best(first.nest, first.keys, extent)
    return layout_of(_improved(first.charts, best, config, rng), first, quarters, extent)


def find_separated(
    outlines: list[NDArray[np.float64]],
    folded: NDArray[np.bool_],
    areas: NDArray[np.float64],
    padding: float,
    config: SeparationConfig,
    rng: np.random.Generator,
    *,
    rotation: Rotation = "any",
    extent: NDArray[np.float64] = UNIT,
) -> list[Layout]:
    """The best layouts found on smaller and smaller pages (`separation`), the best one first.

    Args: as `find_nested`; areas: (k,) of the charts, source units squared.
    """
    k, area = len(outlines), float(areas.sum())
    if not 1 < k <= config.most:
        return []
    quarters = 1 if rotation == "off" else 4
    flat = _Flat(outlines, folded, area, padding, extent)
    first = _first(flat, config.start, (np.ones(k, dtype=np.int64), quarters))
    if first is None:
        return []
    slants = np.where(areas >= config.large * area, config.slants, config.few) if rotation == "any" else np.ones(k, int)
    charts = _all_masks(flat, config.start, first.unit, (slants, quarters))
    work = config.work if kernel() else config.work * config.slower
    found = shrunk(charts, quarters, extent, first.nest, replace(config, work=work), int(rng.integers(2**63)))
    return [layout_of(one, first._replace(charts=charts), quarters, extent) for one in found]


class _Flat(NamedTuple):
    """Upright outlines, which of them are folded, the area of all, the padding, and the page's extent."""

    outlines: list[NDArray[np.float64]]
    folded: NDArray[np.bool_]
    area: float
    padding: float
    extent: NDArray[np.float64]


class _First(NamedTuple):
    """A first layout of charts that fits the page: their masks, cells per source unit, and the keys (k,) by size."""

    nest: Nest
    charts: list[list[Mask]]
    unit: float
    keys: NDArray[np.float64]


def _first(flat: _Flat, config: NestConfig, turns: tuple[NDArray[np.int64], int]) -> _First | None:
    """Charts in the order of their size, at a size at which they fit; None where none is found.

    turns: (k,) slants of each, and the quarter turns of each slant.
    """
    unit = config.side * math.sqrt(config.fill * float(flat.extent.prod()) / flat.area)
    columns = round(config.side * float(flat.extent[0]))
    for _ in range(config.sizings):
        charts = _all_masks(flat, config, unit, turns)
        keys = np.array([max(masks[0].width, masks[0].height) for masks in charts], dtype=np.float64)
        found = nest(charts, np.argsort(-keys, kind="stable"), columns)
        if found is not None and found.side(flat.extent) <= config.more * config.side:
            return _First(found, charts, unit, keys)
        unit *= 0.5 if found is None else config.side / found.side(flat.extent)
    return None


def layout_of(found: Nest, first: _First, quarters: int, extent: NDArray[np.float64]) -> Layout:
    """Where the charts of a nest lie, in sides of the page."""
    chosen = found.mask.tolist()
    offset = np.array([masks[number].offset for masks, number in zip(first.charts, chosen, strict=True)])
    tried = np.array([len(masks) // quarters for masks in first.charts])
    angle = (found.mask // quarters) * (0.5 * math.pi / tried) + (found.mask % quarters) * (0.5 * math.pi)
    side = found.side(extent)
    return Layout(angle, (found.place + offset) / side, first.unit / side)


def _all_masks(flat: _Flat, config: NestConfig, unit: float, turns: tuple[NDArray[np.int64], int]) -> list[list[Mask]]:
    room = flat.padding * config.side * config.more
    each = zip(flat.outlines, flat.folded.tolist(), turns[0].tolist(), strict=True)
    return [_masks(outline, folded, unit, room, (slants, turns[1])) for outline, folded, slants in each]


def _masks(
    outline: NDArray[np.float64], folded: bool, unit: float, padding: float, turns: tuple[int, int]
) -> list[Mask]:
    """So many slants within a quarter turn, and so many quarter turns of each; a rectangle stays upright."""
    masks: list[Mask] = []
    slants, quarters = turns
    for slant in range(1 if is_rectangle(outline) else slants):
        angle = slant * 0.5 * math.pi / slants
        masks.append(mask_of(outline @ rotation_by(angle).T * unit, padding, filled=folded))
        for _ in range(quarters - 1):
            masks.append(masks[-1].turned)
    return masks


class _Best(NamedTuple):
    """The layout that needs least so far, the keys (k,) that ordered it, and the page's extent."""

    nest: Nest
    keys: NDArray[np.float64]
    extent: NDArray[np.float64]


def _improved(charts: list[list[Mask]], start: _Best, config: NestConfig, rng: np.random.Generator) -> Nest:
    """Other orders on a smaller page, from the best so far, as often as the number of charts allows."""
    found, best, extent = start
    first = best
    for number in range(min(config.tries, config.dropped // len(charts))):
        spread = config.shuffle * np.exp(rng.normal())
        keys = (first if number % 4 == 0 else best) * np.exp(spread * rng.normal(size=len(charts)))
        order = np.argsort(-keys, kind="stable")
        width, height = (math.ceil(found.side(extent) * share) - 1 for share in extent.tolist())
        other = nest(charts, order, width, most=height)
        if other is not None:
            found, best = other, keys
    return found
