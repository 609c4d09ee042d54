"""As-rigid-as-possible steps: derivatives of a linear map, nearest rotations, isometric input back up to a motion."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.overlap import flipped_triangles
from flexpara.runtime.geometry.topology import boundary_loops
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.arap import RigidSteps, gradient, nearest_rotations, unfolded
from flexpara.train.finish.contact import excess_energy
from flexpara.train.finish.flatten import circle_map, jacobians


def flat_sheet(resolution: int) -> Surface:
    vertices, faces = make_sample("cloth", resolution=resolution)
    return Surface(vertices * [1.0, 1.0, 0.0], faces)


def rolled_sheet(resolution: int) -> Surface:
    """The sheet bent around a cylinder of radius ½: an isometry."""
    flat = flat_sheet(resolution)
    x, y, _ = flat.vertices.T
    return Surface(np.stack([0.5 * np.sin(2.0 * x), y, 0.5 * np.cos(2.0 * x)], axis=1), flat.faces)


def rotation(angle: float) -> np.ndarray:
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def test_the_gradient_takes_derivatives_as_jacobians_does() -> None:
    surface = Surface(*make_sample("cloth", resolution=8))
    uv = np.random.default_rng(0).normal(size=(len(surface.vertices), 2))
    first, second = np.split(gradient(surface) @ uv, 2)
    np.testing.assert_allclose(np.stack([first, second], axis=2), jacobians(surface, uv), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0, -3.0])
def test_a_rotation_is_its_own_nearest_at_any_scale(angle: float) -> None:
    found = nearest_rotations(np.stack([rotation(angle), 7.0 * rotation(angle)]))
    np.testing.assert_allclose(found, np.stack([rotation(angle)] * 2), atol=1e-12)


def test_the_nearest_rotation_is_that_of_the_singular_value_decomposition() -> None:
    matrix = np.random.default_rng(1).normal(size=(200, 2, 2))
    u, _, v = np.linalg.svd(matrix)
    sign = np.ones((200, 2))
    sign[:, 1] = np.linalg.det(u @ v)
    np.testing.assert_allclose(nearest_rotations(matrix), (u * sign[:, None]) @ v, atol=1e-9)


def test_a_zero_has_the_identity_for_its_nearest_rotation() -> None:
    assert np.array_equal(nearest_rotations(np.zeros((1, 2, 2)))[0], np.eye(2))


def test_an_isometry_comes_back_up_to_a_motion() -> None:
    surface, flat = rolled_sheet(12), flat_sheet(12)
    turned = flat.vertices[:, :2] @ rotation(0.7).T + 3.0
    # the chords of a bent sheet are a little shorter than its arcs: isometric to the folded one up to 1 %
    uv = RigidSteps(surface).run(nearest_rotations(jacobians(surface, turned)), 3)
    gap = (uv - uv[0]) - (turned - turned[0])
    assert np.abs(gap).max() < 0.03
    assert np.linalg.svd(jacobians(surface, uv), compute_uv=False) == pytest.approx(1.0, abs=0.01)


def test_a_flat_sheet_comes_back_exactly() -> None:
    sheet = flat_sheet(8)
    turned = sheet.vertices[:, :2] @ rotation(-1.1).T
    uv = RigidSteps(sheet).run(nearest_rotations(jacobians(sheet, turned)), 1)
    np.testing.assert_allclose(uv - uv[0], turned - turned[0], atol=1e-5)


def test_each_step_lowers_the_distance_to_the_rotations() -> None:
    surface = Surface(*make_sample("cloth", resolution=12))
    start = circle_map(surface, boundary_loops(surface.faces)[0])
    rigid, turn = RigidSteps(surface), nearest_rotations(jacobians(surface, start))

    def distance(uv: np.ndarray) -> float:
        jacobian = jacobians(surface, uv)
        return float((((jacobian - nearest_rotations(jacobian)) ** 2).sum(axis=(1, 2)) * surface.face_areas()).sum())

    energy = [distance(start), *(distance(rigid.run(turn, steps)) for steps in (1, 2, 4, 8))]
    assert energy == sorted(energy, reverse=True)
    assert energy[-1] < 0.1 * energy[0]


def test_a_layout_with_a_few_flips_loses_them() -> None:
    sheet = flat_sheet(8)
    folded = sheet.vertices[:, :2].copy()
    inner = int(np.linalg.norm(folded, axis=1).argmin())
    folded[inner] += [0.6, 0.1]
    assert flipped_triangles(folded[sheet.faces]).any()
    uv = unfolded(sheet, folded, 12)
    assert uv is not None
    assert not flipped_triangles(uv[sheet.faces]).any()
    assert excess_energy(sheet, uv) < 1.0


def test_flips_that_stay_are_refused() -> None:
    sheet = flat_sheet(8)
    assert unfolded(sheet, sheet.vertices[:, :2] * [-1.0, 1.0], 0) is None


def test_nothing_is_written_to() -> None:
    sheet = flat_sheet(8)
    uv = sheet.vertices[:, :2].copy()
    before = uv.copy()
    unfolded(sheet, uv, 3)
    assert np.array_equal(uv, before)
