"""Tangents follow u, bitangents follow v, and every frame is a frame."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from flexpara.bake.maps.tangents import (
    any_perpendicular,
    corner_angles,
    mikk_tangents,
    split_by_tangents,
    unit,
    vertex_tangents,
)
from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.mesh import Asset, Atlas
from flexpara.runtime.pack.packing import atlas_from_uv

Pair = tuple[Atlas, Asset]

MIKKTSPACE = Path(__file__).with_name("mikktspace.mjs")


def reference_tangents(atlas: Atlas, folder: Path) -> np.ndarray:
    """(f, 3, 4) tangents of npm's mikktspace, v up; skips where node or the package is absent."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    corners = [array[atlas.faces].astype(np.float32).ravel() for array in (atlas.positions, atlas.normals, atlas.uv)]
    np.concatenate(corners).tofile(folder / "in.f32")
    command = [node, str(MIKKTSPACE), str(folder / "in.f32"), str(folder / "out.f32")]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=60)
    if "Cannot find module 'mikktspace'" in done.stderr:
        pytest.skip("npm package mikktspace is not installed")
    assert done.returncode == 0, done.stderr
    return np.fromfile(folder / "out.f32", np.float32).reshape(-1, 3, 4)


def assert_same_tangents(found: np.ndarray, expected: np.ndarray) -> None:
    np.testing.assert_allclose(found[..., :3], expected[..., :3], atol=2e-5)
    np.testing.assert_array_equal(found[..., 3], expected[..., 3])


def mirrored(atlas: Atlas) -> Atlas:
    """The right half of the uv folded onto the left one: vertices on the fold belong to faces of both kinds."""
    return replace(atlas, uv=np.column_stack([np.abs(atlas.uv[:, 0] - 0.5), atlas.uv[:, 1]]).astype(np.float32))


def uneven(atlas: Atlas) -> Atlas:
    """Moves uv by a tenth of a cell, so that the faces around a vertex disagree about u."""
    shift = np.random.default_rng(5).normal(0.0, 0.004, atlas.uv.shape)
    return replace(atlas, uv=(atlas.uv + shift).astype(np.float32))


def test_they_are_those_of_mikktspace(sphere: Pair, tmp_path: Path) -> None:
    atlas = uneven(sphere[0])
    expected = reference_tangents(atlas, tmp_path)
    assert_same_tangents(vertex_tangents(atlas)[atlas.faces], expected)
    assert_same_tangents(mikk_tangents(atlas.positions, atlas.normals, atlas.uv, atlas.faces), expected)


def test_they_are_those_of_mikktspace_where_uv_are_mirrored(sphere: Pair, tmp_path: Path) -> None:
    atlas = mirrored(sphere[0])
    expected = reference_tangents(atlas, tmp_path)
    assert_same_tangents(mikk_tangents(atlas.positions, atlas.normals, atlas.uv, atlas.faces), expected)
    split = split_by_tangents(atlas)
    assert_same_tangents(vertex_tangents(split)[split.faces], expected)
    assert (vertex_tangents(atlas)[atlas.faces][..., 3] != expected[..., 3]).any()  # why it is split


def test_split_vertices_are_one_point_without_a_seam_for_mikktspace(sphere: Pair, tmp_path: Path) -> None:
    """Equal position, normal and uv are one vertex, whatever the index says."""
    atlas = uneven(sphere[0])
    loose = replace(
        atlas,
        faces=np.arange(atlas.faces.size).reshape(-1, 3),
        **{name: getattr(atlas, name)[atlas.faces.ravel()] for name in ("positions", "normals", "uv", "source_vertex")},
    )
    expected = reference_tangents(loose, tmp_path)
    assert_same_tangents(vertex_tangents(loose)[loose.faces], expected)


def test_they_are_those_of_mikktspace_on_a_real_mesh(models: Path, tmp_path: Path) -> None:
    atlas = split_by_tangents(atlas_from_uv(load_asset(models / "spot.obj")))
    expected = reference_tangents(atlas, tmp_path)
    found = vertex_tangents(atlas)[atlas.faces]
    np.testing.assert_array_equal(found[..., 3], expected[..., 3])
    agree = np.einsum("fci,fci->fc", found[..., :3], expected[..., :3])
    assert agree.min() > 1.0 - 1e-5


def test_an_atlas_of_one_orientation_is_not_split(sphere: Pair) -> None:
    assert split_by_tangents(sphere[0]) is sphere[0]


def test_splitting_keeps_the_faces_where_they_are(sphere: Pair) -> None:
    atlas = mirrored(sphere[0])
    split = split_by_tangents(atlas)
    assert len(split.positions) > len(atlas.positions)
    np.testing.assert_array_equal(split.positions[split.faces], atlas.positions[atlas.faces])
    np.testing.assert_array_equal(split.uv[split.faces], atlas.uv[atlas.faces])
    np.testing.assert_array_equal(split.source_vertex[split.faces], atlas.source_vertex[atlas.faces])
    assert split_by_tangents(split) is split


def test_the_tangent_of_a_flat_quad_is_its_u_direction(quad: Pair) -> None:
    np.testing.assert_allclose(vertex_tangents(quad[0]), np.tile([1, 0, 0, 1], (4, 1)), atol=1e-7)


