"""Charts too long for their page: a ribbon of squares by hand, what stays whole, and a knotted tube."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.charts import chart_surface
from flexpara.train.charts.shorten import Page, page_side, shortened
from flexpara.train.config import FinishConfig
from flexpara.train.finish.contact import boundary_edges
from flexpara.train.finish.pieces import Piece, measured
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


def border(piece: Piece) -> float:
    ends = piece.flat.uv[boundary_edges(piece.flat.surface.faces)]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def test_a_long_ribbon_is_cut_across_its_squares() -> None:
    charts = charts_of(30, 8)
    assert len(charts) > 2
    assert max(map(len, charts)) <= 2 * np.sqrt(60.0) / CONFIG.shorten.full
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
    assert len(shortened(row, [piece], Page(20.0, 8), CONFIG)) == 1
    assert len(shortened(row, [piece], Page(5.0, 8), CONFIG)) > 1


def test_arms_that_branch_are_cut_off_where_they_are_narrow() -> None:
    """A cross of four arms, twenty long and one wide: cut at the joint, never along an arm."""
    rows = [(x, 0) for x in range(-20, 21)] + [(0, y) for y in range(-20, 21) if y]
    corner = np.array([[0, 0], [1, 0], [1, 1], [0, 1]])
    places, index = np.unique((np.array(rows)[:, None] + corner).reshape(-1, 2), axis=0, return_inverse=True)
    quads = index.reshape(-1, 4)
    vertices = np.column_stack([places, np.zeros(len(places))]).astype(np.float64)
    cross = Surface(vertices, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]))
    piece = measured(cross, np.arange(len(cross.faces)), Flat(cross, cross.vertices[:, :2], {}), 1.0)
    found = shortened(cross, [piece], Page(float(np.sqrt(len(rows))), 8), CONFIG)
    assert len(found) >= 2
    assert max(page_side(part.flat.uv) for part in found) < 0.8 * page_side(piece.flat.uv)
    added = sum(map(border, found)) - border(piece)
    assert added <= 2.0 * np.sqrt(2.0) * (len(found) - 1) + 1e-9


def test_a_polygon_is_never_cut() -> None:
    """A ribbon of 30 squares, each of two triangles: as a single polygon it stays whole, as pairs it is cut between."""
    row = ribbon(30)
    piece = measured(row, np.arange(60), Flat(row, row.vertices[:, :2], {}), 1.0)
    side = float(np.sqrt(30.0))
    assert len(shortened(row, [piece], Page(side, 8, np.zeros(60, np.int64)), CONFIG)) == 1
    pairs = np.arange(60) % 30 // 2
    found = shortened(row, [piece], Page(side, 8, pairs), CONFIG)
    assert len(found) > 1
    assert sum(len(np.unique(pairs[part.ids])) for part in found) == 15


def test_a_knotted_tube_is_no_longer_than_its_page_allows() -> None:
    knot = Surface(*make_sample("trefoil", resolution=24))
    found = chart_surface(knot, 8, CONFIG, 0, Stages())
    page = np.sqrt(knot.face_areas().sum())
    assert max(page_side(piece.flat.uv) for piece in found.pieces) < 1.5 * page
