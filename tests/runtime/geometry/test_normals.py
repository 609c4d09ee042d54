"""Normals of vertices and corners on solids and roofs, and tangent frames at the poles."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.normals import corner_normals, interpolated_normals, smooth_normals, tangent_frames
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample

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


def test_one_triangle_has_its_own_normal_at_each_corner() -> None:
    surface = Surface(np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), np.array([[0, 1, 2]]))
    assert np.array_equal(corner_normals(surface), np.broadcast_to([0.0, 0.0, 1.0], (1, 3, 3)))


def roof(slope: float) -> Surface:
    """Two triangles that meet at the y axis and fall by ``slope`` radians on both sides."""
    fall = [np.cos(slope), 0.0, -np.sin(slope)]
    vertices = np.array([[0.0, -1.0, 0.0], [0.0, 1.0, 0.0], fall, [-fall[0], 0.0, fall[2]]])
    return Surface(vertices, np.array([[0, 2, 1], [0, 1, 3]]))


def test_a_low_roof_is_round_at_its_ridge_and_a_steep_one_is_sharp() -> None:
    low, steep = roof(np.deg2rad(15.0)), roof(np.deg2rad(25.0))
    assert np.allclose(corner_normals(low)[0, [0, 2]], [0.0, 0.0, 1.0])
    assert np.allclose(corner_normals(low)[0, 1], low.face_normals()[0])
    assert np.allclose(corner_normals(steep), steep.face_normals()[:, None])
    assert np.allclose(corner_normals(steep, crease=np.deg2rad(60.0))[1, [0, 1]], [0.0, 0.0, 1.0])


def test_a_cube_keeps_its_edges() -> None:
    surface = Surface(*make_sample("cube", resolution=8))
    assert np.allclose(corner_normals(surface), surface.face_normals()[:, None])


def test_a_sphere_is_round() -> None:
    surface = Surface(*make_sample("sphere", resolution=64))
    radial = surface.triangles / np.linalg.norm(surface.triangles, axis=2, keepdims=True)
    assert np.abs(corner_normals(surface) - radial).max() < 0.01


def test_normals_inside_a_face_are_unit_and_those_of_its_corners_at_its_corners() -> None:
    surface = Surface(*make_sample("sphere", resolution=16))
    corners = corner_normals(surface)
    face = np.arange(len(surface.faces))
    inside = interpolated_normals(corners, face, np.random.default_rng(0).dirichlet(np.ones(3), size=len(face)))
    assert np.allclose(np.linalg.norm(inside, axis=1), 1.0)
    assert np.allclose(interpolated_normals(corners, face, np.tile([0.0, 1.0, 0.0], (len(face), 1))), corners[:, 1])
