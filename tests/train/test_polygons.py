"""Seams leave the diagonals of polygons where there is room beside them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.mesh import Charts, Polygons, Surface
from flexpara.train.polygons import whole_polygons


def quads(columns: int, rows: int) -> tuple[Surface, Polygons]:
    """A flat grid of unit quads, each two triangles."""
    x, y = (line.reshape(-1) for line in np.meshgrid(np.arange(columns + 1), np.arange(rows + 1), indexing="ij"))
    first = (np.arange(columns)[:, None] * (rows + 1) + np.arange(rows)).reshape(-1)
    corner = np.stack([first, first + rows + 1, first + rows + 2, first + 1], axis=1)
    faces = corner[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    places = np.arange(4 * len(corner)).reshape(-1, 4)[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    vertices = np.column_stack([x, y, np.zeros(len(x))]).astype(np.float64)
    return Surface(vertices, faces.astype(np.int64)), Polygons(places, np.full(len(corner), 4))


def cut_in_two(surface: Surface, second: np.ndarray) -> Charts:
    """Charts of the flat grid as it lies: faces of the second one ten units aside."""
    uv = surface.triangles[:, :, :2].copy()
    uv[second] += (10.0, 0.0)
    chart = second.astype(np.int64)
    return Charts(chart, uv, chart, np.arange(2), ("slim", "slit"))


def halves(charts: Charts) -> np.ndarray:
    """(p,) bool: quads whose two triangles are not joined."""
    pairs, uv = charts.face_chart.reshape(-1, 2), charts.corner_uv
    apart = (uv[::2, 0] != uv[1::2, 0]).any(axis=1) | (uv[::2, 2] != uv[1::2, 1]).any(axis=1)
    return (pairs[:, 0] != pairs[:, 1]) | apart


def test_a_quad_cut_in_two_goes_to_one_side_as_it_lies_there() -> None:
    surface, polygons = quads(4, 3)
    middle = surface.triangles.mean(axis=1)[:, 0]
    second = middle > 2.0
    second[[12, 14]] = False  # the lower triangles of two quads of the third column
    charts = cut_in_two(surface, second)
    assert halves(charts).sum() == 2
    found = whole_polygons(surface, charts, polygons)
    assert not halves(found).any()
    assert not flipped_triangles(found.corner_uv).any()
    assert len(overlapping_pairs(found.corner_uv)) == 0
    for chart in range(2):
        own = found.face_chart == chart
        shift = found.corner_uv[own] - surface.triangles[own][:, :, :2]
        np.testing.assert_allclose(shift, np.broadcast_to(shift[0, 0], shift.shape), atol=1e-12)
    assert found.method == ("slim", "slit")


def test_charts_without_cut_polygons_are_the_very_same() -> None:
    surface, polygons = quads(2, 2)
    charts = cut_in_two(surface, np.arange(8) >= 4)
    assert whole_polygons(surface, charts, polygons) is charts


def test_a_polygon_without_room_stays_cut() -> None:
    surface, polygons = quads(1, 1)
    charts = cut_in_two(surface, np.array([False, True]))
    blocked = surface.triangles[[1, 0]][:, :, :2]  # something lies where either triangle would go
    uv = np.concatenate([charts.corner_uv, blocked + np.array([[[0.0, 0.0]], [[10.0, 0.0]]])])
    vertices = np.concatenate([surface.vertices, surface.vertices + np.array([0, 0, 5])])
    faces = np.concatenate([surface.faces, surface.faces[[1, 0]] + 4])
    both = Charts(np.array([0, 1, 0, 1]), uv, np.array([0, 1, 0, 1]), np.arange(2), ("slim", "slim"))
    corner = np.concatenate([polygons.corner, [[4, 5, 6], [7, 8, 9]]])
    apart = replace(polygons, corner=corner, size=np.array([4, 3, 3]))
    found = whole_polygons(Surface(vertices, faces), both, apart)
    assert found.face_chart[0] != found.face_chart[1]
    assert len(overlapping_pairs(found.corner_uv[:2])) == 0