def test_turned_uv_turn_the_tangent(quad: Pair) -> None:
    atlas, _ = quad
    turned = np.column_stack([atlas.uv[:, 1], 1 - atlas.uv[:, 0]])
    np.testing.assert_allclose(vertex_tangents(replace(atlas, uv=turned)), np.tile([0, 1, 0, 1], (4, 1)), atol=1e-7)


def test_mirrored_uv_flip_the_sign(quad: Pair) -> None:
    atlas, _ = quad
    mirrored = np.column_stack([1 - atlas.uv[:, 0], atlas.uv[:, 1]])
    np.testing.assert_allclose(vertex_tangents(replace(atlas, uv=mirrored)), np.tile([-1, 0, 0, -1], (4, 1)), atol=1e-7)


def test_on_a_sphere_tangents_run_along_the_parallels(sphere: Pair) -> None:
    atlas, _ = sphere
    tangent = vertex_tangents(atlas)
    x, _, z = atlas.positions.T
    parallel = np.column_stack([z, np.zeros_like(x), -x]) / np.hypot(x, z)[:, None]
    assert (tangent[:, 3] == 1.0).all()
    assert np.einsum("ni,ni->n", tangent[:, :3], parallel).min() > np.cos(np.radians(10))
    inner = np.abs(atlas.uv[:, 0] - 0.5) < 0.44  # away from the cut, where faces lie on both sides
    assert np.einsum("ni,ni->n", tangent[inner, :3], parallel[inner]).min() > np.cos(np.radians(1.5))


def test_frames_are_orthonormal_and_the_bitangent_runs_along_v(sphere: Pair) -> None:
    atlas, _ = sphere
    tangent = vertex_tangents(atlas).astype(np.float64)
    normal = unit(atlas.normals.astype(np.float64))
    assert np.abs(np.linalg.norm(tangent[:, :3], axis=1) - 1).max() < 1e-6
    assert np.abs(np.einsum("ni,ni->n", tangent[:, :3], normal)).max() < 1e-6
    assert (np.cross(normal, tangent[:, :3])[:, 1] * tangent[:, 3] > 0).all()


def test_the_angles_of_a_flat_triangle_sum_to_pi(pair: Callable[..., Pair]) -> None:
    atlas, _ = pair([[0, 0, 0], [3, 0, 0], [1, 2, 0]], [[0, 1, 2]], [[0, 0], [1, 0], [0, 1]])
    normal = atlas.normals.astype(np.float64)
    corners = atlas.positions[atlas.faces]
    assert sum(corner_angles(corners, normal[:1], corner)[0] for corner in range(3)) == pytest.approx(np.pi)


def test_weights_are_angles_so_that_cutting_a_face_in_two_changes_nothing(pair: Callable[..., Pair]) -> None:
    def fan(angles: list[float]) -> Atlas:
        """Faces around vertex 0 on a cone; uv sheared on the far half so that the faces disagree."""
        turn = np.radians(angles)
        rim = np.column_stack([np.cos(turn), np.sin(turn), np.full(len(turn), -0.5)])
        positions = np.concatenate([np.zeros((1, 3)), rim])
        uv = 0.5 + 0.3 * np.column_stack([positions[:, 0] + np.maximum(positions[:, 1], 0) * 0.7, positions[:, 1]])
        faces = [[0, i, i + 1] for i in range(1, len(angles))]
        atlas, _ = pair(positions, faces, uv)
        normals = np.tile(np.array([0, 0, 1], np.float32), (len(positions), 1))
        return replace(atlas, normals=normals)

    coarse = vertex_tangents(fan([0, 90, 180, 270, 360]))[0]
    bent = fan([0, 90, 180, 270, 360])
    between = (bent.positions[1] + bent.positions[2]) / 2
    middle_uv = (bent.uv[1] + bent.uv[2]) / 2
    positions = np.insert(bent.positions, 2, between, axis=0)
    fine, _ = pair(positions, [[0, i, i + 1] for i in range(1, 6)], np.insert(bent.uv, 2, middle_uv, axis=0))
    fine = replace(fine, normals=np.tile(np.array([0, 0, 1], np.float32), (len(positions), 1)))
    np.testing.assert_allclose(vertex_tangents(fine)[0], coarse, atol=1e-6)


def test_faces_without_uv_area_still_give_unit_tangents(quad: Pair) -> None:
    atlas, _ = quad
    tangent = vertex_tangents(replace(atlas, uv=np.zeros((4, 2), np.float32)))
    np.testing.assert_allclose(np.linalg.norm(tangent[:, :3], axis=1), 1.0, atol=1e-6)
    np.testing.assert_allclose(tangent[:, 2], 0.0, atol=1e-6)
    assert (tangent[:, 3] == 1.0).all()


def test_any_perpendicular_is_perpendicular() -> None:
    normal = unit(np.random.default_rng(0).normal(size=(100, 3)))
    side = any_perpendicular(np.concatenate([normal, np.eye(3), -np.eye(3)]))
    np.testing.assert_allclose(np.einsum("ni,ni->n", side[:100], normal), 0.0, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(side, axis=1), 1.0, atol=1e-12)
