"""Sampling: one triangle, counts by area, uniformity inside a face; solids and a real mesh."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import trimesh

from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.sampling import sample_surface, samples_in_faces

if TYPE_CHECKING:
    from pathlib import Path


TRIANGLE = Surface(np.array([[0.0, 0.0, 1.0], [4.0, 0.0, 1.0], [0.0, 2.0, 1.0]]), np.array([[0, 1, 2]]))


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def strip(areas: list[float]) -> Surface:
    """Separate right triangles of the areas given, of height 2, in the plane z = 0."""
    left = 10.0 * np.arange(len(areas))
    corners = np.zeros((len(areas), 3, 3))
    corners[:, :, 0] = left[:, None]
    corners[:, 1, 0] += areas
    corners[:, 2, 1] = 2.0
    return Surface(corners.reshape(-1, 3), np.arange(3 * len(areas)).reshape(-1, 3))


def test_samples_of_one_triangle_lie_in_it() -> None:
    samples = sample_surface(TRIANGLE, 1000, rng())
    x, y, z = samples.xyz.T
    assert (samples.face == 0).all()
    assert (x >= 0.0).all()
    assert (y >= 0.0).all()
    assert (x / 4.0 + y / 2.0 <= 1.0 + 1e-12).all()
    np.testing.assert_allclose(z, 1.0, atol=1e-14)
    np.testing.assert_array_equal(samples.normal, np.tile([0.0, 0.0, 1.0], (1000, 1)))


def test_samples_of_one_triangle_are_uniform() -> None:
    samples = sample_surface(TRIANGLE, 40000, rng())
    np.testing.assert_allclose(samples.barycentric.mean(axis=0), 1.0 / 3.0, atol=0.005)
    # Uniform on a triangle: var(λ) = 1/18, and a quarter of all points have λ₀ > ½.
    np.testing.assert_allclose(samples.barycentric.var(axis=0), 1.0 / 18.0, atol=0.002)
    np.testing.assert_allclose((samples.barycentric > 0.5).mean(axis=0), 0.25, atol=0.01)


def test_arrays_have_the_shapes_and_types_they_say() -> None:
    samples = sample_surface(TRIANGLE, 7, rng())
    assert samples.xyz.shape == samples.barycentric.shape == samples.normal.shape == (7, 3)
    assert samples.face.shape == (7,)
    assert samples.face.dtype == np.int64
    assert samples.xyz.dtype == samples.barycentric.dtype == samples.normal.dtype == np.float64


def test_each_face_gets_its_share_of_area_to_within_a_sample() -> None:
    areas = np.array([1.0, 3.0, 0.5, 5.5])
    counts = np.bincount(sample_surface(strip(areas.tolist()), 1000, rng()).face, minlength=4)
    assert counts.sum() == 1000
    assert (np.abs(counts - 1000.0 * areas / areas.sum()) <= 2.0).all()


def test_a_face_without_area_gets_no_sample() -> None:
    counts = np.bincount(sample_surface(strip([0.0, 1.0, 0.0, 2.0, 0.0]), 600, rng()).face, minlength=5)
    assert counts[[0, 2, 4]].tolist() == [0, 0, 0]
    assert abs(counts[1] - 200) <= 2


@pytest.mark.parametrize("name", ["sphere", "torus", "tube", "cone", "cube", "cloth"])
def test_barycentrics_are_valid_and_give_the_points(name: str) -> None:
    surface = Surface(*make_sample(name, resolution=24))
    samples = sample_surface(surface, 2000, rng())
    assert (samples.barycentric >= 0.0).all()
    np.testing.assert_allclose(samples.barycentric.sum(axis=1), 1.0, atol=1e-14)
    expected = (surface.triangles[samples.face] * samples.barycentric[:, :, None]).sum(axis=1)
    np.testing.assert_allclose(samples.xyz, expected, atol=1e-14)
    np.testing.assert_allclose(np.linalg.norm(samples.normal, axis=1), 1.0, atol=1e-12)
    edge = surface.triangles[samples.face, 1] - surface.triangles[samples.face, 0]
    np.testing.assert_allclose(np.einsum("nc,nc->n", edge, samples.normal), 0.0, atol=1e-12)


def test_the_same_seed_gives_the_same_samples() -> None:
    surface = Surface(*make_sample("torus", resolution=24))
    first, again, other = (sample_surface(surface, 100, rng(seed)).xyz for seed in (3, 3, 4))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_octants_of_a_sphere_get_the_same_number() -> None:
    samples = sample_surface(Surface(*make_sample("sphere", resolution=40)), 8000, rng())
    octant = (samples.xyz > 0.0) @ np.array([1, 2, 4])
    np.testing.assert_allclose(np.bincount(octant, minlength=8), 1000, atol=60)


def test_samples_in_faces_lie_in_the_faces_named() -> None:
    surface = Surface(*make_sample("cube", resolution=8))
    face = np.array([5, 0, 5, 11])
    samples = samples_in_faces(surface, face, rng())
    np.testing.assert_array_equal(samples.face, face)
    np.testing.assert_array_equal(samples.normal, surface.face_normals()[face])
    offset = samples.xyz - surface.triangles[face, 0]
    np.testing.assert_allclose(np.einsum("nc,nc->n", offset, samples.normal), 0.0, atol=1e-14)


def test_a_real_mesh_is_sampled_by_area(models: Path) -> None:
    mesh = trimesh.load_mesh(models / "spot.obj", process=False, skip_materials=True)
    surface = Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))
    samples = sample_surface(surface, 20000, rng())
    areas = surface.face_areas()
    low = surface.triangles.mean(axis=1)[:, 1] < 0.0
    assert low[samples.face].mean() == pytest.approx(areas[low].sum() / areas.sum(), abs=0.01)
