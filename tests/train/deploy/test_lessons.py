"""Samples for the deployed networks: seams and slits, their planes, and slopes of faces."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.runtime.mesh import Charts, Surface
from flexpara.train.deploy.config import SampleConfig
from flexpara.train.deploy.lessons import beside_seams, face_slopes, lesson_of, seams_of, spots_on

Cut = tuple[Surface, Charts]
FEW = SampleConfig(per_face=20, least=500, even=2000, beside=1000)


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def roof() -> Cut:
    """Two faces that meet at the y axis at a right angle: two charts."""
    vertices = np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, -1.0], [-1.0, 0.0, -1.0]])
    surface = Surface(vertices, np.array([[0, 2, 1], [0, 1, 3]]))
    return surface, Charts(np.array([0, 1]), surface.triangles[..., :2], np.array([0, 1]), np.arange(2), ("slim",) * 2)


def test_the_plane_of_a_seam_holds_its_edge_and_halves_the_angle() -> None:
    seams = seams_of(*roof())
    assert sorted(seams.half[0].tolist()) == [2, 3]
    assert seams.length.tolist() == [2.0]
    assert np.abs(seams.plane[0]) == pytest.approx([1.0, 0.0, 0.0, 0.0])


def test_points_beside_a_seam_lie_on_both_sides_of_its_plane() -> None:
    surface, charts = roof()
    spots = beside_seams(surface, seams_of(surface, charts), 200, 0.1, rng())
    xyz = np.einsum("nc,ncd->nd", spots.barycentric, surface.triangles[spots.face])
    away = np.einsum("nd,nd->n", xyz, spots.plane[:, :3]) + spots.plane[:, 3]
    assert np.bincount(spots.face).tolist() == [100, 100]
    assert len(set(np.sign(away[spots.face == 0]).tolist()) - {0.0}) == 1
    assert np.abs(xyz[:, [0, 2]]).max() <= 0.1 + 1e-12


def test_a_slit_is_a_seam_and_an_edge_inside_is_none(sheet: Surface) -> None:
    none = np.zeros(len(sheet.faces), np.int64)
    uv = sheet.triangles[..., :2].copy()
    whole = Charts(none, uv, none, np.zeros(1, np.int64), ("slim",))
    assert len(seams_of(sheet, whole).half) == 0
    torn = uv.copy()
    right = (sheet.triangles[..., 0].mean(axis=1) > 0.0) & (sheet.triangles[..., 1].mean(axis=1) > 0.0)
    torn[right] += [0.3, 0.0]
    slit = seams_of(sheet, replace(whole, corner_uv=torn))
    assert len(slit.half) > 5
    assert np.abs(slit.start[:, :2]).min(axis=1).max() < 1e-9


def test_a_lesson_holds_uv_chart_and_slope_of_each_place(two_halves: Cut) -> None:
    surface, charts = two_halves
    lesson = lesson_of(surface, charts, FEW, rng())
    right = lesson.label == 1
    assert (right == (lesson.x[:, 0] > 0.0))[np.abs(lesson.x[:, 0]) > 1e-9].all()
    assert lesson.y[~right] == pytest.approx(lesson.x[~right, :2])
    assert lesson.y[right] == pytest.approx(np.column_stack([5.0 - lesson.x[right, 1], lesson.x[right, 0] - 3.0]))
    assert lesson.slope[right][0] == pytest.approx(np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]))


def test_the_smallest_chart_gets_its_share() -> None:
    """A hair beside a square: evenly by area it would get nothing."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2 + 1e-5, 0, 0], [2, 1e-5, 0]])
    surface = Surface(vertices, np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6]]))
    chart = np.array([0, 0, 1])
    charts = Charts(chart, surface.triangles[..., :2], chart, np.arange(2), ("slim",) * 2)
    spots = spots_on(surface, charts, FEW, rng())
    assert np.count_nonzero(charts.face_chart[spots.face] == 1) == FEW.fewest


def test_slopes_of_faces_are_exact_in_their_plane_and_nothing_across() -> None:
    surface, _ = roof()
    slope = np.array([[1.0, 2.0, 3.0], [-1.0, 0.5, 0.0]])
    found = face_slopes(surface.triangles, surface.triangles @ slope.T)
    normal = surface.face_normals()
    across = np.einsum("mk,fk,fd->fmd", slope, normal, normal)
    assert found == pytest.approx(slope - across)


def test_a_face_without_area_says_nothing() -> None:
    triangles = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], [[1.0, 1.0, 1.0]] * 3])
    assert not face_slopes(triangles, np.ones((2, 3, 2))).any()
