"""The lattice: a square by hand, then slivers of every kind that rounding turns over, and what cannot be mended."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import edge_table, split_non_manifold_vertices
from flexpara.runtime.pack.config import LatticeConfig
from flexpara.runtime.pack.exact.lattice import STEPS, Snapped, snap

NEAR_EDGE, NEAR_CORNER = [0.5 - 1e-9, 0.5, 1e-9], [1.0 - 2e-9, 1e-9, 1e-9]
TURN = np.array([[np.cos(0.3), -np.sin(0.3)], [np.sin(0.3), np.cos(0.3)]])


def snapped(uv: NDArray[np.float64], faces: NDArray[np.int64], chart: NDArray[np.int64] | None = None) -> Snapped:
    chart = np.zeros(len(faces), dtype=np.int64) if chart is None else chart
    table = edge_table(faces)
    return snap(uv, faces, chart, table.boundary[table.face_edges], LatticeConfig())


def rounding_flips(uv: NDArray[np.float64], faces: NDArray[np.int64]) -> int:
    return int(flipped_triangles(np.rint(uv * STEPS)[faces]).sum())


def assert_valid_as_written(found: Snapped, faces: NDArray[np.int64]) -> None:
    """In float32, v up and v down: every triangle upright, no two over each other."""
    written = (found.points / STEPS).astype(np.float32)
    assert np.array_equal(written.astype(np.float64) * STEPS, found.points)
    down = written.copy()
    down[:, 1] = np.float32(1.0) - down[:, 1]
    assert found.invalid.tolist() == []
    assert not flipped_triangles(written[faces].astype(np.float64)).any()
    assert not flipped_triangles(down[faces][:, ::-1].astype(np.float64)).any()
    assert len(overlapping_pairs(written[faces].astype(np.float64))) == 0
    assert len(overlapping_pairs(down[faces].astype(np.float64))) == 0


def strip(count: int, width: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A band of triangles of that width, slanted."""
    x = np.linspace(0.1, 0.9, count)
    uv = np.concatenate([np.stack([x, np.full(count, 0.5 + side)], axis=1) for side in (0.0, width)])
    i = np.arange(count - 1)
    lower, upper = np.stack([i, i + 1, count + i + 1], axis=1), np.stack([i, count + i + 1, count + i], axis=1)
    return (uv - 0.5) @ TURN.T + 0.5, np.concatenate([lower, upper])


def fan(count: int, angle: float) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Triangles around one corner that fill an angle."""
    turn = 0.5 + np.linspace(0.0, angle, count + 1)
    uv = np.concatenate([[[0.2, 0.3]], 0.6 * np.stack([np.cos(turn), np.sin(turn)], axis=1) + [0.2, 0.3]])
    i = np.arange(1, count + 1)
    return uv, np.stack([np.zeros(count, dtype=np.int64), i, i + 1], axis=1)


def grid(side: int) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    x = np.linspace(0.1, 0.9, side)
    uv = np.stack(np.meshgrid(x, x, indexing="ij"), axis=-1).reshape(-1, 2)
    corner = np.arange(side * side).reshape(side, side)
    a, b, c, d = (part.reshape(-1) for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    return (uv - 0.5) @ TURN.T * 0.8 + 0.5, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def split(
    uv: NDArray[np.float64], faces: NDArray[np.int64], chosen: NDArray[np.int64], weight: list[float]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The chosen faces split at a point inside, given by its barycentric coordinates."""
    a, b, c = faces[chosen].T
    fresh = len(uv) + np.arange(len(chosen))
    inner = [np.stack([*pair, fresh], axis=1) for pair in ((a, b), (b, c), (c, a))]
    uv = np.concatenate([uv, np.einsum("c,fcd->fd", np.array(weight), uv[faces[chosen]])])
    return uv, np.concatenate([np.delete(faces, chosen, axis=0), *inner])


