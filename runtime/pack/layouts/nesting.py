"""A layout of charts as bitmaps: the size at which they fill the page, then orders that need less of it.

k charts · cells: the unit of length on the way.  It finds what `placement` can't: holes, bays, and more angles.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..growing.outlines import is_rectangle
from ..growing.outlines import rotation as rotation_by
from .bitmap import Mask, Nest, mask_of, nest
from .placement import UNIT, Layout

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..config import NestConfig, Rotation


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
    slants = 1 if rotation != "any" else config.slants
    unit = config.side * math.sqrt(config.fill * float(extent.prod()) / area)
    columns = round(config.side * float(extent[0]))
    for _ in range(config.sizings):
        charts = [
            _masks(*one, unit, padding * config.side * config.more, (slants, quarters))
            for one in zip(outlines, folded.tolist(), strict=True)
        ]
        keys = np.array([max(masks[0].width, masks[0].height) for masks in charts], dtype=np.float64)
        found = nest(charts, np.argsort(-keys, kind="stable"), columns)
        if found is not None and found.side(extent) <= config.more * config.side:
            break
        unit *= 0.5 if found is None else config.side / found.side(extent)
    else:
        return None
    found = _improved(charts, _Best(found, keys, extent), config, rng)
    chosen = found.mask.tolist()
    offset = np.array([masks[number].offset for masks, number in zip(charts, chosen, strict=True)])
    tried = np.array([len(masks) // quarters for masks in charts])
    angle = (found.mask // quarters) * (0.5 * math.pi / tried) + (found.mask % quarters) * (0.5 * math.pi)
    side = found.side(extent)
    return Layout(angle, (found.place + offset) / side, unit / side)


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
