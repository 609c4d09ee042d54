"""Charts on several pages: shared out evenly, at one density, each page valid for itself."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.mesh import Asset, Charts, Surface
from flexpara.runtime.pack.pages import chart_pages, on_tiles, pack_pages
from flexpara.runtime.pack.square import Square


def squares(sides: list[float]) -> tuple[Asset, Charts]:
    """One square a chart, each two triangles, beside each other along x."""
    corner = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)
    moved = [corner * side + [2.0 * number * max(sides), 0, 0] for number, side in enumerate(sides)]
    positions = np.concatenate(moved)
    faces = np.concatenate([np.array([[0, 1, 2], [0, 2, 3]]) + 4 * number for number in range(len(sides))])
    chart = np.repeat(np.arange(len(sides)), 2)
    charts = Charts(chart, positions[faces][..., :2], chart, np.arange(len(sides)), ("flat",) * len(sides))
    return Asset(positions, faces, np.arange(len(positions)), Surface(positions, faces)), charts


def density(asset: Asset, corner_uv: NDArray[np.floating]) -> NDArray[np.float64]:
    """Uv per source unit of each face: here along the first edge."""
    flat, own = asset.positions[asset.faces], corner_uv.astype(np.float64)
    length = np.linalg.norm(own[:, 1] - own[:, 0], axis=1)
    return length / np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1)


def test_the_largest_charts_go_to_pages_of_their_own() -> None:
    _, charts = squares([1, 4, 3, 1])
    page = chart_pages(charts, 2)
    assert page.tolist() == [1, 0, 1, 1]


def test_eight_equal_squares_on_two_pages_are_twice_as_dense_in_area() -> None:
    asset, charts = squares([1.0] * 8)
    one = pack_pages(asset, charts, Square(256, 0), 1)
    two = pack_pages(asset, charts, Square(256, 0), 2)
    assert sorted(two.report["pages"]) == [4, 4]
    assert one.page.max() == 0
    assert density(asset, two.corner_uv)[0] == pytest.approx(0.5, rel=1e-3)
    assert density(asset, two.corner_uv)[0] / density(asset, one.corner_uv)[0] > 1.4


def test_all_pages_have_the_density_of_the_fullest() -> None:
    asset, charts = squares([2.0, 1.0, 1.0, 1.0, 0.5])
    paged = pack_pages(asset, charts, Square(256, 2), 2)
    found = density(asset, paged.corner_uv)
    assert np.ptp(found) < 1e-6 * found.mean()
    assert len(paged.invalid) == 0
    assert (paged.corner_uv >= 2 / 256 - 1e-6).all()
    assert (paged.corner_uv <= 1 - 2 / 256 + 1e-6).all()


def test_tiles_are_ten_in_a_row() -> None:
    asset, charts = squares([1.0] * 12)
    paged = pack_pages(asset, charts, Square(64, 1), 12)
    tile = np.floor(on_tiles(paged)).astype(int)
    assert (tile == tile[:, :1]).all()
    places = {tuple(place) for place in tile[:, 0].tolist()}
    assert places == {(number % 10, number // 10) for number in range(12)}


def test_more_pages_than_charts_stay_empty() -> None:
    asset, charts = squares([1.0, 1.0])
    paged = pack_pages(asset, charts, Square(64, 1), 5)
    assert paged.page.max() == 1
    assert paged.report["pages"] == [1, 1, 0, 0, 0]