def test_a_square_is_only_rounded() -> None:
    uv = np.array([[0.1, 0.1], [0.9, 0.1], [0.9, 0.9], [0.1, 0.9]])
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    found = snapped(uv, faces)
    assert np.array_equal(found.points, np.rint(uv * STEPS))
    assert (found.moved, found.farthest) == (0, 0.0)
    assert_valid_as_written(found, faces)


def test_a_mirrored_chart_stays_mirrored() -> None:
    uv, faces = strip(20, 1e-9)
    found = snapped(uv[:, ::-1], faces)
    assert flipped_triangles(found.points[faces]).all()
    assert found.invalid.tolist() == []


@pytest.mark.parametrize("width", [1e-6, 1e-7, 1e-8, 1e-9, 0.0])
@pytest.mark.parametrize("count", [2, 10, 500])
def test_a_strip_of_no_width_gets_the_width_of_two_steps(count: int, width: float) -> None:
    uv, faces = strip(count, width)
    found = snapped(uv, faces)
    assert_valid_as_written(found, faces)
    assert found.farthest < 4.0


def test_rounding_alone_turns_such_a_strip_over() -> None:
    assert rounding_flips(*strip(500, 1e-9)) > 500


@pytest.mark.parametrize(("count", "angle"), [(4, 1e-9), (20, 1e-8), (100, 1e-8), (100, 0.0)])
def test_a_fan_of_needles_spreads(count: int, angle: float) -> None:
    uv, faces = fan(count, angle)
    assert rounding_flips(uv, faces) > count // 2
    found = snapped(uv, faces)
    assert_valid_as_written(found, faces)
    assert found.farthest < 3.0 * count + 3.0


@pytest.mark.parametrize("weight", [NEAR_EDGE, NEAR_CORNER, [0.5, 0.5, 0.0], [1.0, 0.0, 0.0]])
def test_points_on_an_edge_or_a_corner_of_a_triangle_move_inside(weight: list[float]) -> None:
    uv, faces = grid(20)
    uv, faces = split(uv, faces, np.arange(0, len(faces), 3), weight)
    assert rounding_flips(uv, faces) > 50
    found = snapped(uv, faces)
    assert_valid_as_written(found, faces)
    assert found.farthest < 12.0


def test_needles_among_needles_are_mended_too() -> None:
    uv, faces = grid(20)
    for _ in range(3):
        uv, faces = split(uv, faces, np.arange(len(faces) - 200, len(faces)), NEAR_EDGE)
    assert_valid_as_written(snapped(uv, faces), faces)


def test_a_chart_that_no_small_change_makes_valid_is_named() -> None:
    """A point at the tip of a needle, inside: to fit in, it would have to move along half the needle."""
    uv, faces = grid(4)
    for _ in range(4):
        uv, faces = split(uv, faces, np.array([len(faces) - 1]), NEAR_CORNER)
    assert snapped(uv, faces).invalid.tolist() == [0]


def test_the_sides_of_a_closed_slit_do_not_cross() -> None:
    side = 30
    uv, faces = grid(side)
    table = edge_table(faces)
    slit = ((table.edges // side == 15) & (table.edges % side > 5)).all(axis=1)
    faces, old = split_non_manifold_vertices(faces, slit, table)
    noisy = uv[old] + 1e-9 * np.random.default_rng(0).normal(size=(len(old), 2))
    found = snapped(noisy, faces)
    assert_valid_as_written(found, faces)
    assert found.farthest < 5.0


def test_a_chart_that_lies_over_itself_is_named_and_the_others_are_not() -> None:
    uv, faces = grid(6)
    count = len(uv)
    folded = uv.copy()
    folded[35] = uv[0]  # a corner of the square laid over the one across
    both = np.concatenate([0.4 * uv, 0.4 * folded + 0.5])
    chart = np.repeat([0, 1], len(faces))
    found = snapped(both, np.concatenate([faces, faces + count]), chart)
    assert found.invalid.tolist() == [1]
    assert np.array_equal(found.points[:count], np.rint(0.4 * uv * STEPS))
