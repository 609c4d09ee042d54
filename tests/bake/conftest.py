"""What the bake tests share: an OpenGL context that must stay clean, and small atlases made by hand."""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import pytest

from flexpara.bake.raster.context import open_context
from flexpara.bake.raster.gbuffer import GBuffer, rasterize
from flexpara.runtime.mesh import Asset, Atlas, Surface

Pair = tuple[Atlas, Asset]


def leaked_objects(context: moderngl.Context) -> list[str]:
    """Types of the GL objects that were dropped without being released; needs gc_mode "context_gc"."""
    gc.collect()
    names = [type(item).__name__ for item in context.objects]
    return [name for name in names if name != "InvalidObject"]


@pytest.fixture
def leaks() -> Callable[[moderngl.Context], list[str]]:
    return leaked_objects


@pytest.fixture
def context() -> Iterator[moderngl.Context]:
    """A context without errors and leaks, before and after."""
    with open_context() as context:
        context.gc_mode = "context_gc"
        assert context.error == "GL_NO_ERROR"
        yield context
        assert context.error == "GL_NO_ERROR"
        assert leaked_objects(context) == []


@pytest.fixture
def make_gbuffer() -> Callable[[Atlas, int], GBuffer]:
    """Rasterizes an atlas at a size, in a context of its own."""

    def make(atlas: Atlas, size: int) -> GBuffer:
        with open_context() as context:
            return rasterize(context, atlas, size)

    return make


def make_pair(positions: Any, faces: Any, uv: Any, **changes: Any) -> Pair:
    """Atlas and asset of the same vertices; changes go to the asset."""
    xyz, index = np.asarray(positions, np.float64), np.asarray(faces, np.int64)
    cross = np.cross(xyz[index[:, 1]] - xyz[index[:, 0]], xyz[index[:, 2]] - xyz[index[:, 0]])
    normal = np.zeros_like(xyz)
    for corner in range(3):
        np.add.at(normal, index[:, corner], cross)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    count = np.arange(len(xyz))
    chart = np.zeros(len(index), np.int64)
    flat = np.asarray(uv, np.float32)
    atlas = Atlas(xyz, index, flat, normal.astype(np.float32), chart, source_vertex=count, size=64, padding=4)
    asset = Asset(positions=xyz, faces=index, weld=count, surface=Surface(xyz, index))
    return atlas, replace(asset, **changes)


@pytest.fixture
def pair() -> Callable[..., Pair]:
    return make_pair


@pytest.fixture
def quad() -> Pair:
    """The unit square in the plane z = 0, facing +z, position = uv."""
    corners = [[0, 0], [1, 0], [1, 1], [0, 1]]
    return make_pair([[x, y, 0] for x, y in corners], [[0, 1, 2], [0, 2, 3]], corners)


@pytest.fixture
def two_charts() -> Pair:
    """Two squares of a quarter of the side, at z = 0 on the left and z = 1 on the right; charts 0 and 1."""
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) / 4.0
    uv = np.concatenate([square + np.array([0.125, 0.375]), square + np.array([0.625, 0.375])])
    height = np.repeat([0.0, 1.0], 4)
    faces = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    atlas, asset = make_pair(np.column_stack([uv, height]), faces, uv)
    return replace(atlas, face_chart=np.array([0, 0, 1, 1])), asset


@pytest.fixture
def closed() -> Pair:
    """A tetrahedron, whose uv overlap."""
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    return make_pair([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], faces, [[0, 0], [1, 0], [0, 1], [1, 1]])


def make_sphere(rows: int, columns: int) -> Pair:
    """Unit sphere by longitude and latitude, without its poles, cut along a meridian; uv leave a rim of 0.05."""
    u, v = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0.05, 0.95, rows + 1))
    longitude, latitude = 2 * np.pi * u, np.pi * (v - 0.5)
    xyz = np.stack(
        [np.cos(latitude) * np.sin(longitude), np.sin(latitude), np.cos(latitude) * np.cos(longitude)], axis=-1
    )
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).reshape(-1)
    above = first + columns + 1
    faces = np.concatenate([np.stack([first, first + 1, above + 1], 1), np.stack([first, above + 1, above], 1)])
    uv = np.stack([u, v], axis=-1).reshape(-1, 2) * 0.9 + 0.05
    atlas, asset = make_pair(xyz.reshape(-1, 3), faces, uv)
    return replace(atlas, normals=xyz.reshape(-1, 3).astype(np.float32)), asset


@pytest.fixture
def sphere() -> Pair:
    return make_sphere(16, 24)


@pytest.fixture
def fine_sphere() -> Pair:
    """20,000 faces: more corners than one row of a texture holds."""
    return make_sphere(100, 100)
