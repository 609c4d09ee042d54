"""Normals of corners on solids; agreement of inverses that are right, shifted, or turned."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.mesh import Atlas, Surface
from flexpara.runtime.samples import make_sample
from flexpara.runtime.sessions.wrapagreement import corner_normals, interpolated_normals, inverse_agreement
from flexpara.runtime.sessions.wrapsession import Wrapped


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


def unit_square() -> tuple[Surface, Atlas]:
    """The unit square of the plane z = 7, which is its own atlas."""
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    surface = Surface(np.concatenate([uv, np.full((4, 1), 7.0)], axis=1), np.array([[0, 1, 2], [0, 2, 3]]))
    up = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (4, 1))
    chart, source = np.zeros(2, np.int64), np.arange(4)
    return surface, Atlas(surface.vertices, surface.faces, uv.astype(np.float32), up, chart, source, 64, 1)


class Shifted:
    """The inverse of the unit square, its points shifted and its normals leaning by ``angle`` radians."""

    def __init__(self, shift: float, angle: float) -> None:
        self.shift, self.angle = shift, angle

    def wrap(self, uv: np.ndarray, chart: np.ndarray) -> Wrapped:
        assert not chart.any()
        points = np.concatenate([uv, np.full((len(uv), 1), 7.0 + self.shift)], axis=1)
        normal = np.array([np.sin(self.angle), 0.0, np.cos(self.angle)], np.float32)
        return Wrapped(points, np.tile(normal, (len(uv), 1)))


def test_the_true_inverse_agrees() -> None:
    found = inverse_agreement(Shifted(0.0, 0.0), *unit_square(), count=500)
    assert max(found.rms, found.p99) < 1e-7
    assert found.normal_mean < 1e-3
    assert found.to_dict() == {"rms": found.rms, "p99": found.p99, "normal_mean": found.normal_mean, "points": 500}


def test_errors_are_shares_of_the_radius_and_radians() -> None:
    found = inverse_agreement(Shifted(0.01, 0.2), *unit_square(), count=500)
    assert found.rms == pytest.approx(0.01 / np.sqrt(0.5))
    assert found.p99 == pytest.approx(0.01 / np.sqrt(0.5))
    assert found.normal_mean == pytest.approx(0.2, rel=1e-5)
