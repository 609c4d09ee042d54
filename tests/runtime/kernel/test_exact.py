"""The kernel's tests of overlap against their twins: a triangle, needles, grids, clouds, what only integers decide."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.geometry.overlap import orientation_sign, overlapping_pairs, overlaps_anywhere
from flexpara.runtime.kernel.choice import kernel, twins_only

if TYPE_CHECKING:
    from collections.abc import Callable

pytestmark = pytest.mark.skipif(kernel() is None, reason="nothing was compiled")

ONE = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])


def both(uv: np.ndarray) -> np.ndarray:
    """The pairs that overlap, the same by the kernel and by its twin."""
    found = overlapping_pairs(uv)
    with twins_only():
        assert np.array_equal(found, overlapping_pairs(uv))
        assert overlaps_anywhere(uv) == (len(found) > 0)
    assert overlaps_anywhere(uv) == (len(found) > 0)
    assert found.dtype == np.int64
    return found


def test_one_triangle_overlaps_nothing() -> None:
    assert both(ONE).shape == (0, 2)
    assert both(np.zeros((0, 3, 2))).shape == (0, 2)


def test_two_triangles_overlap_by_the_last_bit_of_a_coordinate() -> None:
    beside = np.array([[[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]])
    assert len(both(np.concatenate([ONE, beside]))) == 0
    beside[0, 0, 0] = np.nextafter(1.0, 0.0)
    assert both(np.concatenate([ONE, beside])).tolist() == [[0, 1]]


def test_clockwise_triangles_count_and_those_without_area_do_not() -> None:
    flat = np.array([[[0.1, 0.1], [0.2, 0.2], [0.3, 0.3]]])
    assert both(np.concatenate([ONE, flat, ONE[:, ::-1] * 0.5 + 0.1])).tolist() == [[0, 2]]


@pytest.mark.parametrize("count", [10, 100, 1000])
def test_a_cloud_of_triangles_has_the_twins_pairs(count: int) -> None:
    rng = np.random.default_rng(count)
    size = rng.exponential(count**-0.5, (count, 1, 1))
    assert len(both(rng.random((count, 1, 2)) + size * rng.normal(size=(count, 3, 2)))) > 0


def test_needles_side_by_side_touch_without_overlap() -> None:
    step = np.arange(301.0)[:, None] * [1.0, -1.0] / 7.0
    a, b = step, step + 100.0 / 3.0
    needles = np.stack([np.stack([a[:-1], a[1:], b[1:]], axis=1), np.stack([a[:-1], b[1:], b[:-1]], axis=1)])
    both(needles.reshape(-1, 3, 2))


def test_points_on_a_grid_of_rounded_thirds_lie_where_integers_say() -> None:
    rng = np.random.default_rng(3)
    a, b, c = rng.integers(-4, 5, (3, 4000, 2)) / 3.0
    c[::2] = a[::2] + 3.0 * (b[::2] - a[::2])  # collinear but for roundings
    sign = orientation_sign(a, b, c)
    with twins_only():
        assert np.array_equal(sign, orientation_sign(a, b, c))
    assert set(sign.tolist()) == {-1, 0, 1}


def test_coordinates_too_small_for_the_kernel_are_left_to_the_twin() -> None:
    tiny = np.array([[1e-160, 0.0]]), np.array([[0.0, 1e-160]]), np.array([[0.0, 0.0]])
    compiled = kernel()
    assert compiled is not None
    assert compiled.orientation_sign(*tiny) is None
    assert orientation_sign(*tiny).tolist() == [1]
    assert both(np.concatenate([ONE, ONE]) * 1e-200).tolist() == [[0, 1]]


def sheet(side: int) -> tuple[np.ndarray, np.ndarray]:
    """A jittered grid of 2 · side² triangles: points (v, 2) and faces (f, 3)."""
    across = np.arange(side + 1.0)
    points = np.stack(np.meshgrid(across, across, indexing="ij"), axis=2).reshape(-1, 2)
    points += np.random.default_rng(side).uniform(-0.2, 0.2, points.shape)
    index = np.arange(len(points)).reshape(side + 1, side + 1)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    return points, np.stack([np.stack([a, b, c], axis=2), np.stack([a, c, d], axis=2)]).reshape(-1, 3)


def pinched(points: np.ndarray) -> np.ndarray:
    """A corner of the sheet laid over its inside, by a bend far from it."""
    return np.where((points[:, :1] > 30.0) & (points[:, 1:] > 30.0), points - 12.3, points)


def rolled(points: np.ndarray) -> np.ndarray:
    """The sheet around a centre, a little more than once."""
    turn = points[:, 1] / 6.0
    return (points[:, 0] + 7.0)[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=1)


LARGE = {
    "whole": lambda points: points,
    "rolled up": rolled,
    "a corner over the inside": pinched,
    "one vertex pulled across": lambda points: points + 2.5 * (np.arange(len(points)) == 800)[:, None],
    "folded in the middle": lambda points: np.abs(points - [20.3, 0.0]),
}


@pytest.mark.parametrize("move", LARGE.values(), ids=list(LARGE))
def test_of_many_triangles_those_along_the_rim_tell_whether_any_overlap(
    move: Callable[[np.ndarray], np.ndarray],
) -> None:
    points, faces = sheet(40)
    assert len(faces) > 2000
    found = both(move(points)[faces])
    assert (len(found) == 0) == (move is LARGE["whole"])


def test_a_map_that_winds_twice_around_a_vertex_overlaps_though_no_triangle_is_flipped() -> None:
    points, faces = sheet(40)
    z = (points - points[840]) @ [1.0, 1.0j]
    twice = z**2 / np.maximum(np.abs(z), 1e-9)
    uv = np.stack([twice.real, twice.imag], axis=1)[faces]
    assert len(both(uv)) > 100


def test_two_sheets_upon_each_other_overlap_face_by_face() -> None:
    points, faces = sheet(40)
    assert len(both(np.concatenate([points[faces], points[faces]]))) >= len(faces)
