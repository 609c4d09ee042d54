"""Atlas vertices: by-hand splits, normals kept and filled, slivers that float32 would flip."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from flexpara.runtime.errors import FinishError
from flexpara.runtime.geometry.overlap import flipped_triangles
from flexpara.runtime.mesh import Asset, Surface
from flexpara.runtime.pack.seams import atlas_normals, rounded_uv, split_vertices

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


def test_rounding_alone_flips_slivers_and_the_repair_does_not() -> None:
    rng = np.random.default_rng(0)
    base = rng.uniform(0.3, 0.9, (400, 1, 2))
    sliver = np.array([[0.0, 0.0], [0.05, 0.0], [0.02, 3e-8]])
    turn = rng.uniform(0.0, 2.0 * np.pi, 400)
    rotation = np.stack([np.stack([np.cos(turn), np.sin(turn)], 1), np.stack([-np.sin(turn), np.cos(turn)], 1)], 1)
    uv = (base + sliver @ rotation).reshape(-1, 2)
    faces = np.arange(1200).reshape(-1, 3)
    assert not flipped_triangles(uv[faces]).any()
    assert flipped_triangles(uv.astype(np.float32)[faces].astype(np.float64)).sum() > 20
    found = rounded_uv(uv, faces)
    assert not flipped_triangles(found[faces].astype(np.float64)).any()
    assert np.abs(found - uv).max() < 4e-7


def test_slivers_of_a_fan_are_repaired_together() -> None:
    angle = np.linspace(0.3, 2.0, 12)
    rim = 0.7 + 1e-6 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    uv = np.concatenate([[[0.7, 0.7]], rim])
    faces = np.stack([np.zeros(11, dtype=np.int64), np.arange(1, 12), np.arange(2, 13)], axis=1)
    assert not flipped_triangles(rounded_uv(uv, faces)[faces].astype(np.float64)).any()


def test_what_float32_cannot_hold_is_refused() -> None:
    rim = 0.7 + 1e-9 * np.stack([np.cos(np.arange(9.0) / 2), np.sin(np.arange(9.0) / 2)], axis=1)
    uv = np.concatenate([[[0.7, 0.7]], rim])
    faces = np.stack([np.zeros(8, dtype=np.int64), np.arange(1, 9), np.arange(2, 10)], axis=1)
    with pytest.raises(FinishError, match="too thin for float32"):
        rounded_uv(uv, faces)
