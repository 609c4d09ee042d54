"""Paths and closing edges: a grid by hand, creases of a cube, handles of a torus and a bracket."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.cutgraph import (
    SeamPrices,
    closing_edges,
    closing_paths,
    crease_sharpness,
    edge_costs,
    path_mask,
    prune,
    shortest_paths,
    trace_back,
)
from flexpara.runtime.geometry.topology import edge_table, euler_characteristic
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample

PLAIN = SeamPrices(crease_discount=0.0)


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def flat_grid(columns: int, rows: int) -> Surface:
    """A flat sheet of unit squares; vertex (i, j) has number i · (rows + 1) + j."""
    x, y = np.meshgrid(np.arange(columns + 1.0), np.arange(rows + 1.0), indexing="ij")
    corner = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (part.ravel() for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return Surface(np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1), faces)


def test_the_shortest_way_over_a_grid_runs_along_its_diagonals() -> None:
    grid = flat_grid(4, 4)
    table = edge_table(grid.faces)
    ends = grid.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    paths = shortest_paths(25, table.edges, length, np.array([0]))
    assert paths.distance[24] == pytest.approx(4.0 * np.sqrt(2.0))
    assert paths.distance[23] == pytest.approx(3.0 * np.sqrt(2.0) + 1.0)
    path = trace_back(paths.parent, 24)
    assert path == [24, 18, 12, 6, 0]
    mask = path_mask(table, [path])
    assert table.edges[mask].tolist() == [[0, 6], [6, 12], [12, 18], [18, 24]]


def test_the_way_leads_to_the_nearest_source() -> None:
    grid = flat_grid(6, 1)
    table = edge_table(grid.faces)
    paths = shortest_paths(14, table.edges, edge_costs(grid, table, PLAIN), np.array([0, 12]))
    assert paths.distance[[0, 2, 4, 6, 8, 10, 12]].tolist() == [0.0, 1.0, 2.0, 3.0, 2.0, 1.0, 0.0]
    assert trace_back(paths.parent, 10) == [10, 12]
    assert trace_back(paths.parent, 0) == [0]


def test_out_of_reach_is_infinitely_far() -> None:
    paths = shortest_paths(3, np.array([[0, 1]]), np.ones(1), np.array([0]))
    assert paths.distance.tolist() == [0.0, 1.0, np.inf]
    assert paths.parent.tolist() == [-1, 0, -1]


def test_boundary_edges_are_on_no_cut() -> None:
    grid = flat_grid(3, 2)
    table = edge_table(grid.faces)
    mask = path_mask(table, [[0, 3, 6, 7]])
    assert table.edges[mask].tolist() == [[6, 7]]


def test_an_edge_costs_its_length_a_crease_a_fifth_of_it_and_a_flat_face_much_more() -> None:
    cube = sample("cube", 8)
    table = edge_table(cube.faces)
    ends = cube.vertices[table.edges]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    crease = (np.abs(ends.mean(axis=1)) > 0.5 - 1e-9).sum(axis=1) == 2
    assert crease.sum() == 12 * 2
    flat = PLAIN.flat_price * length
    assert edge_costs(cube, table, PLAIN) == pytest.approx(np.where(crease, length, flat))
    assert edge_costs(cube, table, SeamPrices()) == pytest.approx(np.where(crease, 0.2 * length, flat))
    ball = sample("sphere", 24)
    table = edge_table(ball.faces)
    ends = ball.vertices[table.edges]
    assert edge_costs(ball, table, PLAIN) == pytest.approx(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))


def test_the_border_of_a_flat_sheet_costs_its_length() -> None:
    grid = flat_grid(2, 2)
    table = edge_table(grid.faces)
    assert edge_costs(grid, table, SeamPrices())[table.boundary] == pytest.approx(1.0)


def test_pruning_keeps_loops_and_drops_what_leads_nowhere() -> None:
    grid = flat_grid(6, 4)
    table = edge_table(grid.faces)
    ring = [6, 11, 12, 7, 6]
    tail = [12, 17, 22]
    kept = prune(table, path_mask(table, [ring, tail]))
    assert np.array_equal(kept, path_mask(table, [ring]))
    assert not prune(table, path_mask(table, [tail])).any()


def test_pruning_writes_to_nothing() -> None:
    grid = flat_grid(6, 4)
    table = edge_table(grid.faces)
    mask = path_mask(table, [[12, 17, 22]])
    prune(table, mask)
    assert mask.sum() == 2


def test_a_crease_is_sharp_from_sixty_degrees_on_and_a_border_has_none() -> None:
    """Two triangles that meet at 30° and at 90°, and flat ones."""
    for degrees, expected in ((0.0, 0.0), (30.0, 2.0 - np.sqrt(3.0)), (60.0, 1.0), (90.0, 1.0)):
        turn = np.deg2rad(degrees)
        vertices = np.array([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [-np.cos(turn), 0.0, np.sin(turn)]])
        faces = np.array([[0, 2, 1], [0, 1, 3]])
        table = edge_table(faces)
        found = crease_sharpness(Surface(vertices, faces), table)
        assert found[table.manifold] == pytest.approx([expected], abs=1e-12)
        assert not found[~table.manifold].any()


@pytest.mark.parametrize("name", ["sphere", "torus", "trefoil", "bracket"])
def test_there_are_two_closing_edges_a_handle(name: str) -> None:
    if name == "bracket":
        pytest.importorskip("manifold3d")
    surface = sample(name, 24)
    table = edge_table(surface.faces)
    cost = edge_costs(surface, table, PLAIN)
    paths = shortest_paths(len(surface.vertices), table.edges, cost, np.array([0]))
    assert len(closing_edges(table, cost, paths)) == 2 - euler_characteristic(surface.faces)


def test_the_closing_path_of_a_tube_leads_from_border_to_border() -> None:
    surface = sample("tube", 24)
    table = edge_table(surface.faces)
    cost = edge_costs(surface, table, PLAIN)
    border = np.unique(table.edges[table.boundary])
    (path,) = closing_paths(table, cost, shortest_paths(len(surface.vertices), table.edges, cost, border))
    assert np.isin(path, border).tolist() == [True, *[False] * (len(path) - 2), True]
    assert cost[path_mask(table, [path])].sum() == pytest.approx(2.0)
