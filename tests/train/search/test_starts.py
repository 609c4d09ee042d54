"""First labels: points by hand, clusters of a cube and a sphere, scores that were learned elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FinishConfig
from flexpara.train.search.labels import DualGraph, connected_pieces, dual_graph
from flexpara.train.search.starts import clusters, distances, farthest_points, pieces_by_score, squared

CONFIG = FinishConfig()


def unit(name: str, resolution: int) -> Surface:
    """A sample at area 1."""
    surface = Surface(*make_sample(name, resolution=resolution))
    return Surface(surface.vertices / np.sqrt(surface.face_areas().sum()), surface.faces)


def graph_of(surface: Surface) -> DualGraph:
    return dual_graph(surface, edge_table(surface.faces), CONFIG.labels.seams)


def labelled(surface: Surface, count: int, seed: int = 0) -> np.ndarray:
    return clusters(surface, graph_of(surface), count, CONFIG, np.random.default_rng(seed))


def test_squared_distances_by_hand() -> None:
    assert squared(np.array([[0.0, 0], [3, 4]]), np.array([[0.0, 0]])).tolist() == [[0.0], [25.0]]


def test_farthest_points_on_a_line_by_hand() -> None:
    line = np.array([[0.0], [1.0], [4.0], [10.0]])
    assert farthest_points(line, 4, 1).tolist() == [1, 3, 2, 0]


def test_farthest_points_spread_at_least_as_far_as_any_point_is_from_them() -> None:
    xyz = unit("sphere", 24).vertices
    chosen = xyz[farthest_points(xyz, 12, 0)]
    apart = np.linalg.norm(chosen[:, None] - chosen, axis=2) + 10.0 * np.eye(12)
    cover = np.linalg.norm(xyz[:, None] - chosen, axis=2).min(axis=1).max()
    assert apart.min() >= cover


def test_the_nearest_cluster_is_at_distance_zero() -> None:
    sphere = unit("sphere", 24)
    gap = distances(sphere, sphere.face_areas(), 5, CONFIG.start, np.random.default_rng(0))
    assert gap.shape == (len(sphere.faces), 5)
    assert (gap.min(axis=1) == 0.0).all()


def test_one_cluster_is_the_whole() -> None:
    assert not labelled(unit("torus", 24), 1).any()


def test_six_clusters_of_a_cube_are_its_sides() -> None:
    cube = unit("cube", 32)
    label = labelled(cube, 6)
    side = np.abs(cube.face_normals()).argmax(axis=1) * 2 + (cube.face_normals().max(axis=1) > 0.5)
    assert len(np.unique(label)) == 6
    assert len({tuple(pair) for pair in np.stack([label, side], axis=1).tolist()}) == 6


@pytest.mark.parametrize("name", ["sphere", "torus", "cloth"])
def test_clusters_are_connected_and_numbered_from_zero(name: str) -> None:
    surface = unit(name, 24)
    label = labelled(surface, 8)
    count = int(label.max()) + 1
    assert 4 <= count <= 12
    assert np.array_equal(np.unique(label), np.arange(count))
    assert connected_pieces(label, graph_of(surface)).max() + 1 == count
    assert np.bincount(label, surface.face_areas()).min() >= CONFIG.labels.islet_area


def test_labels_follow_from_the_seed() -> None:
    torus = unit("torus", 24)
    assert np.array_equal(labelled(torus, 8, seed=3), labelled(torus, 8, seed=3))
    assert not np.array_equal(labelled(torus, 8, seed=3), labelled(torus, 8, seed=4))


def test_learned_scores_become_connected_pieces_with_short_borders() -> None:
    sphere = unit("sphere", 48)
    height = sphere.triangles.mean(axis=1)[:, 2] * np.sqrt(4.0 * np.pi)
    noise = np.random.default_rng(0).normal(0.0, 2.0, len(height))
    score = -np.logaddexp(0.0, -np.stack([20.0 * height + noise, -20.0 * height - noise], axis=1))
    piece = pieces_by_score(score, sphere.face_areas(), graph_of(sphere), CONFIG.labels)
    assert piece.max() == 1
    above = piece == piece[height.argmax()]
    assert (above == (height > 0.0)).mean() > 0.95
