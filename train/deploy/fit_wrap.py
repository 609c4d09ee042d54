"""The inverse of a finished atlas: which surface point and normal lie at a uv.

n samples · k charts.   uv: of the atlas, [0, 1]²; xyz: unit ball; normals: unit.

One gated network over the atlas, whose experts answer with position and normal, fitted in closed form like the
networks that it inverts.  Its inputs are (u, v, height): each chart lies at a height of its own, HEIGHT · chart / k, so
that gates tell charts apart where they share a cell, or lie over each other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import InputError
from ...runtime.geometry.normals import corner_normals, interpolated_normals
from .config import WrapConfig
from .experts import Lesson
from .grow import grow
from .lessons import face_slopes, spots_on

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Charts, Surface
    from ...runtime.process.progress import Progress
    from .gated import GatedExperts


HEIGHT = 0.01
"""Height over which the charts are spread: less than a cell of the grid."""


def on_layers(uv: NDArray[Any], chart: NDArray[np.int64], charts: int) -> NDArray[Any]:
    """(n, 3) inputs of the inverse, of the type of uv (n, 2): u, v, and the height of charts (n,)."""
    step = np.asarray(HEIGHT / charts, dtype=uv.dtype)
    return np.concatenate([uv, (chart.astype(uv.dtype) * step)[:, None]], axis=1)


def above_layer(chart: NDArray[np.int64], charts: int) -> NDArray[np.float64]:
    """(n, 4) the gates halfway between the layers of charts (n,) and the next."""
    level = (chart.astype(np.float64) + 0.5) * (HEIGHT / charts)
    return np.stack([np.zeros(len(chart)), np.zeros(len(chart)), np.ones(len(chart)), -level], axis=1)


def fit_wrap(
    surface: Surface,
    charts: Charts,
    corner_uv: NDArray[np.float64],
    config: WrapConfig | None = None,
    *,
    seed: int = 0,
    progress: Progress,
) -> GatedExperts:
    """The inverse of packed charts: (n, 3), see on_layers, → position and normal (n, 6), chart (n,), score (n,).

    Args:
        surface: in the unit ball.
        charts: of that surface.
        corner_uv: (f, 3, 2) of the packed charts, in the atlas.
        config: None = WrapConfig().
        seed: of the samples.
        progress: told of the stage "fit points".

    Raises:
        InputError: no chart has a face.
    """
    config = config or WrapConfig()
    if len(charts.face_chart) == 0:
        raise InputError("charts of 0 faces, expected at least one; pass the charts of a surface")
    rng = np.random.default_rng(seed)
    progress("fit points", 0, 2)
    lesson = inverse_lesson(surface, charts, corner_uv, config, rng)
    progress("fit points", 1, 2)
    networks = grow(lesson, config.grow, config.tolerance, rng)
    weights = networks.weights.copy()
    weights[:, 3:] /= np.float32(config.normal)
    progress("fit points", 2, 2)
    return replace(networks, weights=weights)


def inverse_lesson(
    surface: Surface,
    charts: Charts,
    corner_uv: NDArray[np.float64],
    config: WrapConfig,
    rng: np.random.Generator,
) -> Lesson:
    """Position and normal at samples of an atlas; normals by config.normal, so that one error speaks for both."""
    face, barycentric, _ = spots_on(surface, charts, config.samples, rng)
    normals = corner_normals(surface)
    corners = np.concatenate([surface.triangles, config.normal * normals], axis=2)
    normal = config.normal * interpolated_normals(normals, face, barycentric)
    uv = np.einsum("nc,ncd->nd", barycentric, corner_uv[face])
    slopes = np.zeros((len(face), 6, 3))
    slopes[:, :, :2] = face_slopes(corner_uv, corners)[face]
    return Lesson(
        x=on_layers(uv, charts.face_chart[face], len(charts.method)),
        y=np.concatenate([np.einsum("nc,ncd->nd", barycentric, surface.triangles[face]), normal], axis=1),
        label=charts.face_chart[face],
        slope=slopes,
        plane=above_layer(charts.face_chart[face], len(charts.method)),
    )
