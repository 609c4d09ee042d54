"""Agreement of inverses that are right, shifted, or turned."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.mesh import Atlas, Surface
from flexpara.runtime.sessions.wrapagreement import inverse_agreement
from flexpara.runtime.sessions.wrapsession import Wrapped


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
