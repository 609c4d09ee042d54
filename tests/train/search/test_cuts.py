"""Cuts: chains of faces by hand, a tube cut across, a dumbbell cut at its neck."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.search.cuts import Links, cut_between, halves, necks, overlap_sides
from flexpara.train.search.labels import DualGraph, dual_graph

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

# four faces in a row, a unit apart, with borders of length 1, 2 and 3
CHAIN = DualGraph(np.array([[0, 1], [1, 2], [2, 3]]), np.array([1.0, 2, 3]), np.array([1.0, 2, 3]))
CENTROIDS = np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [3, 0, 0]])


def links_of(surface: Surface, ids: NDArray[np.int64] | None = None) -> Links:
    graph = dual_graph(surface, edge_table(surface.faces), SeamPrices(crease_discount=0.0))
    return Links(np.arange(len(surface.faces)) if ids is None else ids, graph, len(surface.faces))


def dumbbell(around: int = 24, rows: int = 60) -> Surface:
    """Two balls of radius 1 around z = ±1.5, joined by a neck of radius 0.2 and length 1: closed."""
    z = np.linspace(-2.5, 2.5, rows + 2)[1:-1]
    radius = np.maximum(np.sqrt(np.maximum(1.0 - (np.abs(z) - 1.5) ** 2, 0.0)), 0.2)
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[:, None]
    side = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.tile(z, (around, 1))], axis=-1)
    corner = np.arange(around * rows).reshape(around, rows)
    ahead = np.roll(corner, -1, axis=0)
    a, b, c, d = (part.ravel() for part in (corner[:, :-1], ahead[:, :-1], ahead[:, 1:], corner[:, 1:]))
    low, high = np.full(around, corner.size), np.full(around, corner.size + 1)
    caps = [np.stack([corner[:, -1], ahead[:, -1], high], 1), np.stack([ahead[:, 0], corner[:, 0], low], 1)]
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1), *caps])
    return Surface(np.concatenate([side.reshape(-1, 3), [[0.0, 0.0, -2.5], [0.0, 0.0, 2.5]]]), faces)


def test_links_join_only_faces_of_the_set_and_name_them_by_position() -> None:
    links = Links(np.array([2, 1, 0]), CHAIN, 4)
    assert np.stack([links.i, links.j]).T.tolist() == [[2, 1], [1, 0]]
    assert links.length.tolist() == [1.0, 2.0]


def test_the_cut_between_two_sides_has_the_length_of_their_border_and_leaves_connected_parts() -> None:
    links = Links(np.arange(4), CHAIN, 4)
    side = np.array([True, False, False, True])
    assert links.cut_length(side) == 4.0
    assert [part.tolist() for part in links.parts(side)] == [[0], [1, 2], [3]]


def test_distance_is_counted_from_centroid_to_centroid() -> None:
    links = Links(np.arange(4), CHAIN, 4)
    assert links.distance(CENTROIDS, np.array([0])) == pytest.approx([0.0, 1, 2, 3])
    assert links.distance(CENTROIDS, np.array([0, 3])) == pytest.approx([0.0, 1, 1, 0])


def test_halves_of_a_chain_are_two_and_two() -> None:
    assert sorted(part.tolist() for part in halves(Links(np.arange(4), CHAIN, 4), CENTROIDS)) == [[0, 1], [2, 3]]


@pytest.mark.parametrize("count", [2, 3, 5])
def test_halves_are_never_the_whole(count: int) -> None:
    pairs = np.stack([np.arange(count - 1), np.arange(1, count)], axis=1)
    graph = DualGraph(pairs, np.ones(count - 1), np.ones(count - 1))
    parts = halves(Links(np.arange(count), graph, count), np.zeros((count, 3)) + np.arange(count)[:, None])
    assert len(parts) > 1
    assert sorted(np.concatenate(parts).tolist()) == list(range(count))


def test_overlap_of_two_patches_has_them_for_sides() -> None:
    """Faces 0, 1 share an edge, and 2, 3; each of the first lies over each of the second."""
    faces = np.array([[0, 1, 2], [2, 1, 3], [4, 5, 6], [6, 5, 7]])
    first, second = overlap_sides(faces, np.array([[0, 2], [0, 3], [1, 2]]))
    assert {tuple(first.tolist()), tuple(second.tolist())} == {(0, 1), (2, 3)}


def test_the_two_patches_with_most_overlap_are_the_sides() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3], [4, 5, 6], [7, 8, 9]])
    first, second = overlap_sides(faces, np.array([[0, 2], [1, 2], [0, 3]]))
    assert {tuple(first.tolist()), tuple(second.tolist())} == {(0, 1), (2,)}


def test_a_patch_over_itself_is_told_apart_by_two_faces() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3], [3, 1, 4]])
    first, second = overlap_sides(faces, np.array([[0, 2], [0, 1]]))
    assert (first.tolist(), second.tolist()) == ([0], [2])


def test_a_tube_is_cut_across_between_its_ends() -> None:
    tube = Surface(*make_sample("tube", resolution=24))
    centroids = tube.triangles.mean(axis=1)
    ends = np.flatnonzero(centroids[:, 2] > 0.9), np.flatnonzero(centroids[:, 2] < -0.9)
    links = links_of(tube)
    side = cut_between(links, centroids, tube.face_areas(), ends, 21)
    assert side[ends[0]].all()
    assert not side[ends[1]].any()
    assert len(links.parts(side)) == 2
    assert links.cut_length(side) < 2.0 * np.pi * 0.5 * 1.5
    assert 0.3 < tube.face_areas()[side].sum() / tube.face_areas().sum() < 0.7


def test_sides_that_hold_most_faces_still_leave_a_cut() -> None:
    """All but one face of each end are as near as can be: no isoline may leave one side empty."""
    links = Links(np.arange(4), CHAIN, 4)
    for sides in ((np.array([0, 1, 2]), np.array([3])), (np.array([0]), np.array([1, 2, 3]))):
        side = cut_between(links, CENTROIDS, np.ones(4), sides, 5)
        assert np.array_equal(np.flatnonzero(side), sides[0])


def test_a_dumbbell_is_cut_at_its_neck(moved: Callable[..., Surface]) -> None:
    for surface in (dumbbell(), moved(dumbbell(), size=30.0)):
        centroids, links = surface.triangles.mean(axis=1), links_of(surface)
        seed = int(dumbbell().triangles.mean(axis=1)[:, 2].argmax())
        (one, rest), *_ = necks(links, centroids, surface.face_areas(), seed, 22, 0.08, 2)
        unit = float(np.ptp(surface.vertices, axis=0).max()) / float(np.ptp(dumbbell().vertices, axis=0).max())
        assert links.cut_length(np.isin(links.ids, one)) < unit * 2.0 * np.pi * 0.2 * 3.0
        height = dumbbell().triangles.mean(axis=1)[:, 2]
        assert (height[one] > -0.6).all() or (height[one] < 0.6).all()
        assert len(one) + len(rest) == len(surface.faces)


@pytest.mark.parametrize("name", ["sphere", "torus", "cube", "cloth"])
def test_every_neck_leaves_two_connected_parts(name: str) -> None:
    surface = Surface(*make_sample(name, resolution=20))
    links, areas = links_of(surface), surface.face_areas()
    for seed in (0, len(surface.faces) // 2):
        found = necks(links, surface.triangles.mean(axis=1), areas, seed, 22, 0.08, 2)
        assert 1 <= len(found) <= 2
        for one, rest in found:
            assert np.array_equal(np.sort(np.concatenate([one, rest])), np.arange(len(surface.faces)))
            assert len(links.parts(np.isin(links.ids, one))) == 2
