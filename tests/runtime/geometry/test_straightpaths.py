"""Paths along edges: on a grid by hand, and beside shortest paths."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from flexpara.runtime.geometry.cutgraph import shortest_paths
from flexpara.runtime.geometry.straightpaths import Roads, followers, straightest_path


def grid(side: int) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and edges of a grid of unit squares; vertex (i, j) is number side · i + j."""
    i, j = np.meshgrid(np.arange(side), np.arange(side), indexing="ij")
    number = side * i + j
    points = np.stack([i, j, 0 * i], axis=-1).reshape(-1, 3).astype(np.float64)
    along = np.stack([number[:-1], number[1:]], axis=-1).reshape(-1, 2)
    across = np.stack([number[:, :-1], number[:, 1:]], axis=-1).reshape(-1, 2)
    return points, np.concatenate([along, across])


def turns(points: np.ndarray, path: list[int]) -> int:
    way = np.diff(points[path], axis=0)
    return int((np.einsum("ec,ec->e", way[1:], way[:-1]) < 0.5).sum())


def test_of_all_staircases_between_two_corners_the_one_with_one_turn_is_taken() -> None:
    points, edges = grid(6)
    path = straightest_path(Roads(points, edges, np.ones(len(edges))), 0, 35, 0.3)
    assert (path[0], path[-1], len(path)) == (0, 35, 11)
    assert turns(points, path) == 1


def test_without_a_price_of_turns_the_path_is_as_short_as_dijkstras() -> None:
    points, edges = grid(7)
    cost = np.random.default_rng(0).uniform(0.5, 2.0, len(edges))
    path = straightest_path(Roads(points, edges, cost), 0, 48, 0.0)
    price = {tuple(sorted(pair)): float(value) for pair, value in zip(edges.tolist(), cost, strict=True)}
    paid = sum(price[tuple(sorted(pair))] for pair in pairwise(path))
    assert np.isclose(paid, shortest_paths(49, edges, cost, np.array([0])).distance[48])


def test_a_detour_is_taken_where_turns_are_dearer() -> None:
    points, edges = grid(3)
    steps = [[0, 1], [1, 4], [4, 5], [5, 8]]  # a staircase with three turns
    cost = np.where([pair in steps for pair in edges.tolist()], 0.9, 1.0)
    assert straightest_path(Roads(points, edges, cost), 0, 8, 0.0) == [0, 1, 4, 5, 8]
    assert turns(points, straightest_path(Roads(points, edges, cost), 0, 8, 0.5)) == 1


def test_no_path_leads_where_no_edge_does() -> None:
    points, edges = grid(3)
    apart = edges[(edges != 8).all(axis=1)]
    assert straightest_path(Roads(points, apart, np.ones(len(apart))), 0, 8, 0.3) == []


def test_an_edge_is_followed_by_those_after_it_and_never_by_itself_turned_round() -> None:
    tail, head = np.array([0, 1, 1, 2]), np.array([1, 2, 0, 1])
    before, after = followers(tail, head)
    assert sorted(zip(before.tolist(), after.tolist(), strict=True)) == [(0, 1), (3, 2)]
