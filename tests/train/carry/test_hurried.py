"""Labels without weighing borders: the nearest face's, the neighbours', and crumbs given away all at once."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.carry.hurried import crumbs_given, followed
from flexpara.train.carry.layout import nearest_faces
from flexpara.train.config import FinishConfig
from flexpara.train.search.labels import DualGraph, connected_pieces, dual_graph

CONFIG = FinishConfig()


def chain(count: int) -> DualGraph:
    """Faces in a row."""
    at = np.arange(count - 1)
    return DualGraph(np.stack([at, at + 1], axis=1), np.ones(count - 1), np.ones(count - 1))


def sphere(resolution: int) -> tuple[Surface, DualGraph]:
    surface = Surface(*make_sample("sphere", resolution=resolution))
    return surface, dual_graph(surface, edge_table(surface.faces), CONFIG.labels.seams)


def test_a_face_between_two_of_a_label_follows_them() -> None:
    assert followed(np.array([0, 0, 1, 0, 0]), chain(5), 1).tolist() == [0, 0, 0, 0, 0]
    assert followed(np.array([0, 0, 1, 1]), chain(4), 3).tolist() == [0, 0, 1, 1]


def test_a_crumb_joins_the_larger_piece_beside_it_and_so_does_a_crumb_beside_a_crumb() -> None:
    areas = np.array([10.0, 0.3, 0.1, 0.2, 5.0])
    graph = chain(5)._replace(length=np.array([0.5, 1.0, 2.0, 1.0]))
    joined = crumbs_given(np.arange(5), areas, graph, 0.05)
    assert joined.tolist() == [0, 0, 1, 1, 1]


def test_two_halves_of_a_ball_stay_two_connected_halves() -> None:
    coarse, _ = sphere(8)
    fine, graph = sphere(32)
    label = (coarse.triangles.mean(axis=1)[:, 2] > 0.0).astype(np.int64)
    found = followed(label[nearest_faces(fine, coarse, CONFIG.carry)], graph, CONFIG.carry.hurried_rounds)
    up = fine.triangles.mean(axis=1)[:, 2] > 0.0
    assert (found == up).mean() > 0.9
    joined = crumbs_given(found, fine.face_areas(), graph, CONFIG.carry.islet)
    assert joined.max() == 1
    assert connected_pieces(joined, graph).max() == 1


@pytest.mark.parametrize("seed", range(3))
def test_of_labels_at_random_no_crumb_is_left(seed: int) -> None:
    fine, graph = sphere(16)
    label = np.random.default_rng(seed).integers(0, 4, len(fine.faces))
    areas = fine.face_areas()
    joined = crumbs_given(label, areas, graph, 0.05)
    assert np.bincount(joined, areas).min() >= 0.05 * areas.sum()
    assert connected_pieces(joined, graph).max() == joined.max()
