"""Distortion of single faces: similarities, stretches and shears with known singular values."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.distortion import excess, oriented_energy, singular_values, symmetric_dirichlet

RNG = np.random.default_rng(0)


def test_an_isometry_has_unit_singular_values() -> None:
    turn = np.linalg.qr(RNG.normal(size=(50, 2, 2)))[0]
    assert singular_values(turn) == pytest.approx(np.ones((2, 50)), abs=1e-12)


def test_singular_values_are_those_of_the_decomposition_mirror_images_included() -> None:
    jacobian = RNG.normal(size=(50, 2, 2))
    assert (np.linalg.det(jacobian) < 0.0).any()
    assert singular_values(jacobian) == pytest.approx(np.linalg.svd(jacobian, compute_uv=False).T)


def test_a_map_to_a_point_has_zero_singular_values() -> None:
    assert singular_values(np.zeros((1, 2, 2))).tolist() == [[0.0], [0.0]]


def test_symmetric_dirichlet_is_one_for_isometries_and_even_in_stretch() -> None:
    energy = symmetric_dirichlet(np.array([1.0, 2.0, 1.0]), np.array([1.0, 1.0, 0.5]))
    assert energy.tolist() == [1.0, 1.5625, 1.5625]


def test_symmetric_dirichlet_of_a_collapsed_face_is_finite_and_large() -> None:
    assert 1e20 < symmetric_dirichlet(np.array([1.0]), np.array([0.0]))[0] < np.inf


def test_the_oriented_energy_is_the_symmetric_dirichlet_energy_and_infinite_for_flips_and_collapses() -> None:
    jacobian = RNG.normal(size=(50, 2, 2))
    flipped = np.linalg.det(jacobian) < 0.0
    found = oriented_energy(jacobian)
    assert np.isinf(found[flipped]).all()
    assert found[~flipped] == pytest.approx(symmetric_dirichlet(*singular_values(jacobian))[~flipped])
    assert np.isinf(oriented_energy(np.zeros((1, 2, 2)))).all()


def test_the_excess_of_a_face_is_capped() -> None:
    assert excess(np.array([1.0, 1.5, 30.0, np.inf])).tolist() == [0.0, 0.5, 10.0, 10.0]
    assert excess(np.array([1.0 - 1e-16, 0.5])).tolist() == [0.0, 0.0]
