"""Solids that are made of flat facets, and balls: surfaces whose best charts are known beforehand."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    Points = NDArray[np.float64]

L_SHAPE: list[tuple[float, float]] = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2)]
STAIRS: list[tuple[float, float]] = [(0, 0), (3, 0), (3, 1), (2, 1), (2, 2), (1, 2), (1, 3), (0, 3)]


def circle(sides: int, radius: float = 1.0) -> list[tuple[float, float]]:
    """Corners of a regular polygon."""
    turn = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    return [(radius * np.cos(a), radius * np.sin(a)) for a in turn]


def of_polygons(vertices: Points, polygons: list[list[int]], halvings: int = 0) -> Surface:
    """Polygons that are star-shaped about their first corner, as triangles, each then halved along all sides."""
    faces = np.array([[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)])
    for _ in range(halvings):
        ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
        distinct, index = np.unique(ends, axis=0, return_inverse=True)
        (a, b, c), (ab, bc, ca) = faces.T, (len(vertices) + index.reshape(-1, 3)).T
        vertices = np.concatenate([vertices, vertices[distinct].mean(axis=1)])
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(part, axis=1) for part in parts])
    return Surface(np.asarray(vertices, dtype=np.float64), faces.astype(np.int64))


def extruded(outline: Sequence[tuple[float, float]], height: float, halvings: int = 0, *, caps: bool = True) -> Surface:
    """A prism over an outline, counter-clockwise."""
    n = len(outline)
    plan = np.array(outline, dtype=np.float64)
    vertices = np.concatenate([np.c_[plan, np.zeros(n)], np.c_[plan, np.full(n, height)]])
    sides = [[i, (i + 1) % n, n + (i + 1) % n, n + i] for i in range(n)]
    ends = [[0, *range(n - 1, 0, -1)], list(range(n, 2 * n))] if caps else []
    return of_polygons(vertices, sides + ends, halvings)


def frustum(sides: int) -> Surface:
    """The side of a cone of base radius 1 cut off where its radius is ½; height 1."""
    low, high = np.array(circle(sides)), np.array(circle(sides, 0.5))
    vertices = np.concatenate([np.c_[low, np.zeros(sides)], np.c_[high, np.ones(sides)]])
    return of_polygons(vertices, [[i, (i + 1) % sides, sides + (i + 1) % sides, sides + i] for i in range(sides)])


SOLIDS: dict[str, Callable[[], Surface]] = {
    "quad": lambda: of_polygons(np.array([[0.0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]]), [[0, 1, 2, 3]]),
    "box": lambda: extruded([(0, 0), (1, 0), (1, 2), (0, 2)], 3.0),
    "cube": lambda: Surface(*make_sample("cube", resolution=16)),
    "fine box": lambda: extruded([(0, 0), (1, 0), (1, 2), (0, 2)], 3.0, 3),
    "tube": lambda: Surface(*make_sample("tube", resolution=16)),
    "capped cylinder": lambda: extruded(circle(16), 2.0),
    "cone": lambda: Surface(*make_sample("cone", resolution=20)),
    "frustum": lambda: frustum(16),
    "prism": lambda: extruded(circle(6), 1.5),
    "L-bracket": lambda: extruded(L_SHAPE, 1.0),
    "stairs": lambda: extruded(STAIRS, 1.0, 1),
    "sphere": lambda: Surface(*make_sample("sphere", resolution=24)),
}


@pytest.fixture
def solid() -> Callable[[str], Surface]:
    """A surface by its name in SOLIDS."""
    return lambda name: SOLIDS[name]()


@pytest.fixture
def together() -> Callable[..., Surface]:
    """Several surfaces as one, in that order."""

    def join(*surfaces: Surface) -> Surface:
        start = np.cumsum([0, *(len(surface.vertices) for surface in surfaces[:-1])])
        return Surface(
            np.concatenate([surface.vertices for surface in surfaces]),
            np.concatenate([surface.faces + first for surface, first in zip(surfaces, start, strict=True)]),
        )

    return join
