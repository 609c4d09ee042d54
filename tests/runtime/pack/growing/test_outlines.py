"""Outlines of charts: a square of two triangles, a slit, and rectangles that stand upright again."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.errors import FinishError
from flexpara.runtime.mesh import Charts
from flexpara.runtime.pack.config import GrowthConfig
from flexpara.runtime.pack.growing.outlines import (
    chart_outlines,
    is_straight,
    outline_edges,
    rotation,
    upright_angle,
)

FACES = np.array([[0, 1, 2], [0, 2, 3]])
QUAD = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])


def charts_of(corner_uv: NDArray[np.float64], chart: list[int]) -> Charts:
    label = np.array(chart)
    return Charts(label, corner_uv, label, np.arange(max(chart) + 1), ("slim",) * (max(chart) + 1))


def test_the_diagonal_of_a_quad_is_no_outline() -> None:
    charts = charts_of(QUAD[FACES], [0, 0])
    edges = outline_edges(FACES, charts)
    assert edges.tolist() == [[True, True, False], [False, True, True]]
    (outline,) = chart_outlines(charts, edges)
    assert outline.tolist() == [[[0, 0], [2, 0]], [[2, 0], [2, 1]], [[2, 1], [0, 1]], [[0, 1], [0, 0]]]


def test_it_is_one_where_two_charts_meet_or_uv_differ() -> None:
    assert outline_edges(FACES, charts_of(QUAD[FACES], [0, 1])).all()
    apart = QUAD[FACES] + np.array([0.0, 5.0])[:, None, None]
    assert outline_edges(FACES, charts_of(apart, [0, 0])).all()


def test_a_closed_chart_is_named() -> None:
    charts = charts_of(QUAD[FACES], [0, 0])
    with pytest.raises(FinishError, match="chart 0 is closed"):
        chart_outlines(charts, np.zeros((2, 3), dtype=bool))


@pytest.mark.parametrize("angle", [0.0, 0.3, 1.0, 2.5, -4.0])
def test_a_rectangle_stands_upright_again(angle: float) -> None:
    outline = chart_outlines(charts_of(QUAD[FACES], [0, 0]), outline_edges(FACES, charts_of(QUAD[FACES], [0, 0])))[0]
    turned = outline @ rotation(angle).T
    upright = turned @ rotation(upright_angle(turned)).T
    assert sorted(np.ptp(upright.reshape(-1, 2), axis=0).tolist()) == pytest.approx([1.0, 2.0])


def test_points_on_a_line_lie_flat() -> None:
    line = np.array([[[0.0, 0.0], [3.0, 4.0]], [[3.0, 4.0], [0.0, 0.0]]])
    turned = line @ rotation(upright_angle(line)).T
    assert sorted(np.ptp(turned.reshape(-1, 2), axis=0).tolist()) == pytest.approx([0.0, 5.0], abs=1e-12)


def test_a_pole_alone_is_turned_so_that_its_bounding_square_is_small() -> None:
    charts = charts_of(QUAD[FACES] * [5.0, 0.1], [0, 0])
    (pole,) = chart_outlines(charts, outline_edges(FACES, charts))
    turned = pole @ rotation(upright_angle(pole, np.ones(2))).T
    assert np.ptp(turned.reshape(-1, 2), axis=0).max() == pytest.approx(10.1 * np.sqrt(0.5), rel=0.01)


def test_an_outline_is_straight_where_most_of_it_runs_along_the_axes() -> None:
    charts = charts_of(QUAD[FACES], [0, 0])
    (upright,) = chart_outlines(charts, outline_edges(FACES, charts))
    assert is_straight(upright, GrowthConfig())
    assert not is_straight(upright @ rotation(0.1).T, GrowthConfig())
    (triangle,) = chart_outlines(charts_of(QUAD[FACES[:1]], [0]), np.ones((1, 3), dtype=bool))
    assert not is_straight(triangle, GrowthConfig())
