"""Congruent charts: triangles by hand, turned and mirrored copies, near misses, other triangulations, layers."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.mesh import Charts
from flexpara.runtime.pack.config import StackConfig
from flexpara.runtime.pack.growing.outlines import rotation
from flexpara.runtime.pack.stacking import MIRROR, Stacks, find_stacks

SCALENE = np.array([[[0.0, 0.0], [3.0, 0.0], [0.5, 1.0]]])
SQUARE = np.array([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]], [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
OTHER_DIAGONAL = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], [[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])


def stacks_of(*parts: np.ndarray, mirrored: bool = False) -> Stacks:
    """Of charts that are triangles (n, 3, 2) each; the outline of each is its hull's, in any order."""
    chart = np.repeat(np.arange(len(parts)), [len(part) for part in parts])
    charts = Charts(chart, np.concatenate(parts), chart, np.arange(len(parts)), ("slim",) * len(parts))
    return find_stacks(charts, [border(part) for part in parts], StackConfig(), mirrored=mirrored)


def border(part: np.ndarray) -> np.ndarray:
    """(s, 2, 2) edges of triangles (n, 3, 2) that only one of them has."""
    edges = np.stack([part, np.roll(part, -1, axis=1)], axis=2).reshape(-1, 2, 2)
    keys = [frozenset(map(tuple, np.round(edge, 9).tolist())) for edge in edges]
    return edges[[keys.count(key) == 1 for key in keys]]


def laid(part: np.ndarray, motion: np.ndarray) -> np.ndarray:
    return part @ motion[:, :2].T + motion[:, 2]


@pytest.mark.parametrize("angle", [0.0, 0.3, 2.0, -3.0])
def test_a_turned_and_moved_copy_is_laid_on_the_first(angle: float) -> None:
    copy = SCALENE @ rotation(angle).T + [7.0, -2.0]
    found = stacks_of(SCALENE, copy)
    assert found.on.tolist() == [0, 0]
    assert np.allclose(laid(copy, found.motion[1]), SCALENE, atol=1e-9)
    assert np.allclose(found.motion[0], np.eye(2, 3))


def test_a_mirror_image_is_laid_on_the_first_only_where_that_is_allowed() -> None:
    image = SCALENE @ MIRROR.T @ rotation(1.0).T
    assert stacks_of(SCALENE, image).on.tolist() == [0, 1]
    found = stacks_of(SCALENE, image, mirrored=True)
    assert found.on.tolist() == [0, 0]
    assert np.allclose(laid(image, found.motion[1]), SCALENE, atol=1e-9)
    assert np.linalg.det(found.motion[1][:, :2]) == pytest.approx(-1.0)


def test_the_triangulation_of_a_shape_does_not_matter() -> None:
    assert stacks_of(SQUARE, OTHER_DIAGONAL @ rotation(0.7).T).on.tolist() == [0, 0]


@pytest.mark.parametrize(("change", "alike"), [(1e-4, True), (1e-2, False)])
def test_shapes_are_congruent_within_the_tolerance_and_not_beyond(change: float, alike: bool) -> None:
    other = SCALENE.copy()
    other[0, 2, 1] += change
    assert (stacks_of(SCALENE, other).on.tolist() == [0, 0]) == alike


def test_shapes_of_the_same_area_radius_and_inertia_are_still_compared() -> None:
    ears = [SQUARE, SQUARE * 0.2 + [1.0, 0.0], SQUARE * 0.2 + [-0.2, 0.8]]
    moved = [SQUARE, SQUARE * 0.2 + [1.0, 0.8], SQUARE * 0.2 + [-0.2, 0.0]]
    found = stacks_of(np.concatenate(ears), np.concatenate(moved))
    assert found.on.tolist() == [0, 1]
    assert stacks_of(np.concatenate(ears), np.concatenate(moved), mirrored=True).on.tolist() == [0, 0]


def test_a_size_of_its_own_is_a_shape_of_its_own() -> None:
    assert stacks_of(SQUARE, 1.1 * SQUARE, SQUARE + 5.0).on.tolist() == [0, 1, 0]


def test_layers_count_what_lies_beneath() -> None:
    found = Stacks(np.array([0, 1, 0, 1, 0, 5]), np.zeros((6, 2, 3)))
    assert found.layer.tolist() == [0, 0, 1, 1, 2, 0]
