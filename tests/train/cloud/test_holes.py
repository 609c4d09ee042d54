"""Closing small holes: what is closed, what stays open, and that nothing is folded."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.normals import smooth_normals
from flexpara.runtime.geometry.topology import boundary_loops, euler_characteristic, is_manifold
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.cloud.config import CloudConfig
from flexpara.train.cloud.holes import hole_triangles, simple_loops

CONFIG = CloudConfig()


def closed(vertices: np.ndarray, faces: np.ndarray, spacing: float = 0.1) -> np.ndarray:
    """The triangles that close holes."""
    normals = smooth_normals(Surface(vertices, faces))
    return hole_triangles(vertices, normals, np.full(len(vertices), spacing), faces, CONFIG)


def test_a_missing_triangle_comes_back() -> None:
    vertices, faces = make_sample("sphere", resolution=24)
    found = closed(vertices, faces[1:], 0.25)
    np.testing.assert_array_equal(np.sort(found), np.sort(faces[:1]))
    assert is_manifold(np.concatenate([faces[1:], found]))


@pytest.mark.parametrize("valence", [5, 6])
def test_a_missing_vertex_leaves_a_polygon_that_is_closed_without_it(valence: int) -> None:
    vertices, faces = make_sample("sphere", resolution=24)
    vertex = int(np.flatnonzero(np.bincount(faces.ravel()) == valence)[0])
    rest = faces[(faces != vertex).all(axis=1)]
    found = closed(vertices, rest, 0.25)
    assert len(found) == valence - 2
    whole = np.concatenate([rest, found])
    assert is_manifold(whole)
    assert euler_characteristic(whole) == 2


def test_a_loop_is_taken_apart_where_it_touches_itself() -> None:
    parts = simple_loops(np.array([9, 1, 2, 3, 2, 4, 1]))
    assert [part.tolist() for part in parts] == [[2, 3], [1, 2, 4], [9, 1]]
    assert [part.tolist() for part in simple_loops(np.array([4, 5, 6]))] == [[4, 5, 6]]


def test_two_holes_that_touch_in_a_point_are_both_closed() -> None:
    vertices, faces = make_sample("sphere", resolution=24)
    around = np.flatnonzero((faces == 100).any(axis=1))
    fan = faces[around]
    apart = [i for i in range(1, len(fan)) if len(np.intersect1d(fan[0], fan[i])) == 1]
    rest = np.delete(faces, [around[0], around[apart[0]]], axis=0)
    assert is_manifold(np.concatenate([rest, closed(vertices, rest, 0.25)]))


def test_the_border_of_a_sheet_and_of_an_island_stay_open() -> None:
    vertices, faces = make_sample("cloth", resolution=16)
    assert len(closed(vertices, faces)) == 0
    triangle = np.array([[0.0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]])
    assert len(closed(triangle, np.array([[0, 1, 2]]))) == 0


def test_a_hole_wider_than_the_limit_stays_open() -> None:
    vertices, faces = make_sample("sphere", resolution=24)
    rest = faces[(faces != 0).all(axis=1)]
    assert len(boundary_loops(rest)) == 1
    assert len(closed(vertices, rest, 0.05)) == 0
