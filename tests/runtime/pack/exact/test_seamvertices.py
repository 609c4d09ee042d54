"""Atlas vertices: by-hand splits, normals kept and filled."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from flexpara.runtime.mesh import Asset, Surface
from flexpara.runtime.pack.exact.seamvertices import atlas_normals, split_vertices

TWO = np.array([[0, 1, 2], [0, 2, 3]])
QUAD = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    return Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def test_a_quad_without_a_seam_keeps_its_four_vertices() -> None:
    faces, source, uv = split_vertices(TWO, np.zeros(2, dtype=np.int64), QUAD[TWO])
    assert np.array_equal(faces, TWO)
    assert source.tolist() == [0, 1, 2, 3]
    assert np.array_equal(uv, QUAD)


def test_a_seam_in_uv_or_a_change_of_chart_doubles_its_vertices() -> None:
    apart = QUAD[TWO] + np.array([0.0, 0.5])[:, None, None]
    for charts, corner_uv in (([0, 0], apart), ([0, 1], QUAD[TWO])):
        faces, source, uv = split_vertices(TWO, np.array(charts), corner_uv)
        assert source.tolist() == [0, 0, 1, 2, 2, 3]
        assert np.array_equal(source[faces], TWO)
        assert np.array_equal(uv[faces], corner_uv)


def test_normals_of_the_file_are_kept_and_missing_ones_filled() -> None:
    surface = surface_of(trimesh.creation.box())
    given = np.tile([0.0, 0.0, 2.0], (8, 1))
    given[3] = 0.0
    asset = Asset(surface.vertices, surface.faces, np.arange(8), surface, normals=given)
    found = atlas_normals(asset, np.arange(8))
    assert found.dtype == np.float32
    assert found[0].tolist() == [0.0, 0.0, 1.0]
    assert np.linalg.norm(found, axis=1) == pytest.approx(np.ones(8), abs=1e-6)
