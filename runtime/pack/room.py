"""Whether so many charts can lie on a page at all, known before any layout is tried, and what to ask for instead.

Sizes in texels.  Charts lie 2·padding apart and the padding from the border, so that one point of each lies in the
page without that border, 2·padding from every other.  How many such points there can be is bounded by Oler's theorem
("An inequality in the geometry of numbers", Acta Mathematica 1961): ``2/√3 · area/d² + perimeter/(2 d) + 1`` for a
convex region and a distance d.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import NoRoomError
from ..geometry.topology import edge_table, face_components
from ..geometry.triangles import signed_areas
from ..options.atlas import SIZES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ..mesh import Charts, Surface
    from ..options.unwrap import Options
    from ..pagesize import PageSize

ROOM = 3.0
"""What is proposed gives a chart, on the mean, a square of so many paddings: two are kept free, one is its own."""

FILLED, SPARED = 0.6, 0.4
"""Charts without padding are expected to cover so much of a page; a padding that nobody asked for, so much at most."""

CHARTS_OF_A_PART = 2.0
"""So many are expected, where a proposal is made of the number of parts."""


class Outlines(NamedTuple):
    """Of charts, in their own units: the area within them, and the length of all outlines."""

    area: float
    length: float

    @classmethod
    def of(cls, charts: Charts, edges: NDArray[np.bool_]) -> Outlines:
        """Of charts with outlines along edges (f, 3)."""
        step = np.roll(charts.corner_uv, -1, axis=1) - charts.corner_uv
        length = np.sqrt((step[edges] ** 2).sum(axis=1)).sum()
        return cls(float(np.abs(signed_areas(charts.corner_uv)).sum()), float(length))


def spared_padding(outlines: Outlines, page: PageSize, padding: int, pages: int = 1) -> int:
    """The padding where none was asked for: this one, or less where outlines are so long; at least 1."""
    room = float(page.width * page.height * pages)
    texels = math.sqrt(FILLED * room / max(outlines.area, 1e-300)) * outlines.length  # of all outlines
    return max(min(padding, int(SPARED * room / max(texels, 1e-300))), min(padding, 1))


def mean_side(charts: float, page: PageSize, pages: int = 1) -> float:
    """Side of the square that each of so many charts has, in texels."""
    return math.sqrt(page.width * page.height * pages / max(charts, 1))


def most_charts(page: PageSize, padding: int) -> float:
    """More charts than these can't lie on the page, whatever their shapes; fewer may not either.  ∞ without padding."""
    if padding == 0:
        return math.inf
    width, height, apart = page.width - 2.0 * padding, page.height - 2.0 * padding, 2.0 * padding
    if min(width, height) < 0.0:
        return 0.0
    return math.floor(2.0 / math.sqrt(3.0) * width * height / apart**2 + (width + height) / apart + 1.0 + 1e-9)


def demand_room(charts: int, page: PageSize, padding: int) -> None:
    """Raises: NoRoomError for more charts than the page can hold."""
    if charts > most_charts(page, padding):
        raise no_room(charts, page, padding)


def demand_room_for_parts(surface: Surface, options: Options) -> None:
    """The same for a surface that has no charts yet: each of its connected parts gets one at least.

    Not for charts that lie on each other, nor for those that come from elsewhere.  Raises: NoRoomError.
    """
    page, pages, padding = options.page, options.pages, options.margin
    padding = min(padding, 1) if options.padding is None else padding
    most = pages * most_charts(page, padding)
    plain = options.preset == "fast" and options.stack == "off" and not options.keep_islands
    if plain and len(surface.faces) > most and (parts := part_count(surface.faces)) > most:
        raise no_room(parts, page, padding, pages, more=CHARTS_OF_A_PART)


def part_count(faces: NDArray[np.int64]) -> int:
    """How many parts no manifold edge of faces (f, 3) joins: no chart of preset fast reaches over two of them."""
    table = edge_table(faces)
    return int(face_components(len(faces), table.edge_faces[table.manifold]).max(initial=-1)) + 1


def no_room(charts: int, page: PageSize, padding: int, pages: int = 1, *, more: float = 1.0) -> NoRoomError:
    """The error, with a padding and a size that leave room.  more: how many times as many charts may come."""
    side = mean_side(charts * more, page, pages)
    lower = min(int(side / ROOM), padding - 1)
    larger = page.times(2 ** max(math.ceil(math.log2(ROOM * padding / side)), 1))
    remedies = [f"--padding {lower}"] if lower > 0 else []
    remedies += [f"--size {larger.stored} --padding {padding}"] if larger.side <= SIZES[1] else []
    remedy = f"pass {', or '.join(remedies)}" if remedies else "spread them over more --pages"
    where = "a page" if pages == 1 else f"{pages} pages"
    found = f"{charts}{' or more' if more > 1.0 else ''} charts with a padding of {padding} texels"
    return NoRoomError(f"{found} leave no room for texels on {where} of {page.stored}; {remedy}")
