"""Means over the covered samples of a texel: by hand."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.bake.raster.supersample import averaged, covered_texels, first_covered, samples_along
from flexpara.runtime.errors import InputError

PIXELS = np.array([[1, 3, 0, 0], [5, 7, 8, 0]], np.float32)[..., None]
HELD = np.array([[1, 1, 0, 0], [0, 1, 1, 0]], np.bool_)


def test_the_mean_counts_covered_samples_only() -> None:
    np.testing.assert_allclose(averaged(PIXELS, HELD, 2)[..., 0], [[11 / 3, 8.0]])
    np.testing.assert_array_equal(covered_texels(HELD, 2), [[True, True]])


def test_the_first_covered_sample_is_no_mean() -> None:
    np.testing.assert_array_equal(first_covered(PIXELS, HELD, 2)[..., 0], [[1.0, 8.0]])


def test_a_texel_without_samples_is_0() -> None:
    nothing = np.zeros_like(HELD)
    assert not averaged(PIXELS, nothing, 2).any()
    assert not first_covered(PIXELS, nothing, 2).any()
    assert not covered_texels(nothing, 2).any()


def test_unit_vectors_stay_unit_and_opposite_ones_do_not_vanish() -> None:
    pixels = np.array([[[1, 0, 0], [0, 1, 0], [0, 0, 1], [0, 0, -1]]] * 2, np.float32)
    mean = averaged(pixels, np.ones((2, 4), np.bool_), 2, unit=True)
    np.testing.assert_allclose(mean[0, 0], [0.5**0.5, 0.5**0.5, 0.0], atol=1e-6)
    np.testing.assert_array_equal(mean[0, 1], [0, 0, 1])


def test_1_4_and_16_samples_are_squares() -> None:
    assert [samples_along(n) for n in (1, 4, 16)] == [1, 2, 4]
    with pytest.raises(InputError, match="samples 9: expected one of 1, 4, 16"):
        samples_along(9)
