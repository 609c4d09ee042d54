"""The deployed networks of a finished atlas: for any point of the surface, which chart, and where in it.

Unwrap-Nets: affine experts, each for a part of a chart.  Assign-Net: the grid and the gates that choose among them.
Both are fitted in closed form (grow.py).   xyz in the unit ball; uv in chart coordinates.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.triangles import signed_areas
from .grow import grow
from .lessons import lesson_of

if TYPE_CHECKING:
    from ...runtime.mesh import Charts, Surface
    from .config import FitConfig
    from .gated import GatedExperts


def fit_networks(surface: Surface, charts: Charts, config: FitConfig, seed: int) -> GatedExperts:
    """Networks xyz (n, 3) → uv (n, 2) in chart coordinates, chart (n,), score (n,).

    Args:
        surface: in the unit ball.
        charts: of that surface; their uv in any unit.
        config: samples, sizes, tolerance.
        seed: of the samples.
    """
    rng = np.random.default_rng(seed)
    lesson = lesson_of(surface, charts, config.samples, rng)
    extent = float(np.sqrt(np.abs(signed_areas(charts.corner_uv)).sum()))
    return grow(lesson, config.grow, config.tolerance * extent, rng)
