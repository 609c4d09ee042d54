"""The kernel's index tables against their twins, to the bit: one triangle, strips, closed surfaces, soups."""

from __future__ import annotations

from dataclasses import fields

import numpy as np
import pytest

from flexpara.runtime.geometry.cutgraph import shortest_paths
from flexpara.runtime.geometry.topology import (
    boundary_loops,
    components,
    edge_table,
    face_components,
    split_non_manifold_vertices,
)
from flexpara.runtime.kernel.choice import kernel, twins_only
from flexpara.runtime.samples import make_sample

pytestmark = pytest.mark.skipif(kernel() is None, reason="nothing was compiled")


def soup(seed: int) -> np.ndarray:
    """Random faces over few vertices: edges of many faces, fans that touch, orientations that disagree."""
    rng = np.random.default_rng(seed)
    faces = rng.integers(0, 12, (40, 3))
    return faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]


MESHES = {
    "nothing": np.zeros((0, 3), dtype=np.int64),
    "triangle": np.array([[4, 2, 7]]),
    "two that touch in a point": np.array([[0, 1, 2], [2, 3, 4]]),
    "three along an edge": np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]),
    "sphere": make_sample("sphere", resolution=8)[1],
    "sphere with holes": make_sample("sphere", resolution=8)[1][5:-9:2],
    "torus": make_sample("torus", resolution=8)[1],
    **{f"soup {seed}": soup(seed) for seed in range(20)},
}


@pytest.fixture(params=MESHES.values(), ids=list(MESHES))
def faces(request: pytest.FixtureRequest) -> np.ndarray:
    return request.param.astype(np.int64)


def test_edge_tables_are_equal(faces: np.ndarray) -> None:
    found = edge_table(faces)
    with twins_only():
        expected = edge_table(faces)
    for field in fields(expected):
        ours, theirs = getattr(found, field.name), getattr(expected, field.name)
        assert ours.dtype == theirs.dtype, field.name
        assert ours.shape == theirs.shape, field.name
        assert np.array_equal(ours, theirs), field.name


def test_what_is_cut_open_is_equal(faces: np.ndarray) -> None:
    table = edge_table(faces)
    for cut in (None, np.random.default_rng(1).random(len(table.edges)) < 0.3):
        found = split_non_manifold_vertices(faces, cut)
        with twins_only():
            expected = split_non_manifold_vertices(faces, cut)
        assert all(np.array_equal(ours, theirs) for ours, theirs in zip(found, expected, strict=True))


def test_loops_and_components_are_equal(faces: np.ndarray) -> None:
    loops, parts = boundary_loops(faces), components(faces)
    pairs = faces[:, :2] % max(len(faces), 1)
    with twins_only():
        assert [loop.tolist() for loop in loops] == [loop.tolist() for loop in boundary_loops(faces)]
        assert np.array_equal(parts, components(faces))
        assert np.array_equal(face_components(len(faces), pairs), face_components(len(faces), pairs))
    assert np.array_equal(face_components(3, np.array([[2, 1]])), [0, 1, 1])


def test_shortest_paths_are_equal(faces: np.ndarray) -> None:
    edges, count = edge_table(faces).edges, int(faces.max(initial=0)) + 1
    cost = np.random.default_rng(2).random(len(edges)) + 0.1
    for sources in (np.array([0]), np.unique(faces)[::5]):
        if len(edges) == 0:
            continue
        found = shortest_paths(count, edges, cost, sources)
        with twins_only():
            expected = shortest_paths(count, edges, cost, sources)
        assert found.distance == pytest.approx(expected.distance, abs=1e-12)
        assert np.array_equal(found.parent, expected.parent)


def test_a_wrong_index_is_an_error_and_no_crash() -> None:
    for wrong in ([[0, 1, -1]], [[-5, 1, 2]]):
        with pytest.raises(IndexError):
            edge_table(np.array(wrong))
    with pytest.raises(IndexError):
        face_components(2, np.array([[0, 2]]))
    with pytest.raises(IndexError):
        shortest_paths(2, np.array([[0, 2]]), np.ones(1), np.array([0]))
