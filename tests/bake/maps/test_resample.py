"""Pictures are read where their uv says, wrapped as their sampler says, averaged over what a new texel covers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from flexpara.bake.colors.color import byte_to_linear
from flexpara.bake.maps.resample import (
    FootprintSampler,
    SourceTexture,
    footprint_grids,
    halved,
    linear_colors,
    texel_axes,
    wrapped,
)
from flexpara.runtime.material import Picture


def noise(height: int, width: int) -> np.ndarray:
    levels = np.random.default_rng(7).integers(0, 256, (height, width, 4)).astype(np.uint8)
    levels[..., 3] = 255
    return levels


def sample(image: np.ndarray, uv: Any, **changes: Any) -> np.ndarray:
    points = np.asarray(uv, np.float64)
    return SourceTexture(Picture(image, **changes), "color").sample(points[:, 0], points[:, 1], 0).T


def test_texel_centres_give_the_texels() -> None:
    image = noise(3, 5)
    row, column = np.mgrid[0:3, 0:5]
    uv = np.stack([(column + 0.5) / 5, 1 - (row + 0.5) / 3], axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(sample(image, uv), linear_colors(image).reshape(-1, 4), atol=1e-5)


def test_half_way_between_two_texels_is_their_mean_in_linear_light() -> None:
    image = np.zeros((1, 2, 4), np.uint8)
    image[0, 1] = 255
    np.testing.assert_allclose(sample(image, [[0.5, 0.5]]), [[0.5, 0.5, 0.5, 0.5]], atol=1e-6)


def test_a_picture_that_is_not_smooth_gives_its_nearest_texel() -> None:
    image = noise(2, 2)
    found = sample(image, [[0.49, 0.51], [0.51, 0.49]], smooth=False)
    np.testing.assert_allclose(found, linear_colors(image)[[0, 1], [0, 1]], atol=1e-6)


@pytest.mark.parametrize(
    ("wrap", "expected"),
    [
        ("repeat", [1, 2, 0, 1, 2, 0, 1, 2, 0]),
        ("mirror", [1, 0, 0, 1, 2, 2, 1, 0, 0]),
        ("clamp", [0, 0, 0, 1, 2, 2, 2, 2, 2]),
    ],
)
def test_three_texels_are_wrapped(wrap: Any, expected: list[int]) -> None:
    np.testing.assert_array_equal(wrapped(np.arange(-2.0, 7.0), 3, wrap), expected)


def test_each_axis_wraps_by_itself() -> None:
    image = noise(4, 4)
    linear = linear_colors(image)
    outside = [[1.125, 1.375]]  # u: column 0 again, or the last; v: the top row, or row 2 from the bottom
    np.testing.assert_allclose(sample(image, outside, wrap=("repeat", "clamp"))[0], linear[0, 0], atol=1e-6)
    np.testing.assert_allclose(sample(image, outside, wrap=("mirror", "repeat"))[0], linear[2, 3], atol=1e-6)
    np.testing.assert_allclose(sample(image, outside, wrap=("clamp", "mirror"))[0], linear[1, 3], atol=1e-6)


def test_repeating_filters_across_the_edge_and_clamping_does_not() -> None:
    image = noise(4, 4)
    linear = linear_colors(image)
    edge = [[0.0, 0.875]]
    np.testing.assert_allclose(sample(image, edge)[0], (linear[0, 0] + linear[0, 3]) / 2, atol=1e-5)
    np.testing.assert_allclose(sample(image, edge, wrap=("clamp", "clamp"))[0], linear[0, 0], atol=1e-5)


def test_far_tiles_keep_their_digits() -> None:
    image, uv = noise(4, 4), np.random.default_rng(3).random((50, 2))
    np.testing.assert_allclose(sample(image, uv + np.array([4000.0, -7000.0])), sample(image, uv), atol=1e-6)


def test_decodings_differ_in_what_a_level_means() -> None:
    image = np.full((1, 1, 4), 128, np.uint8)
    values = {
        kind: SourceTexture(Picture(image), kind).sample(np.full(1, 0.5), np.full(1, 0.5), 0)[:, 0]
        for kind in ("color", "data", "signed")
    }
    assert values["color"][0] == pytest.approx(0.2159, abs=1e-4)
    assert values["data"][0] == pytest.approx(128 / 255)
    assert values["signed"][0] == pytest.approx(1 / 255, abs=1e-6)
    assert [float(value[3]) for value in values.values()] == pytest.approx([128 / 255] * 3)


def test_halving_takes_means_and_keeps_odd_borders() -> None:
    image = np.arange(6, dtype=np.float32).reshape(1, 2, 3)
    np.testing.assert_array_equal(halved(image)[0], [[2.0, 3.5]])


def test_axes_of_one_triangle_by_hand() -> None:
    new = np.array([[[0, 0], [0.5, 0], [0, 0.5]]])  # 4 of 8 texels wide and high
    old = np.array([[[0, 0], [0, 2.0], [1.0, 0]]])  # u runs along new v, v along new u
    np.testing.assert_allclose(texel_axes(new, old, 8), [[[0, 0.5], [-0.25, 0]]])
    np.testing.assert_array_equal(texel_axes(np.zeros((1, 3, 2)), old, 8), np.zeros((1, 2, 2)))


def test_footprints_are_sampled_once_a_texel_of_the_picture_that_fits() -> None:
    axes = np.array([[[0.3, 0], [0, 0.9]], [[1.0, 0], [0, 3.0]], [[0, 8.0], [32.0, 0]]])
    counts, levels = footprint_grids(axes)
    np.testing.assert_array_equal(counts, [[1, 1], [1, 4], [1, 4]])
    np.testing.assert_array_equal(levels, [0, 0, 3])


@pytest.mark.parametrize("texels", [1, 2, 4, 8, 32])
def test_a_footprint_is_the_mean_of_the_texels_it_covers(texels: int) -> None:
    """A new texel that covers a whole block of old ones, in line with them, is their mean in linear light."""
    image = noise(64, 64)
    sampler = FootprintSampler(SourceTexture(Picture(image), "color"), np.array([np.diag([1, -1]) * texels / 64]))
    count = 64 // texels
    row, column = np.mgrid[0:count, 0:count]
    centre = np.stack([(column + 0.5) / count, 1 - (row + 0.5) / count], axis=-1).reshape(-1, 2)
    blocks = linear_colors(image).reshape(count, texels, count, texels, 4).mean(axis=(1, 3)).reshape(-1, 4)
    np.testing.assert_allclose(sampler.sample(centre, np.zeros(len(centre), np.int64)), blocks, atol=1e-5)


def test_a_placement_moves_what_is_read() -> None:
    image = noise(4, 4)
    turned = Picture(image, placement=((0.0, 1.0, 0.25), (-1.0, 0.0, 0.0)))
    sampler = FootprintSampler(SourceTexture(turned, "color"), np.zeros((1, 2, 2)))
    found = sampler.sample(np.array([[0.375, 0.625]]), np.zeros(1, np.int64))
    np.testing.assert_allclose(found, sample(image, [[0.875, -0.375]]), atol=1e-6)


def test_alpha_of_vertex_colours_is_not_curved() -> None:
    np.testing.assert_allclose(linear_colors(np.array([[0, 188, 255, 51]], np.uint8))[0], [0, 0.503, 1, 0.2], atol=2e-3)


def test_byte_to_linear_is_monotonic() -> None:
    assert (np.diff(byte_to_linear()) > 0).all()
