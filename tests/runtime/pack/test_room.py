"""Room on a page: a bound that no packing breaks, refusals at once, and proposals that fit."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from flexpara.runtime.errors import NoRoomError
from flexpara.runtime.mesh import Surface
from flexpara.runtime.options.unwrap import Options
from flexpara.runtime.pack.config import PlaceConfig
from flexpara.runtime.pack.layouts.placement import find_layout
from flexpara.runtime.pack.room import (
    Outlines,
    demand_room,
    demand_room_for_parts,
    most_charts,
    no_room,
    part_count,
    spared_padding,
)
from flexpara.runtime.pagesize import PageSize


def test_on_a_page_of_twice_the_padding_lies_one_chart_and_on_a_smaller_one_none() -> None:
    assert most_charts(PageSize(16, 16), 8) == 1
    assert most_charts(PageSize(15, 16), 8) == 0
    assert most_charts(PageSize(16, 16), 0) == math.inf


@pytest.mark.parametrize("page", [PageSize(64, 64), PageSize(640, 64), PageSize(513, 700)])
@pytest.mark.parametrize("padding", [1, 3, 8, 20])
def test_as_many_points_as_a_triangular_grid_holds_are_never_too_many(page: PageSize, padding: int) -> None:
    """The densest grid of points 2·padding apart, its rows along either side."""
    for width, height in ((page.width, page.height), (page.height, page.width)):
        rows = int((height - 2 * padding) / (2 * padding * math.sqrt(0.75)) + 1e-9) + 1
        even = (width - 2 * padding) // (2 * padding) + 1
        odd = (width - 3 * padding) // (2 * padding) + 1
        assert most_charts(page, padding) >= even * ((rows + 1) // 2) + odd * (rows // 2)


def test_the_bound_is_a_tenth_below_that_of_disks_by_their_area() -> None:
    by_area = 2048**2 / (math.pi * 8**2)
    assert 0.85 * by_area < most_charts(PageSize(2048, 2048), 8) < 0.95 * by_area


def test_too_many_charts_are_refused_with_a_padding_and_a_size() -> None:
    demand_room(18_000, PageSize(2048, 2048), 8)
    with pytest.raises(NoRoomError) as found:
        demand_room(67_288, PageSize(2048, 2048), 8)
    assert str(found.value) == (
        "67288 charts with a padding of 8 texels leave no room for texels on a page of 2048; "
        "pass --padding 2, or --size 8192 --padding 8"
    )


def test_where_no_size_helps_more_pages_are_named() -> None:
    assert "spread them over more --pages" in str(no_room(10**8, PageSize(2048, 2048), 8))


@pytest.mark.parametrize(("page", "padding"), [(PageSize(256, 256), 8), (PageSize(512, 128), 6)])
def test_what_is_proposed_leaves_room(page: PageSize, padding: int) -> None:
    rng = np.random.default_rng(0)
    sides = rng.uniform(0.1, 1.0, (400, 2))
    square = np.array([[[0.0, 0], [1, 0]], [[1, 0], [1, 1]], [[1, 1], [0, 1]], [[0, 1], [0, 0]]]) - 0.5
    outlines = list(sides[:, None, None] * square)
    text = str(no_room(len(sides), page, padding))
    lower, size = re.findall(r"--padding (\d+),", text), re.findall(r"--size (\S+) --padding", text)
    assert size
    for tried, kept in [(page, int(one)) for one in lower] + [(PageSize.of(one), padding) for one in size]:
        area, config = float(sides.prod(axis=1).sum()), PlaceConfig(tries=0)
        layout = find_layout(outlines, area, kept / tried.side, config, rng, extent=tried.extent)
        assert layout.scale > 0.0


def loose(count: int) -> Surface:
    """So many triangles apart from each other."""
    triangle = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    points = np.tile(triangle, (count, 1))
    points[:, 0] += np.repeat(2.0 * np.arange(count), 3)
    return Surface(points, np.arange(3 * count).reshape(-1, 3))


def test_parts_share_edges_not_corners() -> None:
    assert part_count(loose(5).faces) == 5
    assert part_count(np.array([[0, 1, 2], [2, 1, 3], [3, 5, 6]])) == 2


def test_sheets_along_one_edge_are_parts_of_their_own_as_they_are_charted() -> None:
    assert part_count(np.array([[0, 1, 2], [2, 1, 3], [1, 2, 4]])) == 3


def test_more_parts_than_a_page_holds_are_refused_before_any_chart_is_looked_for() -> None:
    options = Options(size=64, padding=8)
    most = int(most_charts(options.page, 8))
    demand_room_for_parts(loose(most), options)
    with pytest.raises(NoRoomError, match=f"{most + 1} or more charts with a padding of 8"):
        demand_room_for_parts(loose(most + 1), options)
    for other in (Options(size=64, padding=8, pages=2), Options(size=64, padding=8, stack="identical")):
        demand_room_for_parts(loose(most + 1), other)


def test_a_padding_that_nobody_asked_for_leaves_charts_most_of_their_page() -> None:
    page = PageSize(2048, 2048)

    def squares(count: int) -> Outlines:
        return Outlines(area=float(count), length=4.0 * count)

    assert [spared_padding(squares(count), page, 8) for count in (1, 1000, 4096, 12_296, 40_000)] == [8, 8, 4, 2, 1]
    assert spared_padding(squares(40_000), page, 8, pages=16) == 5
    assert spared_padding(squares(40_000), page, 0) == 0
    assert spared_padding(squares(10**7), page, 8) == 1
    assert spared_padding(Outlines(area=5000.0, length=5000.0 * 25.0), page, 8) == 1  # as thin as hair


def test_parts_are_not_refused_for_a_padding_that_nobody_asked_for() -> None:
    many = loose(int(most_charts(PageSize(256, 256), 2)) + 1)
    demand_room_for_parts(many, Options(size=256))
    with pytest.raises(NoRoomError):
        demand_room_for_parts(many, Options(size=256, padding=2))
