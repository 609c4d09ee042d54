"""Overlap removed on smaller and smaller pages: depths by hand, no cell taken twice, and the kernel to the bit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.pack.config import NestConfig, Rotation, SeparationConfig
from flexpara.runtime.pack.growing.outlines import rotation
from flexpara.runtime.pack.layouts.bitmap import Mask, Nest, mask_of, nest
from flexpara.runtime.pack.layouts.nesting import find_separated
from flexpara.runtime.pack.layouts.separation import Chance, depths, shrunk

SQUARE = np.ones(2)
QUICK = SeparationConfig(work=2e6, patience=6)


def ring(points: np.ndarray) -> np.ndarray:
    """(s, 2, 2) outline through points."""
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


def wedge(width: float, height: float) -> np.ndarray:
    return ring(np.array([[0.0, 0.0], [width, 0.0], [0.0, height]]))


def stars(count: int, slants: int, seed: int) -> list[list[Mask]]:
    """Bitmaps of star-shaped outlines at so many slants and their quarter turns."""
    rng, charts = np.random.default_rng(seed), []
    for _ in range(count):
        angle = np.sort(rng.random(7)) * 2.0 * np.pi
        points = rng.uniform(3.0, 11.0, (7, 1)) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        masks = []
        for slant in range(slants):
            masks.append(mask_of(ring(points @ rotation(slant * 0.5 * np.pi / slants).T), 0.5))
            for _ in range(3):
                masks.append(masks[-1].turned)
        charts.append(masks)
    return charts


def taken(charts: list[list[Mask]], found: Nest) -> np.ndarray:
    """How often each cell of the page is taken."""
    count = np.zeros((found.height, found.width), dtype=int)
    for chart, (turn, (column, row)) in enumerate(zip(found.mask.tolist(), found.place.tolist(), strict=True)):
        cells = charts[chart][turn].cells
        count[row : row + cells.shape[0], column : column + cells.shape[1]] += cells
    return count


def start_of(charts: list[list[Mask]]) -> Nest:
    found = nest(charts, np.arange(len(charts)), 40)
    assert found is not None
    return found


def test_the_depth_of_two_squares_is_the_way_out_along_an_axis() -> None:
    found = depths(np.ones((2, 2), bool), np.ones((3, 3), bool))
    assert found.tolist() == [[1, 1, 1, 1], [1, 2, 2, 1], [1, 2, 2, 1], [1, 1, 1, 1]]


def test_a_chart_in_the_hole_of_another_is_not_deep_in_it() -> None:
    frame = np.ones((5, 5), bool)
    frame[2, 2] = False
    found = depths(np.ones((1, 1), bool), frame)
    assert found[2, 2] == 0
    assert found[2, 1] == 1


def test_what_is_drawn_by_chance_is_splitmix() -> None:
    chance = Chance(1234567)
    assert [chance.below(2**31) for _ in range(3)] == [
        6457827717110365317 >> 33,
        3203168211198807973 >> 33,
        9817491932198370423 >> 33,
    ]


@pytest.mark.parametrize("extent", [(1.0, 1.0), (1.0, 0.6), (0.5, 1.0)])
def test_pages_become_smaller_and_no_cell_is_taken_twice(extent: tuple[float, float]) -> None:
    charts, page = stars(5, 2, 3), np.array(extent)
    start = start_of(charts)
    found = shrunk(charts, 4, page, start, QUICK, 0)
    sides = [one.side(page) for one in found]
    assert sides == sorted(sides)
    assert sides[-1] < start.side(page)
    for one in found:
        assert taken(charts, one).max() == 1


def test_two_wedges_become_a_square() -> None:
    charts = [[mask_of(wedge(20.0, 20.0) @ rotation(turn * np.pi / 2).T, 0.0) for turn in range(4)] for _ in range(2)]
    start = Nest(np.array([0, 0]), np.array([[0, 0], [30, 0]]), 60, 60)
    (best, *_) = shrunk(charts, 4, SQUARE, start, QUICK, 0)
    assert best.side(SQUARE) <= 25


@pytest.mark.skipif(kernel() is None, reason="nothing was compiled")
@pytest.mark.parametrize("seed", range(6))
def test_the_kernel_finds_the_same_layouts_to_the_bit(seed: int) -> None:
    charts, page = stars(2 + seed, 1 + seed % 3, seed), np.array([1.0, 1.0 - 0.1 * seed])
    config = replace(QUICK, memory=1 << 14) if seed % 2 else QUICK
    own = shrunk(charts, 4, page, start_of(charts), config, seed)
    with twins_only():
        twin = shrunk(charts, 4, page, start_of(charts), config, seed)
    assert len(own) == len(twin) > 0
    for one, other in zip(own, twin, strict=True):
        assert one.mask.tolist() == other.mask.tolist()
        assert one.place.tolist() == other.place.tolist()


def test_the_same_seed_gives_the_same_layout() -> None:
    charts = stars(5, 2, 1)
    one, other = (shrunk(charts, 4, SQUARE, start_of(charts), QUICK, 7) for _ in range(2))
    assert [nested.place.tolist() for nested in one] == [nested.place.tolist() for nested in other]


@pytest.mark.parametrize(("turns", "step"), [("off", 2.0 * np.pi), ("90", np.pi / 2.0)])
def test_charts_are_turned_no_more_than_allowed(turns: Rotation, step: float) -> None:
    outlines = [wedge(2.0, 1.0 + 0.2 * size) for size in range(5)]
    areas = np.array([1.0 + 0.2 * size for size in range(5)])
    config = replace(QUICK, start=NestConfig(side=48))
    found = find_separated(
        outlines, np.zeros(5, bool), areas, 0.01, config, np.random.default_rng(0), rotation=turns, extent=SQUARE
    )
    assert len(found) > 0
    for layout in found:
        assert np.abs(layout.angle / step - np.rint(layout.angle / step)).max() < 1e-9


def test_one_chart_or_very_many_are_left_alone() -> None:
    for count in (1, QUICK.most + 1):
        outlines, areas = [wedge(1.0, 1.0)] * count, np.full(count, 0.5)
        assert find_separated(outlines, np.zeros(count, bool), areas, 0.001, QUICK, np.random.default_rng(0)) == []
