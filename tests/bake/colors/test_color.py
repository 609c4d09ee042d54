"""The sRGB curve is the standard's; chart colours differ."""

from __future__ import annotations

import numpy as np

from flexpara.bake.colors.color import (
    byte_to_linear,
    chart_colors,
    linear_from_oklab,
    linear_from_srgb,
    srgb_bytes_from_linear,
    srgb_exact,
    srgb_from_linear,
)


def test_known_values_of_the_curve() -> None:
    np.testing.assert_allclose(
        linear_from_srgb(np.array([0.0, 0.04045, 0.5, 1.0])), [0, 0.0031308, 0.2140411, 1], atol=1e-6
    )


def test_the_curve_and_its_inverse_cancel() -> None:
    value = np.linspace(0.0, 1.0, 1001)
    np.testing.assert_allclose(srgb_exact(linear_from_srgb(value)), value, atol=1e-7)


def test_the_table_follows_the_curve() -> None:
    value = np.linspace(0.0, 1.0, 300_001).astype(np.float32)
    assert np.abs(srgb_from_linear(value) - srgb_exact(value)).max() < 1e-6


def test_every_8_bit_level_survives_linear_light() -> None:
    np.testing.assert_array_equal(srgb_bytes_from_linear(byte_to_linear()), np.arange(256))


def test_values_outside_the_range_are_clamped() -> None:
    outside = np.array([-1.0, 2.0, 1e9], np.float32)
    np.testing.assert_array_equal(srgb_bytes_from_linear(outside), [0, 255, 255])
    np.testing.assert_allclose(srgb_from_linear(outside), [0, 1, 1], atol=1e-6)


def test_white_and_black_of_oklab() -> None:
    np.testing.assert_allclose(
        linear_from_oklab(np.array([[1.0, 0, 0], [0.0, 0, 0]])), [[1, 1, 1], [0, 0, 0]], atol=1e-6
    )


def test_chart_colors_are_distinct() -> None:
    levels = srgb_bytes_from_linear(chart_colors(64)).astype(int)
    apart = np.abs(levels[:, None] - levels[None]).sum(axis=-1)
    assert apart[~np.eye(64, dtype=bool)].min() >= 10
    assert np.diagonal(apart, 1).min() >= 80  # neighbouring numbers differ plainly
