"""The shape behind noise: a plane by hand, a sphere, and what shows no noise."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.io.points.cloud import cloud_from_arrays
from flexpara.runtime.mesh import Surface
from flexpara.runtime.process.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.charts import chart_surface
from flexpara.train.charts.proof import verify
from flexpara.train.cloud.calm import calm_shape, heights, noise_level, ring_means
from flexpara.train.cloud.config import CloudConfig
from flexpara.train.cloud.reconstruct import reconstruct
from flexpara.train.config import FinishConfig

CONFIG = CloudConfig()


def calmed(surface: Surface, normals: np.ndarray, spacing: np.ndarray) -> np.ndarray:
    """Where the points lie without the noise that they show."""
    found = calm_shape(surface.vertices, normals, spacing, surface.faces, CONFIG)
    assert found is not None
    return found


def sphere(noise: float) -> tuple[Surface, np.ndarray, np.ndarray]:
    """A unit sphere whose points lie off it by so many spacings: surface, normals, spacing."""
    vertices, faces = make_sample("sphere", resolution=96)
    spacing = np.full(len(vertices), np.sqrt(4.0 * np.pi / len(vertices)))
    off = np.random.default_rng(0).normal(scale=noise * spacing[0], size=(len(vertices), 1))
    return Surface(vertices * (1.0 + off), faces), vertices, spacing


def test_the_mean_of_a_ring_lies_where_its_vertices_do() -> None:
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1]])
    points = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [-1.0, -1.0, 0.0], [9.0, 9.0, 9.0]])
    mean = ring_means(faces, 5)
    np.testing.assert_allclose((mean @ points)[0], points[1:4].mean(axis=0))
    np.testing.assert_allclose(mean.sum(axis=1)[:4], 1.0)
    assert heights(points, np.tile([0.0, 0.0, 1.0], (5, 1)), mean)[0] == pytest.approx(-1.0)


@pytest.mark.parametrize("noise", [0.1, 0.2])
def test_the_noise_of_a_sphere_is_found_and_most_of_it_taken_off(noise: float) -> None:
    surface, normals, spacing = sphere(noise)
    mean = ring_means(surface.faces, len(normals))
    assert noise_level(surface.vertices, normals, spacing, mean) == pytest.approx(1.35 * noise, rel=0.1)
    radius = np.linalg.norm(calmed(surface, normals, spacing), axis=1)
    assert radius.std() < 0.4 * noise * spacing[0]
    assert radius.mean() == pytest.approx(1.0, abs=0.03)


def test_points_move_along_their_normals_alone() -> None:
    surface, normals, spacing = sphere(0.15)
    moved = calmed(surface, normals, spacing) - surface.vertices
    assert np.abs(np.cross(moved, normals)).max() < 1e-12


@pytest.mark.parametrize("resolution", [16, 96])
def test_a_surface_without_noise_keeps_its_shape_even_where_it_is_coarse(resolution: int) -> None:
    vertices, faces = make_sample("sphere", resolution=resolution)
    spacing = np.full(len(vertices), np.sqrt(4.0 * np.pi / len(vertices)))
    assert calm_shape(vertices, vertices, spacing, faces, CONFIG) is None


def test_charts_of_a_noisy_cloud_are_those_of_what_was_scanned() -> None:
    """Found on its triangles as they are there are dozens, most of them scraps."""
    rng = np.random.default_rng(1)
    points = rng.normal(size=(6_000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    points += rng.normal(scale=0.15 * np.sqrt(4.0 * np.pi / len(points)), size=points.shape)
    surface = reconstruct(cloud_from_arrays(points * [1.0, 0.8, 1.4])).asset.surface
    assert surface.calm is not None
    found = chart_surface(surface, 8, FinishConfig(), 0, Stages())
    assert len(found.pieces) <= 4
    verify(found.pieces)
