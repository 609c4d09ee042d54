"""Face labels: two triangles by hand, tiny graphs against brute force, solids with known borders."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.search.config import LabelConfig
from flexpara.train.search.labels import (
    DualGraph,
    border_lengths,
    connected_pieces,
    dual_graph,
    expand_label,
    islets_joined,
    label_energy,
    smooth_labels,
)

CONFIG = LabelConfig()
FAR_APART = np.array([3.0, 0.0, 0.0])


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def graph_of(surface: Surface, crease_discount: float = 0.0) -> DualGraph:
    return dual_graph(surface, edge_table(surface.faces), SeamPrices(crease_discount))


def hinge(angle: float) -> Surface:
    """Two right triangles on either side of an edge of length 2, bent by angle (radians; 0 = flat)."""
    side = [0.0, -np.cos(angle), np.sin(angle)]
    vertices = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0], side])
    return Surface(vertices, np.array([[0, 1, 2], [1, 0, 3]]))


def random_graph(rng: np.random.Generator, faces: int, links: int) -> DualGraph:
    every = np.array([(i, j) for i in range(faces) for j in range(i + 1, faces)])
    pairs = rng.permuted(every[rng.choice(len(every), links, replace=False)], axis=1)
    cost = rng.uniform(0.1, 1.0, links)
    return DualGraph(pairs, cost, cost)


def least_energy(choices: list[tuple[int, ...]], unary: np.ndarray, graph: DualGraph) -> float:
    return min(label_energy(np.array(label), unary, graph) for label in product(*choices))


@pytest.mark.parametrize(("angle", "cost"), [(0.0, 2.0 * SeamPrices().flat_price), (1e-3, 2.0)])
def test_two_triangles_share_one_edge_whose_seam_costs_its_length_or_more_within_a_flat_face(
    angle: float, cost: float
) -> None:
    graph = graph_of(hinge(angle), crease_discount=0.8)
    assert graph.pairs.tolist() == [[0, 1]]
    assert graph.length == pytest.approx([2.0])
    assert graph.cost == pytest.approx([cost], rel=1e-5)


@pytest.mark.parametrize(("degrees", "share"), [(30.0, (1.0 - np.sqrt(0.75)) / 0.5), (60.0, 1.0), (90.0, 1.0)])
def test_a_seam_on_a_crease_costs_less_down_to_the_full_discount_at_60_degrees(degrees: float, share: float) -> None:
    graph = graph_of(hinge(np.radians(degrees)), crease_discount=0.8)
    assert graph.length == pytest.approx([2.0])
    assert graph.cost == pytest.approx([2.0 * (1.0 - 0.8 * share)])


def test_three_sheets_on_one_edge_are_not_joined() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    book = Surface(vertices, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert len(graph_of(book).pairs) == 0


def test_faces_of_opposite_orientation_are_not_joined() -> None:
    """They are cut apart before they are flattened: a piece across such an edge would fall in two."""
    plain = hinge(0.0)
    flipped = Surface(plain.vertices, np.array([[0, 1, 2], [0, 1, 3]]))
    assert len(graph_of(flipped).pairs) == 0


def test_energy_adds_the_labels_and_the_seams() -> None:
    graph = DualGraph(np.array([[0, 1], [1, 2]]), np.ones(2), np.array([0.5, 0.25]))
    unary = np.array([[1.0, 9.0], [9.0, 2.0], [9.0, 3.0]])
    assert label_energy(np.array([0, 1, 1]), unary, graph) == pytest.approx(1.0 + 2.0 + 3.0 + 0.5)


@pytest.mark.parametrize("seed", range(12))
def test_an_expansion_is_the_best_of_all_subsets(seed: int) -> None:
    rng = np.random.default_rng(seed)
    graph, unary = random_graph(rng, 9, 16), rng.uniform(0.0, 1.5, (9, 4))
    label = rng.integers(0, 4, 9)
    moved = expand_label(label, 2, unary, graph, label != 2)
    assert ((moved == label) | (moved == 2)).all()
    best = least_energy([(int(old), 2) for old in label], unary, graph)
    assert label_energy(moved, unary, graph) == pytest.approx(best, abs=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_two_labels_end_at_the_global_optimum(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    graph, unary = random_graph(rng, 10, 20), rng.uniform(0.0, 1.5, (10, 2))
    label = smooth_labels(unary, graph, sweeps=6)
    assert label_energy(label, unary, graph) == pytest.approx(least_energy([(0, 1)] * 10, unary, graph), abs=1e-3)


def test_smoothing_finds_what_no_single_face_would_do() -> None:
    """Two faces held together by a dear edge change sides only as a pair."""
    graph = DualGraph(np.array([[0, 1], [1, 2], [0, 2]]), np.ones(3), np.array([5.0, 1.0, 1.0]))
    unary = np.array([[0.0, 0.5], [0.0, 0.5], [9.0, 0.0]])
    assert smooth_labels(unary, graph).tolist() == [1, 1, 1]


def test_no_expansion_raises_the_energy_on_a_sphere() -> None:
    sphere = sample("sphere", 24)
    rng = np.random.default_rng(3)
    unary, graph = rng.uniform(0.0, 0.2, (len(sphere.faces), 5)), graph_of(sphere)
    label = unary.argmin(axis=1)
    start = energy = label_energy(label, unary, graph)
    for alpha in range(5):
        label = expand_label(label, alpha, unary, graph, label != alpha)
        moved = label_energy(label, unary, graph)
        assert moved <= energy + 1e-4 * start
        energy = moved
    assert energy < 0.8 * start


def test_a_strong_unary_wins_over_every_seam() -> None:
    sphere = sample("sphere", 12)
    wanted = np.random.default_rng(0).integers(0, 3, len(sphere.faces))
    unary = np.where(np.arange(3) == wanted[:, None], 0.0, 100.0)
    assert np.array_equal(smooth_labels(unary, graph_of(sphere)), wanted)


def test_a_weak_unary_gives_way_to_one_label_for_all() -> None:
    sphere = sample("sphere", 12)
    unary = np.random.default_rng(0).uniform(0.0, 1e-6, (len(sphere.faces), 3))
    assert len(np.unique(smooth_labels(unary, graph_of(sphere)))) == 1


def test_noise_is_smoothed_away_and_the_border_stays() -> None:
    sphere = sample("sphere", 24)
    truth = (sphere.triangles.mean(axis=1)[:, 2] > 0.0).astype(np.int64)
    noisy = truth ^ (np.random.default_rng(1).random(len(truth)) < 0.1)
    unary = np.where(np.arange(2) == noisy[:, None], 0.0, 0.1)
    assert (smooth_labels(unary, graph_of(sphere)) == truth).mean() > 0.97


def test_pieces_are_the_connected_parts_of_each_label() -> None:
    sphere = sample("sphere", 24)
    band = (np.abs(sphere.triangles.mean(axis=1)[:, 2]) < 0.4).astype(np.int64)
    piece = connected_pieces(band, graph_of(sphere))
    assert piece.max() == 2  # a belt and two caps
    height = sphere.triangles.mean(axis=1)[:, 2]
    assert len({int(piece[height.argmax()]), int(piece[height.argmin()]), int(piece[np.abs(height).argmin()])}) == 3


def test_borders_of_a_cube_are_its_edges() -> None:
    cube = sample("cube", 16)
    side = np.abs(cube.face_normals()).argmax(axis=1) * 2 + (cube.face_normals().max(axis=1) > 0.5)
    border = border_lengths(side, 6, graph_of(cube))
    opposite = np.kron(np.eye(3), np.ones((2, 2))) > 0.0
    assert border == pytest.approx(np.where(opposite, 0.0, 1.0))


def test_an_islet_joins_the_neighbour_it_shares_most_border_with() -> None:
    sphere = sample("sphere", 48)
    centre = sphere.triangles.mean(axis=1)
    label = (centre[:, 2] > 1e-9).astype(np.int64)
    islet = np.linalg.norm(centre - [0.99, 0.0, 0.13], axis=1) < 0.2
    assert set(label[islet]) == {0, 1}  # it straddles the border
    label[islet] = 2
    piece = islets_joined(label, sphere.face_areas(), graph_of(sphere), LabelConfig(islet_area=0.02))
    assert piece.max() == 1
    assert (piece[islet] == piece[centre[:, 2].argmax()]).all()


def test_each_component_keeps_a_piece_however_small() -> None:
    big, small = sample("sphere", 24), sample("sphere", 6)
    vertices = np.concatenate([big.vertices, 0.01 * small.vertices + FAR_APART])
    both = Surface(vertices, np.concatenate([big.faces, small.faces + len(big.vertices)]))
    label = np.random.default_rng(0).integers(0, 4, len(both.faces))
    piece = islets_joined(label, both.face_areas(), graph_of(both), LabelConfig(islet_area=0.99))
    assert piece.tolist() == [0] * len(big.faces) + [1] * len(small.faces)


def test_labels_are_not_written_to() -> None:
    sphere = sample("sphere", 12)
    label = np.random.default_rng(0).integers(0, 3, len(sphere.faces))
    unary, before = np.zeros((len(label), 3)), label.copy()
    graph = graph_of(sphere)
    expand_label(label, 0, unary, graph, label != 0)
    islets_joined(label, sphere.face_areas(), graph, CONFIG)
    assert np.array_equal(label, before)
