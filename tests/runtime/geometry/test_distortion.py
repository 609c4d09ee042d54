"""Distortion of single faces: similarities, stretches and shears with known singular values."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.distortion import corner_angles, edge_lengths, singular_values, symmetric_dirichlet

RNG = np.random.default_rng(0)


def tilted(uv: np.ndarray) -> np.ndarray:
    basis = np.linalg.qr(RNG.normal(size=(3, 3)))[0][:2]
    return uv @ basis + RNG.normal(size=3)


def test_an_isometry_has_unit_singular_values() -> None:
    uv = RNG.normal(size=(50, 3, 2))
    assert singular_values(tilted(uv), uv) == pytest.approx(np.ones((2, 50)), abs=1e-9)


def test_singular_values_of_a_known_matrix_and_of_its_mirror_image() -> None:
    uv = RNG.normal(size=(50, 3, 2))
    for matrix in (np.array([[2.0, 1.0], [0.0, 0.5]]), np.array([[-2.0, 1.0], [0.0, 0.5]])):
        expected = np.linalg.svd(matrix, compute_uv=False)
        assert singular_values(tilted(uv), uv @ matrix.T) == pytest.approx(np.tile(expected[:, None], 50), rel=1e-7)


def test_a_face_without_area_has_zero_singular_values() -> None:
    line = np.array([[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]]])
    assert singular_values(line, RNG.normal(size=(1, 3, 2))).tolist() == [[0.0], [0.0]]


def test_symmetric_dirichlet_is_one_for_isometries_even_in_stretch_and_trimmed() -> None:
    energy = symmetric_dirichlet(np.array([1.0, 2.0, 1.0, 1.0]), np.array([1.0, 1.0, 0.5, 0.0]))
    assert energy.tolist() == [1.0, 1.5625, 1.5625, 100.0]


def test_angles_of_a_right_triangle_in_the_plane_and_in_space() -> None:
    uv = np.array([[[0.0, 0.0], [3.0, 0.0], [0.0, np.sqrt(3.0)]]])
    expected = np.array([[np.pi / 2, np.pi / 6, np.pi / 3]])
    assert corner_angles(uv) == pytest.approx(expected)
    assert corner_angles(tilted(uv)) == pytest.approx(expected)
    assert edge_lengths(tilted(uv)) == pytest.approx(np.array([[3.0, np.sqrt(12.0), np.sqrt(3.0)]]))


def test_tiny_angles_are_exact() -> None:
    assert corner_angles(np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1e-9]]]))[0, 0] == pytest.approx(1e-9, rel=1e-12)
