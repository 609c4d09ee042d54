"""Rays: settings that make sense, even patterns, one triangle by hand, all cores without losing a texel."""

from __future__ import annotations

import subprocess
import sys
import threading

import numpy as np
import pytest

from flexpara.bake.maps import rays
from flexpara.bake.maps.rays import RayScene, RaySettings, cosine_directions, in_batches, pattern_of, sphere_patterns
from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Frame, Surface

UNIT = Frame((0.0, 0.0, 0.0), 1.0)


@pytest.fixture
def triangle() -> RayScene:
    """The corners (0, 0, 0), (1, 0, 0), (0, 1, 0)."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    return RayScene.of(Surface(corners, np.array([[0, 1, 2]])), UNIT)


def row(*numbers: float) -> np.ndarray:
    return np.array([numbers], np.float32)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"count": 0}, "0 rays a texel: expected 1 to 4096"),
        ({"count": 5000}, "5000 rays"),
        ({"distance": 0.0}, "ray distance"),
        ({"distance": float("nan")}, "ray distance nan"),
        ({"seed": -1}, "seed -1"),
    ],
)
def test_settings_out_of_range_are_refused(settings: dict, message: str) -> None:
    with pytest.raises(InputError, match=message):
        RaySettings(**settings)


def test_a_ray_through_a_triangle_names_the_point(triangle: RayScene) -> None:
    hits = triangle.cast(row(0.2, 0.3, 2), row(0, 0, -4))
    assert hits.hit.tolist() == [True]
    assert hits.face.tolist() == [0]
    np.testing.assert_allclose([hits.second[0], hits.third[0], hits.distance[0]], [0.2, 0.3, 0.5], atol=1e-6)


def test_a_ray_beside_it_or_too_short_misses(triangle: RayScene) -> None:
    origin = np.array([[0.8, 0.8, 1], [0.2, 0.2, 1], [0.2, 0.2, 1]], np.float32)
    direction = np.tile(row(0, 0, -1), (3, 1))
    reach = np.array([9.0, 0.9, 1.1], np.float32)
    assert triangle.occluded(origin, direction, reach).tolist() == [False, False, True]
    assert triangle.cast(origin, direction, reach).hit.tolist() == [False, False, True]


def test_the_nearest_point_is_clamped_into_the_face(triangle: RayScene) -> None:
    near = triangle.nearest(np.array([[0.25, 0.25, 3], [2, 0, 0]], np.float32))
    np.testing.assert_allclose(near.distance, [3, 1], atol=1e-6)
    np.testing.assert_allclose(near.second, [0.25, 1], atol=1e-6)
    np.testing.assert_allclose(near.third, [0.25, 0], atol=1e-6)


def test_a_scene_has_its_surface_s_frame() -> None:
    surface = Surface(np.array([[100.0, 0, 0], [102, 0, 0], [100, 2, 0]]), np.array([[0, 1, 2]]))
    scene = RayScene.of(surface)
    assert scene.frame == Frame.of(surface.vertices)
    centre = scene.frame.apply(np.array([[100.5, 0.5, 0.1]])).astype(np.float32)
    np.testing.assert_allclose(scene.nearest(centre).distance, 0.1 / scene.frame.scale, rtol=1e-4)


def test_patterns_are_unit_seeded_and_even() -> None:
    patterns = sphere_patterns(64, 3)
    assert patterns.shape == (64, 64, 3)
    np.testing.assert_allclose(np.linalg.norm(patterns, axis=2), 1.0, atol=1e-6)
    assert np.abs(patterns.mean(axis=1)).max() < 0.01  # 64 independent points would leave 0.07
    np.testing.assert_array_equal(patterns, sphere_patterns(64, 3))
    assert np.abs(patterns - sphere_patterns(64, 4)).max() > 0.1
    assert np.abs(patterns[0] - patterns[1]).max() > 0.1


def test_directions_are_cosine_weighted() -> None:
    axis = np.array([[0, 0, 1], [0.6, 0, -0.8]], np.float32)
    direction = cosine_directions(sphere_patterns(2048, 0), np.array([0, 5]), axis)
    unit = direction / np.linalg.norm(direction, axis=2, keepdims=True)
    cosine = np.einsum("tsi,ti->ts", unit, axis)
    assert (cosine >= 0).all()
    np.testing.assert_allclose(cosine.mean(axis=1), 2 / 3, atol=2e-3)
    np.testing.assert_allclose((cosine**2).mean(axis=1), 1 / 2, atol=2e-3)
    np.testing.assert_allclose(unit.mean(axis=1), axis * 2 / 3, atol=4e-3)


def test_neighbouring_texels_have_their_own_patterns() -> None:
    block = (np.arange(8)[:, None] * 100 + np.arange(8)).reshape(-1)
    assert sorted(pattern_of(block, 100)) == list(range(64))
    assert pattern_of(np.array([5, 13, 805]), 100).tolist() == [5, 5, 5]


def test_batches_cover_every_texel_once_and_report() -> None:
    seen, told = np.zeros(1003, np.int64), []
    lock = threading.Lock()

    def work(texels: np.ndarray) -> None:
        with lock:
            seen[texels] += 1

    in_batches(work, np.arange(1003), 10, lambda done, total: told.append((done, total)))
    assert (seen == 1).all()
    assert told[0] == (10, 1003)
    assert told[-1] == (1003, 1003)
    assert len(told) == 101


def test_what_a_batch_raises_is_raised() -> None:
    def work(texels: np.ndarray) -> None:
        if texels[0] == 50:
            raise InputError("here")

    with pytest.raises(InputError, match="here"):
        in_batches(work, np.arange(100), 10)


def test_scenes_answer_several_threads_at_once() -> None:
    """Every batch gets its own answer, whichever thread asked."""
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(300, 3))
    scene = RayScene.of(Surface(corners, np.arange(300).reshape(-1, 3)))
    origin = rng.normal(size=(20_000, 3)).astype(np.float32)
    direction = rng.normal(size=(20_000, 3)).astype(np.float32)
    expected = scene.occluded(origin, direction)
    found = np.zeros(20_000, bool)

    def work(texels: np.ndarray) -> None:
        found[texels] = scene.occluded(origin[texels], direction[texels])

    in_batches(work, np.arange(20_000), 64)
    np.testing.assert_array_equal(found, expected)
    assert 0.05 < expected.mean() < 0.95


def test_the_missing_library_is_named_with_its_remedy() -> None:
    script = f"import sys; sys.modules['lagrange'] = None; import {rays.__name__}"
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, timeout=60, check=False)
    last = done.stderr.strip().splitlines()[-1]
    assert "MissingDependencyError: lagrange cannot be imported" in last
    assert "pip install 'flexpara[bake]'" in last


def test_rays_leave_denormal_numbers_as_they_are() -> None:
    scene = RayScene.of(Surface(np.eye(3), np.array([[0, 1, 2]])))
    points = np.zeros((4, 3), np.float32)
    scene.occluded(points, points + 1.0)
    scene.cast(points, points + 1.0)
    scene.nearest(points)
    in_batches(lambda _: None, np.arange(4), 1)
    assert np.float64(5e-324) * 1.0 > 0.0
