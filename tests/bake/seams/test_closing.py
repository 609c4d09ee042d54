"""Closing seams shares noise out: both sides agree better than before, and no texel leaves its neighbours' range."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import sparse
from scipy.optimize import lsq_linear

from flexpara.bake.bakemap import BakeMap
from flexpara.bake.baker import bake
from flexpara.bake.raster.gbuffer import GBuffer
from flexpara.bake.seams.closing import ClosingConfig, bounded_least_squares, closed_seams, neighbour_range
from flexpara.bake.seams.seamcheck import SeamSamples, find_seams, sample_seams
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]
MakeGBuffer = Callable[[Atlas, int], GBuffer]
SIZE = 128


def halves(left: float, right: float) -> tuple[np.ndarray, SeamSamples, np.ndarray]:
    """Four texels in a row, the outer ones inside charts; one sample between each outer one and its inner neighbour."""
    image = np.array([[[left], [left], [right], [right]]], np.float32)
    texel = np.array([[0, 1, 0, 0, 3, 2, 3, 3]])
    weight = np.array([[0.5, 0.5, 0, 0, -0.5, -0.5, 0, 0]])
    return image, SeamSamples(texel, weight), np.array([[True, False, False, True]])


def test_two_constants_meet_in_the_middle() -> None:
    """Each free texel makes up half of the difference of the outer ones, which is within their range."""
    image, samples, inside = halves(0.2, 0.4)
    texel, value = closed_seams(image, samples, inside, ClosingConfig(beside=1e-9))
    assert texel.tolist() == [1, 2]
    np.testing.assert_allclose(value[:, 0], [0.4, 0.2], atol=1e-4)


def test_what_rays_estimated_moves_inside_too() -> None:
    image, samples, inside = halves(0.2, 0.4)
    texel, value = closed_seams(image, samples, inside, ClosingConfig(beside=1.0, inside=1.0), estimated=True)
    assert texel.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(value[:, 0], [0.25, 0.25, 0.35, 0.35], atol=1e-4)  # d / (4 · ¼ + 1) of ½ each


def test_neighbours_are_the_texels_inside_on_both_sides() -> None:
    _, samples, inside = halves(0.0, 0.0)
    value = np.array([[0.1], [9.0], [-9.0], [0.7]])
    low, high = neighbour_range(value, samples.texel, inside.reshape(-1))
    np.testing.assert_array_equal(low, np.full((4, 1), 0.1))
    np.testing.assert_array_equal(high, np.full((4, 1), 0.7))
    low, high = neighbour_range(value, samples.texel, np.zeros(4, np.bool_))
    np.testing.assert_array_equal([low.min(), high.max()], [-9.0, 9.0])


@pytest.mark.parametrize("bound", [0.05, 0.5, 50.0])
def test_the_solver_agrees_with_scipy_s(bound: float) -> None:
    rng = np.random.default_rng(3)
    matrix, right = rng.normal(size=(30, 12)), rng.normal(size=30)
    system = sparse.csr_matrix(matrix.T @ matrix)
    low, high = -bound * rng.random((12, 1)), bound * rng.random((12, 1))
    config = ClosingConfig(steps=5000, accuracy=1e-12)
    found = bounded_least_squares(system, (matrix.T @ right)[:, None], (low, high), config)
    wanted = lsq_linear(matrix, right, (low[:, 0], high[:, 0]), tol=1e-12).x
    np.testing.assert_allclose(found[:, 0], wanted, atol=1e-5)
    assert ((found >= low) & (found <= high)).all()


def noisy(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Half light with the noise of 64 rays, another one in each texel."""
    del atlas, asset
    return np.random.default_rng(7).normal(0.5, 0.03, (*gbuffer.shape, 1)).astype(np.float32)


def test_noise_is_not_amplified(make_gbuffer: MakeGBuffer, sphere: Pair) -> None:
    maps = [
        BakeMap(name, "none", "share", "[0, 1]", "unit", "png", 8, noisy, (1.0,) * 3, estimated=True) for name in "a"
    ]
    samples, inside = sample_seams(find_seams(sphere[0]), SIZE), make_gbuffer(sphere[0], SIZE).inside
    raw = bake(*sphere, maps, size=SIZE, padding=0)["a"].pixels
    closed = bake(*sphere, maps, size=SIZE, padding=4)["a"].pixels
    before = np.where(inside[..., None], raw, np.float32(0.5))
    assert np.abs(samples.differences(closed)).max() < 0.5 * np.abs(samples.differences(before)).max()
    texel = np.unique(samples.texel)
    place = np.searchsorted(texel, samples.texel)
    flat = raw.reshape(-1, 1).astype(np.float64)
    low, high = neighbour_range(flat[texel], place, inside.reshape(-1)[texel])
    moved = closed.reshape(-1, 1)[texel]
    assert ((moved >= low - 1e-6) & (moved <= high + 1e-6)).all()
    far = np.setdiff1d(np.flatnonzero(inside), texel)
    np.testing.assert_array_equal(closed.reshape(-1)[far], raw.reshape(-1)[far])
