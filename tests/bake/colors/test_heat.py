"""The colours of distortion mean what the legend says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from flexpara.bake.colors import heat
from flexpara.runtime.mesh import Asset, Atlas

Pair = tuple[Atlas, Asset]


def test_red_is_larger_and_blue_is_smaller(two_charts: Pair) -> None:
    atlas, _ = two_charts
    uneven = atlas.uv.copy()
    uneven[4:] = (uneven[4:] - 0.5) * 0.5 + 0.5
    atlas = replace(atlas, uv=uneven)
    value = heat.signed_distortion(atlas, np.array([1.3, 1.1, 1.2, np.inf]), 1.2)
    np.testing.assert_allclose(value, [1.0, 0.5, -1.0, -1.0])
    colors = heat.heat_colors(value)
    assert colors[0, 0] > 2 * colors[0, 2]
    assert colors[2, 2] > 2 * colors[2, 0]


def test_no_distortion_is_near_white() -> None:
    white = heat.heat_colors(np.zeros(1))[0]
    assert white.min() > 0.8
    assert np.ptp(white) < 0.01


@pytest.mark.parametrize(("worst", "scale"), [(1.0, 1.02), (1.04, 1.05), (2.7, 3.0), (np.inf, 100.0)])
def test_the_scale_is_the_first_that_holds_the_faces(worst: float, scale: float) -> None:
    assert heat.distortion_scale(np.full(100, worst)) == scale
