"""Charts too long for their page: a ribbon of squares by hand, what stays whole, and a knotted tube."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.mesh import Surface
from flexpara.runtime.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.charts import chart_surface
from flexpara.train.charts.shorten import along, shortened
from flexpara.train.config import FinishConfig
from flexpara.train.finish.pieces import measured
from flexpara.train.finish.slits import Flat

CONFIG = FinishConfig()


def ribbon(squares: int) -> Surface:
    """A row of unit squares, each of two triangles."""
    x, y = np.meshgrid(np.arange(squares + 1.0), [0.0, 1.0], indexing="ij")
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    halves = np.array([[0, 2, 3], [0, 3, 1]])
    return Surface(vertices, (halves[:, None] + 2 * np.arange(squares)[:, None]).reshape(-1, 3))


def charts_of(squares: int, most: int) -> list[np.ndarray]:
    found = chart_surface(ribbon(squares), most, CONFIG, 0, Stages())
    return [piece.ids for piece in found.pieces]


def test_a_chart_lies_along_its_longest_direction() -> None:
    row = ribbon(6)
    piece = measured(row, np.arange(12), Flat(row, row.vertices[:, :2], {}), 6.0)
    place, length = along(piece)
    assert length == pytest.approx(6.0, rel=0.01)
    assert np.sort(np.minimum(place, 1.0 - place)).max() <= 0.5
    assert np.ptp(place) == pytest.approx((6.0 - 2.0 / 3.0) / 6.0, rel=0.01)


def test_a_long_ribbon_is_cut_across_its_squares() -> None:
    charts = charts_of(30, 8)
    assert len(charts) == int(np.ceil(np.sqrt(30.0) / CONFIG.shorten.to))
    for ids in charts:  # a square's triangles are ids n and n + 30
        assert sorted(ids[ids < 30].tolist()) == sorted((ids[ids >= 30] - 30).tolist())


@pytest.mark.parametrize(("squares", "most"), [(4, 8), (30, 1)])
def test_a_ribbon_stays_whole_where_it_is_short_or_one_chart_is_asked_for(squares: int, most: int) -> None:
    assert len(charts_of(squares, most)) == 1


def test_a_part_gets_no_more_charts_than_asked_for() -> None:
    assert len(charts_of(200, 3)) == 3


def test_the_page_is_that_of_the_whole_surface() -> None:
    row = ribbon(30)
    piece = measured(row, np.arange(60), Flat(row, row.vertices[:, :2], {}), 1.0)
    assert len(shortened(row, [piece], 20.0, 8, CONFIG)) == 1
    assert len(shortened(row, [piece], 5.0, 8, CONFIG)) > 1


def test_a_knotted_tube_is_no_longer_than_its_page_allows() -> None:
    knot = Surface(*make_sample("trefoil", resolution=24))
    found = chart_surface(knot, 8, CONFIG, 0, Stages())
    page = np.sqrt(knot.face_areas().sum())
    assert max(along(piece)[1] for piece in found.pieces) < CONFIG.shorten.above * page
