"""Vertices moved one by one: upright again, less distorted, and by the kernel as by its twin."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.overlap import flipped_triangles
from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.mesh import Surface
from flexpara.train.finish.contact import excess_energy
from flexpara.train.swift.polish import corner_slopes, polished


def cap() -> Surface:
    mesh = trimesh.creation.icosphere(subdivisions=2)
    faces = np.asarray(mesh.faces, dtype=np.int64)
    upper = np.asarray(mesh.vertices)[faces].mean(axis=1)[:, 2] > 0.2
    return Surface(np.asarray(mesh.vertices, dtype=np.float64), faces).part(np.flatnonzero(upper))[0]


def shaken(surface: Surface, scale: float) -> np.ndarray:
    return surface.vertices[:, :2] + np.random.default_rng(0).normal(scale=scale, size=(len(surface.vertices), 2))


def test_slopes_give_the_jacobian_of_an_isometry() -> None:
    flat = Surface(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 3.0, 0.0]]), np.array([[0, 1, 2]]))
    jacobian = np.einsum("ci,cj->ij", flat.vertices[:, :2], corner_slopes(flat)[0])
    np.testing.assert_allclose(jacobian, np.eye(2), atol=1e-12)


def test_what_is_turned_over_is_upright_again_and_less_distorted() -> None:
    surface = cap()
    uv = shaken(surface, 0.06)
    assert flipped_triangles(uv[surface.faces]).any()
    found = polished(surface, uv, 12, 2.0)
    assert not flipped_triangles(found[surface.faces]).any()
    assert excess_energy(surface, polished(surface, found, 8)) < 0.5 * excess_energy(surface, found)


def test_an_isometry_stays_where_it_is() -> None:
    side = np.arange(4.0)
    points = np.stack([*map(np.ravel, np.meshgrid(side, side)), np.zeros(16)], axis=1)
    row = np.array([[4 * y + x for x in range(3)] for y in range(3)]).reshape(-1)
    faces = np.concatenate([np.stack([row, row + 1, row + 5], 1), np.stack([row, row + 5, row + 4], 1)])
    np.testing.assert_allclose(polished(Surface(points, faces), points[:, :2], 3), points[:, :2], atol=1e-9)


@pytest.mark.skipif(kernel() is None, reason="nothing was compiled")
@pytest.mark.parametrize("above", [0.0, 0.5])
def test_the_kernel_moves_vertices_as_its_twin_does(above: float) -> None:
    surface = cap()
    uv = shaken(surface, 0.06)
    with twins_only():
        expected = polished(surface, uv, 4, above)
    np.testing.assert_allclose(polished(surface, uv, 4, above), expected, atol=1e-9)
