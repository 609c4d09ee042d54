"""Flaps: faces that lie over their own piece are taken off it and put on to another."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.overlap import overlapping_pairs
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.train.finish.config import FlapConfig
from flexpara.train.finish.flaps import are_clear, attached, flap_faces, restricted, trimmed
from flexpara.train.finish.pieces import Overlapping, measured
from flexpara.train.finish.slits import Flat

STRIP = Surface(
    np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [1, 1, 0], [2, 0, 0], [2, 1, 0]]),
    np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [3, 4, 5]]),
)
"""Two unit squares of two triangles each."""


def layout(uv: np.ndarray) -> Flat:
    return Flat(STRIP, uv, {})


def folded() -> Overlapping:
    """The strip flat, but for its last vertex, which is drawn over the first square."""
    uv = STRIP.vertices[:, :2].copy()
    uv[4:] = [[1.0, -0.5], [0.4, 0.3]]
    faces = np.array([[0, 2, 1], [1, 2, 3], [2, 4, 3], [4, 5, 3]])
    return Overlapping(np.arange(4), Flat(Surface(STRIP.vertices, faces), uv, {}), ())


def test_without_its_flaps_nothing_overlaps() -> None:
    corners = np.array([[[0.0, 0], [2, 0], [0, 2]], [[0.5, 0.5], [0.7, 0.5], [0.5, 0.7]], [[5, 5], [6, 5], [5, 6]]])
    assert flap_faces(corners, np.array([2.0, 0.02, 0.5])).tolist() == [False, True, False]
    assert not flap_faces(corners[[0, 2]], np.array([2.0, 0.5])).any()


def test_a_piece_is_trimmed_of_its_smallest_faces_that_overlap() -> None:
    found = folded()
    assert len(overlapping_pairs(found.flat.uv[found.flat.surface.faces])) > 0
    less = trimmed(found.flat.surface, found, 2.0, 0.5)
    assert less is not None
    assert len(overlapping_pairs(less.piece.flat.uv[less.piece.flat.surface.faces])) == 0
    taken = np.concatenate(less.flaps)
    assert sorted([*less.piece.ids.tolist(), *taken.tolist()]) == [0, 1, 2, 3]
    assert less.rim > 0.0
    assert trimmed(found.flat.surface, found, 2.0, 0.01) is None


def test_a_part_of_a_flattening_stays_where_it_is() -> None:
    part = restricted(layout(STRIP.vertices[:, :2]), np.array([3, 2]))
    assert np.array_equal(part.surface.triangles, STRIP.triangles[[3, 2]])
    assert np.array_equal(part.uv[part.surface.faces], STRIP.vertices[:, :2][STRIP.faces[[3, 2]]])


def test_a_flap_is_laid_beside_a_piece_at_its_own_size() -> None:
    table = edge_table(STRIP.faces)
    square = measured(STRIP, np.arange(2), restricted(layout(2.0 + STRIP.vertices[:, :2]), np.arange(2)), 2.0)
    found = attached(square, STRIP, table, np.array([3, 2]), FlapConfig())
    assert found is not None
    ids, flat = found
    assert ids.tolist() == [0, 1, 2, 3]
    np.testing.assert_allclose(flat.uv[flat.surface.faces], 2.0 + STRIP.vertices[:, :2][STRIP.faces], atol=1e-12)
    assert np.array_equal(flat.surface.triangles, STRIP.triangles)


def test_a_flap_that_touches_nothing_is_not_attached() -> None:
    table = edge_table(STRIP.faces)
    one = measured(STRIP, np.array([0]), restricted(layout(STRIP.vertices[:, :2]), np.array([0])), 2.0)
    assert attached(one, STRIP, table, np.array([3]), FlapConfig()) is None


@pytest.mark.parametrize("tries", [0, 3])
def test_where_a_flap_fits_at_one_edge_alone_it_is_put_there(tries: int) -> None:
    """The face between two parts that were laid out past each other flips between them, and fits at either."""
    moved = STRIP.vertices[:, :2].copy()
    rows = np.array([0, 1, 3])
    faces = np.array([[0, 2, 1], [1, 2, 3], [6, 4, 5]])
    points = np.concatenate([STRIP.vertices, STRIP.vertices[[3]]])
    uv = np.concatenate([moved, moved[[3]]])
    uv[[4, 5, 6]] -= [7.0, 0.0]
    piece = measured(STRIP, rows, Flat(Surface(points, faces), uv, {}), 2.0)
    found = attached(piece, STRIP, edge_table(STRIP.faces), np.array([2]), FlapConfig(edges=tries))
    assert (found is not None) == (tries > 0)


def test_a_point_upon_another_is_not_clear_of_it() -> None:
    uv = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1e-9]])
    assert not are_clear(uv, 3, 1e-6)
    assert are_clear(uv[:3], 2, 1e-6)
    assert are_clear(uv[:3], 3, 1e-6)
