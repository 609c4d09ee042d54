"""Formulas of triangles: right triangles by hand, then identities between the formulas on random ones."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.triangles import (
    corner_angles,
    cross_2d,
    edge_lengths,
    jacobians,
    signed_areas,
    triangle_areas,
    triangle_cross,
    triangle_normals,
)

RNG = np.random.default_rng(0)
RIGHT = np.array([[[0.0, 0.0, 5.0], [3.0, 0.0, 5.0], [0.0, 4.0, 5.0]]])
LINE = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]])


def tilted(uv: np.ndarray) -> np.ndarray:
    basis = np.linalg.qr(RNG.normal(size=(3, 3)))[0][:2]
    return uv @ basis + RNG.normal(size=3)


def test_the_cross_product_of_the_axes_is_one_and_integers_stay_integers() -> None:
    found = cross_2d(np.array([[1, 0], [0, 1]]), np.array([[0, 1], [1, 0]]))
    assert found.tolist() == [1, -1]
    assert found.dtype == np.int64


def test_the_signed_area_of_a_triangle_its_mirror_image_and_its_shadow() -> None:
    unit = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    assert signed_areas(np.stack([unit, unit[::-1], unit * [1.0, 0.0]])).tolist() == [0.5, -0.5, 0.0]


def test_area_and_normal_of_a_right_triangle() -> None:
    assert triangle_areas(RIGHT).tolist() == [6.0]
    assert triangle_cross(RIGHT).tolist() == [[0.0, 0.0, 12.0]]
    assert triangle_normals(RIGHT).tolist() == [[0.0, 0.0, 1.0]]
    assert triangle_normals(RIGHT[:, ::-1]).tolist() == [[0.0, 0.0, -1.0]]


def test_a_triangle_on_a_line_has_no_area_and_no_normal() -> None:
    assert triangle_areas(LINE).tolist() == [0.0]
    assert triangle_normals(LINE).tolist() == [[0.0, 0.0, 0.0]]


def test_areas_in_space_are_those_in_the_plane() -> None:
    uv = RNG.normal(size=(50, 3, 2))
    assert triangle_areas(tilted(uv)) == pytest.approx(np.abs(signed_areas(uv)))


def test_leading_axes_are_kept() -> None:
    triangles = RNG.normal(size=(4, 5, 3, 3))
    assert triangle_areas(triangles) == pytest.approx(triangle_areas(triangles.reshape(-1, 3, 3)).reshape(4, 5))
    assert np.linalg.norm(triangle_normals(triangles), axis=-1) == pytest.approx(np.ones((4, 5)))


def test_angles_and_edges_of_a_right_triangle_in_the_plane_and_in_space() -> None:
    uv = np.array([[[0.0, 0.0], [3.0, 0.0], [0.0, np.sqrt(3.0)]]])
    expected = np.array([[np.pi / 2, np.pi / 6, np.pi / 3]])
    assert corner_angles(uv) == pytest.approx(expected)
    assert corner_angles(tilted(uv)) == pytest.approx(expected)
    assert edge_lengths(tilted(uv)) == pytest.approx(np.array([[3.0, np.sqrt(12.0), np.sqrt(3.0)]]))


def test_tiny_angles_are_exact() -> None:
    assert corner_angles(np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1e-9]]]))[0, 0] == pytest.approx(1e-9, rel=1e-12)


def test_angles_of_a_triangle_add_up_to_half_a_turn() -> None:
    assert corner_angles(RNG.normal(size=(50, 3, 3))).sum(axis=1) == pytest.approx(np.full(50, np.pi))


def test_the_jacobian_of_a_stretched_right_triangle_is_diagonal() -> None:
    uv = RIGHT[:, :, :2] * [2.0, 0.5]
    assert jacobians(RIGHT, uv) == pytest.approx(np.array([[[2.0, 0.0], [0.0, 0.5]]]))


def test_the_determinant_of_the_jacobian_is_the_ratio_of_areas() -> None:
    uv, triangles = RNG.normal(size=(50, 3, 2)), RNG.normal(size=(50, 3, 3))
    assert np.linalg.det(jacobians(triangles, uv)) == pytest.approx(signed_areas(uv) / triangle_areas(triangles))


def test_the_jacobian_of_a_triangle_without_area_is_zero() -> None:
    assert not jacobians(LINE, RNG.normal(size=(1, 3, 2))).any()
