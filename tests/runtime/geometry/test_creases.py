"""Normals by creases and smoothing groups: a hinge and a cube by hand, then a ball."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.creases import fan_normals
from flexpara.runtime.geometry.normals import smooth_normals
from flexpara.runtime.mesh import Surface

LIMIT = np.deg2rad(30.0)


def surface_of(mesh: trimesh.Trimesh) -> Surface:
    return Surface(np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64))


def hinge(degrees: float) -> Surface:
    """Two triangles along the y axis, one flat, the other bent down by an angle."""
    bend = np.deg2rad(degrees)
    vertices = np.array([[0, 0, 0], [0, 1, 0], [-1, 0.5, 0], [np.cos(bend), 0.5, -np.sin(bend)]])
    return Surface(vertices, np.array([[0, 1, 2], [1, 0, 3]]))


def turned(degrees: float) -> list[float]:
    """The normal of a face that is bent down by an angle."""
    return [float(np.sin(np.deg2rad(degrees))), 0.0, float(np.cos(np.deg2rad(degrees)))]


def test_a_hinge_under_the_angle_shares_its_normals() -> None:
    normals = fan_normals(hinge(29.0), LIMIT)
    assert normals[0, :2] == pytest.approx(np.array([turned(14.5)] * 2))
    assert normals[1, :2] == pytest.approx(np.array([turned(14.5)] * 2))
    assert normals[0, 2] == pytest.approx([0.0, 0.0, 1.0])
    assert normals[1, 2] == pytest.approx(turned(29.0))


def test_a_hinge_over_the_angle_is_sharp() -> None:
    normals = fan_normals(hinge(31.0), LIMIT)
    assert normals[0] == pytest.approx(np.array([[0.0, 0.0, 1.0]] * 3))
    assert normals[1] == pytest.approx(np.array([turned(31.0)] * 3))


def test_a_smoothing_group_joins_what_the_angle_would_part() -> None:
    normals = fan_normals(hinge(90.0), LIMIT, smoothing=np.array([1, 1]))
    assert normals[0, 0] == pytest.approx(turned(45.0))
    assert normals[1, 1] == pytest.approx(turned(45.0))


@pytest.mark.parametrize("groups", [(0, 0), (1, 2), (1, 0)])
def test_faces_without_a_common_group_are_parted_below_the_angle(groups: tuple[int, int]) -> None:
    normals = fan_normals(hinge(10.0), LIMIT, smoothing=np.array(groups))
    assert normals[0] == pytest.approx(np.array([[0.0, 0.0, 1.0]] * 3))
    assert normals[1] == pytest.approx(np.array([turned(10.0)] * 3))


def test_the_triangles_of_a_polygon_stay_joined() -> None:
    place = np.array([[0, 1, 2], [1, 0, 3]])
    normals = fan_normals(hinge(40.0), LIMIT, smoothing=np.array([0, 0]), place=place)
    assert normals[0, 0] == pytest.approx(turned(20.0))
    assert normals[0, 0].tolist() == normals[1, 1].tolist()


def test_faces_of_opposite_winding_are_not_joined() -> None:
    flat = hinge(0.0)
    opposite = Surface(flat.vertices, np.array([[0, 1, 2], [0, 1, 3]]))
    normals = fan_normals(opposite, np.pi)
    assert normals[:, 0, 2] == pytest.approx([1.0, -1.0])


def test_a_cube_shades_with_its_facets() -> None:
    cube = surface_of(trimesh.creation.box())
    assert fan_normals(cube, LIMIT) == pytest.approx(np.repeat(cube.face_normals()[:, None], 3, axis=1))


def test_a_ball_stays_as_smooth_as_it_was() -> None:
    ball = surface_of(trimesh.creation.icosphere(subdivisions=2))
    assert fan_normals(ball, LIMIT).tolist() == smooth_normals(ball)[ball.faces].tolist()


def test_a_coarse_ball_is_smooth_although_faces_at_a_vertex_differ_by_more() -> None:
    """Edges decide, not pairs of faces around a vertex."""
    ball = surface_of(trimesh.creation.icosphere(subdivisions=1))
    cosines = ball.face_normals() @ ball.face_normals().T
    around = (ball.faces[:, None, :, None] == ball.faces[None, :, None, :]).any(axis=(2, 3))
    assert np.rad2deg(np.arccos(cosines[around].min())) > 30.0
    assert np.linalg.norm(fan_normals(ball, LIMIT) - ball.triangles, axis=2).max() < 0.05


def test_inside_the_rounding_of_a_part_normals_are_the_weighted_mean_as_ever() -> None:
    """A ball that is cut open: its rim is sharp to the lid, its inside is not."""
    ball = surface_of(trimesh.creation.icosphere(subdivisions=3))
    used, faces = np.unique(ball.faces[ball.triangles.mean(axis=1)[:, 2] > 0.0], return_inverse=True)
    dome = Surface(ball.vertices[used], faces.reshape(-1, 3))
    lid = np.array([[0.0, 0.0, 0.0]])
    rim = [pair for pair, count in edges_of(dome) if count == 1]
    cover = np.array([[b, a, len(dome.vertices)] for a, b in rim])
    closed = Surface(np.concatenate([dome.vertices, lid]), np.concatenate([dome.faces, cover]))
    inside = np.arange(len(dome.faces))
    expected = smooth_normals(dome)[dome.faces]
    assert fan_normals(closed, LIMIT)[inside] == pytest.approx(expected, abs=1e-12)


def edges_of(surface: Surface) -> list[tuple[tuple[int, int], int]]:
    """Directed edges of the faces, and how many faces run along each."""
    directed = [(int(face[i]), int(face[(i + 1) % 3])) for face in surface.faces for i in range(3)]
    count = {frozenset(pair): 0 for pair in directed}
    for pair in directed:
        count[frozenset(pair)] += 1
    return [(pair, count[frozenset(pair)]) for pair in directed]
