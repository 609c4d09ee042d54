"""Normals and tangents: a sphere, a cube, and tangent frames at the poles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.normals import smooth_normals, tangent_frames
from flexpara.runtime.mesh import Surface

if TYPE_CHECKING:
    from numpy.typing import NDArray


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    return Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def test_normals_of_a_sphere_point_outwards() -> None:
    surface = surface_of(trimesh.creation.icosphere(subdivisions=3))
    assert (smooth_normals(surface) * surface.vertices).sum(axis=1).min() > 0.999


def test_normals_of_a_cube_corner_do_not_depend_on_its_diagonals() -> None:
    surface = surface_of(trimesh.creation.box())
    assert smooth_normals(surface) == pytest.approx(surface.vertices / np.sqrt(0.75))


def directions() -> NDArray[np.float64]:
    """Unit vectors: random ones, both poles with zeros of both signs, the axes, and some close to the poles."""
    poles = [
        [0.0, 0.0, 1.0],
        [0.0, 0.0, -1.0],
        [-0.0, -0.0, 1.0],
        [-0.0, 0.0, -1.0],
        [1.0, 0.0, 0.0],
        [0.0, -1.0, -0.0],
    ]
    close = [[1e-9, -1e-9, z] for z in (1.0, -1.0)] + [[1e-4, 0.0, -1.0], [0.0, 1e-4, 1.0]]
    every = np.concatenate([poles, close, np.random.default_rng(1).normal(size=(500, 3))])
    return every / np.linalg.norm(every, axis=1, keepdims=True)


def test_tangent_frames_are_orthonormal_and_right_handed() -> None:
    normal = directions()
    first, second = tangent_frames(normal)
    frame = np.stack([first, second, normal], axis=1)
    np.testing.assert_allclose(frame @ frame.transpose(0, 2, 1), np.tile(np.eye(3), (len(normal), 1, 1)), atol=1e-12)
    np.testing.assert_allclose(np.linalg.det(frame), 1.0, atol=1e-12)


@pytest.mark.parametrize("z", [1.0, -1.0])
def test_the_tangents_at_a_pole_are_the_axes(z: float) -> None:
    first, second = tangent_frames(np.array([[0.0, 0.0, z]]))
    np.testing.assert_allclose(first, [[1.0, 0.0, 0.0]])
    np.testing.assert_allclose(second, [[0.0, z, 0.0]])
