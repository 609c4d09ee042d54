"""Topological noise: folds and small handles are closed over, and what the points do show stays."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.normals import smooth_normals
from flexpara.runtime.geometry.topology import boundary_loops, is_manifold
from flexpara.runtime.io.points.cloud import cloud_from_arrays
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.cloud.config import CloudConfig
from flexpara.train.cloud.noise import at_small_handles, handles, places, without_noise
from flexpara.train.cloud.reconstruct import reconstruct

CONFIG = CloudConfig()


def calmed(vertices: np.ndarray, faces: np.ndarray, normals: np.ndarray, spacing: float) -> np.ndarray:
    return without_noise(vertices, normals, np.full(len(vertices), spacing), faces, CONFIG)


def sphere() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, faces, and normals."""
    vertices, faces = make_sample("sphere", resolution=48)
    return vertices, faces, vertices / np.linalg.norm(vertices, axis=1, keepdims=True)


def with_handle(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """A tube of six triangles in the place of two faces that are near, but have no neighbour in common."""
    first, middle = faces[0], vertices[faces].mean(axis=1)
    around = faces[np.isin(faces, first).any(axis=1)]
    apart = np.flatnonzero(~np.isin(faces, around).any(axis=1))
    second = faces[apart[np.linalg.norm(middle[apart] - middle[0], axis=1).argmin()]]
    a, b = first, second[::-1]
    tube = [[a[0], a[1], b[0]], [a[1], b[1], b[0]], [a[1], a[2], b[1]], [a[2], b[2], b[1]], [a[2], a[0], b[2]]]
    rest = [face for face in faces if not (np.array_equal(face, first) or np.array_equal(face, second))]
    return np.concatenate([rest, tube, [[a[0], b[0], b[2]]]])


def torus(around: int, along: int, thickness: float) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    phi, theta = 2.0 * np.pi * u / along, 2.0 * np.pi * v / around
    radius = 1.0 + thickness * np.cos(theta)
    points = np.stack([radius * np.cos(phi), radius * np.sin(phi), thickness * np.sin(theta)], axis=2).reshape(-1, 3)
    one, right = u * around + v, (u + 1) % along * around + v
    up, across = u * around + (v + 1) % around, (u + 1) % along * around + (v + 1) % around
    quads = np.stack([one, right, across, one, across, up], axis=2)
    return points, quads.reshape(-1, 3)


def test_a_small_handle_is_cut_out_and_closed_over() -> None:
    vertices, faces, normals = sphere()
    noisy = with_handle(vertices, faces)
    assert is_manifold(noisy)
    assert handles(noisy) == 1
    found = calmed(vertices, noisy, normals, 0.15)
    assert handles(found) == 0
    assert len(boundary_loops(found)) == 0
    assert is_manifold(found)
    assert len(found) > 0.9 * len(faces)


@pytest.mark.parametrize(("around", "along", "thickness"), [(40, 80, 0.4), (8, 200, 0.04)])
def test_a_ring_and_a_wire_keep_their_handle(around: int, along: int, thickness: float) -> None:
    vertices, faces = torus(around, along, thickness)
    assert handles(faces) == 1
    assert not at_small_handles(vertices, faces, CONFIG.handle_edges).any()
    normals = smooth_normals(Surface(vertices, faces))
    assert calmed(vertices, faces, normals, 0.05) is faces


def test_a_fold_whose_hole_faces_inwards_is_closed_from_a_ring_farther_out() -> None:
    vertices, faces, normals = sphere()
    normals = normals.copy()
    normals[faces[100]] *= -1.0  # what closes the hole of this triangle faces away from its corners
    found = calmed(vertices, np.delete(faces, 100, axis=0), normals, 0.15)
    assert len(boundary_loops(found)) == 0
    assert handles(found) == 0
    assert not np.isin(faces[100], found).any()


def test_a_fold_that_nothing_can_close_is_left_as_it_is() -> None:
    vertices, faces, normals = sphere()
    rest = np.delete(faces, 100, axis=0)
    found = calmed(vertices, rest, -normals, 0.15)
    assert {tuple(face) for face in found.tolist()} == {tuple(face) for face in rest.tolist()}


def test_the_rim_of_a_sheet_is_no_noise() -> None:
    vertices, faces = make_sample("cloth", resolution=16)
    normals = smooth_normals(Surface(vertices, faces))
    assert calmed(vertices, faces, normals, 0.1) is faces


def test_places_are_numbered_by_the_vertices_that_they_share() -> None:
    found = places(np.array([[0, 1, 2], [2, 3, 4], [6, 7, 8]]), 10)
    assert found.tolist() == [0, 0, 0, 0, 0, -1, 1, 1, 1, -1]


@pytest.mark.parametrize(("kind", "expected"), [("sphere", 0), ("torus", 1)])
def test_a_cloud_as_noisy_as_a_scan_becomes_what_was_scanned(kind: str, expected: int) -> None:
    vertices, faces = make_sample("sphere", resolution=48) if kind == "sphere" else torus(40, 80, 0.4)
    rng, corners = np.random.default_rng(0), vertices[faces]
    area = Surface(vertices, faces).face_areas()
    weight = rng.dirichlet(np.ones(3), size=40_000)
    points = np.einsum("nc,ncd->nd", weight, corners[rng.choice(len(faces), size=40_000, p=area / area.sum())])
    points += rng.normal(scale=0.16 * np.sqrt(area.sum() / len(points)), size=points.shape)
    found = reconstruct(cloud_from_arrays(points)).asset.surface.faces
    assert is_manifold(found)
    assert len(boundary_loops(found)) == 0
    assert handles(found) == expected


def test_a_scrap_whose_rim_is_short_is_no_hole() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    found = calmed(vertices, faces, np.tile([0.0, 0.0, 1.0], (4, 1)), 1.0)
    assert len(found) == 2
