"""The denoiser: noise goes, borders and vectors stay, and its absence is said before the work."""

from __future__ import annotations

import sys
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.bake.bakemap import BakeMap
from flexpara.bake.baker import bake
from flexpara.bake.denoise import denoised, nearby_range
from flexpara.bake.maps.catalogue import find_map
from flexpara.bake.maps.rays import RaySettings
from flexpara.runtime.errors import MissingDependencyError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from flexpara.bake.raster.gbuffer import GBuffer
    from flexpara.runtime.mesh import Asset, Atlas

    Pair = tuple[Atlas, Asset]

pytest.importorskip("pyoidn")

SIZE = 128
AO = find_map("ao")


def steps(size: int = SIZE) -> NDArray[np.float32]:
    """Half light left, full light right: (size, size, 1)."""
    image = np.full((size, size, 1), 0.5, np.float32)
    image[:, size // 2 :] = 0.9
    return image


def test_noise_goes_and_an_edge_stays() -> None:
    clean, rng = steps(), np.random.default_rng(3)
    noisy = (clean + rng.normal(0.0, 0.03, clean.shape)).astype(np.float32)
    found = denoised(AO, noisy, np.ones((SIZE, SIZE), np.bool_))
    assert np.sqrt(((found - clean) ** 2).mean()) < 0.4 * 0.03
    beside = found[:, SIZE // 2 - 1 : SIZE // 2 + 1, 0].mean(axis=0)
    np.testing.assert_allclose(beside, [0.5, 0.9], atol=0.03)


def test_nothing_comes_in_from_what_is_not_covered() -> None:
    """A chart of one column between others that are black: no texel of it leaves the range of its own."""
    image, covered = np.zeros((SIZE, SIZE, 1), np.float32), np.zeros((SIZE, SIZE), np.bool_)
    covered[:, 60] = True
    image[:, 60, 0] = np.random.default_rng(1).uniform(0.7, 0.8, SIZE)
    found = denoised(AO, image, covered)
    low, high = nearby_range(image, covered)
    assert (found[covered] >= low[covered] - 1e-6).all()
    assert (found[covered] <= high[covered] + 1e-6).all()


def test_unit_vectors_stay_of_length_one() -> None:
    rng = np.random.default_rng(5)
    image = rng.normal((0.0, 0.0, 1.0), 0.05, (SIZE, SIZE, 3))
    image = (image / np.linalg.norm(image, axis=2, keepdims=True)).astype(np.float32)
    entry = find_map("bent-normal-object")
    found = denoised(entry, image, np.ones((SIZE, SIZE), np.bool_))
    np.testing.assert_allclose(np.linalg.norm(found, axis=2), 1.0, atol=1e-5)
    assert np.linalg.norm(found - (0, 0, 1), axis=2).mean() < 0.5 * np.linalg.norm(image - (0, 0, 1), axis=2).mean()


def noisy_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """Half light with noise of its own in each texel."""
    del atlas, asset
    return np.random.default_rng(7).normal(0.5, 0.03, (*gbuffer.shape, 1)).astype(np.float32)


def test_only_what_rays_estimate_is_denoised(quad: Pair) -> None:
    known = BakeMap("known", "none", "share", "[0, 1]", "unit", "png", 8, noisy_map, (1.0,) * 3)
    maps = [known, replace(known, name="rays", estimated=True)]
    plain = bake(*quad, maps, size=SIZE)
    found = bake(*quad, maps, size=SIZE, denoise=True)
    np.testing.assert_array_equal(found["known"].pixels, plain["known"].pixels)
    assert found["rays"].pixels.std() < 0.6 * plain["rays"].pixels.std()


def test_an_open_surface_stays_open(sphere: Pair) -> None:
    """A ball hides nothing from itself: all of it is white, before and after."""
    found = bake(*sphere, [find_map("ao", rays=RaySettings(16))], size=SIZE, denoise=True)["ao"].pixels
    np.testing.assert_allclose(found, 1.0, atol=1e-6)


def test_its_absence_is_said_with_the_remedy(sphere: Pair, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyoidn", None)
    with pytest.raises(MissingDependencyError, match=r'pip install "flexpara\[denoise\]"'):
        bake(*sphere, ["ao"], size=SIZE, denoise=True)
