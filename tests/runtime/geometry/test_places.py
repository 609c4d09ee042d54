"""Prices of seams by place: a pit and its rim, points that are protected, other frames; and how open the sky is."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.cutgraph import SeamPrices, counted_length, counted_prices, seam_prices
from flexpara.runtime.geometry.openness import open_sky
from flexpara.runtime.geometry.places import PlaceConfig, Places, priced_places
from flexpara.runtime.geometry.topology import edge_table
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def test_a_convex_surface_sees_the_whole_sky_also_where_it_is_inside_out() -> None:
    pytest.importorskip("lagrange")
    ball = sample("sphere", 24)
    inside_out = Surface(ball.vertices, ball.faces[:, ::-1])
    every = np.arange(len(ball.faces))
    for surface in (ball, inside_out):
        assert open_sky(surface, every, 16).min() == 1.0


def test_the_inner_side_of_a_torus_is_hidden_and_cheaper_than_the_outer_one() -> None:
    pytest.importorskip("lagrange")
    torus = sample("torus", 48)
    middle = torus.triangles.mean(axis=1)
    away = np.linalg.norm(middle[:, :2], axis=1)
    places = priced_places(torus, PlaceConfig(hidden=True))
    price = places.at(middle)
    assert price[away < np.quantile(away, 0.1)].mean() < 0.7 * price[away > np.quantile(away, 0.9)].mean()


def test_protected_faces_are_as_dear_as_they_are_protected_and_all_others_as_before() -> None:
    ball = sample("sphere", 32)
    pole = ball.vertices[ball.vertices[:, 2].argmax()]
    middle = ball.triangles.mean(axis=1)
    near = np.clip(1.0 - np.linalg.norm(middle - pole, axis=1), 0.0, 1.0)
    places = priced_places(ball, PlaceConfig(), near)
    assert near.any()
    assert np.allclose(places.at(middle), 1.0 + 9.0 * near)


def test_moved_places_answer_alike_in_the_other_frame() -> None:
    places = Places(np.array([[0.0, 0, 0], [2.0, 0, 0]]), np.array([1.0, 5.0]))
    origin, asked = np.array([1.0, 1, 1]), np.array([[0.4, 0, 0], [1.9, 0, 0]])
    assert places.at(asked).tolist() == [1.0, 5.0]
    assert places.moved(origin, 4.0).at((asked - origin) / 4.0).tolist() == [1.0, 5.0]


def test_a_place_multiplies_what_seams_cost_and_count_and_counted_creases_make_borders_cheaper() -> None:
    cube = sample("cube", 12)
    table = edge_table(cube.faces)
    dear = SeamPrices(places=Places(cube.vertices[:1], np.array([3.0])))
    assert np.allclose(seam_prices(cube, table, dear), 3.0 * seam_prices(cube, table, SeamPrices()))
    assert np.array_equal(counted_prices(cube, table, SeamPrices()), np.ones(len(table.edges)))
    counted = counted_prices(cube, table, SeamPrices(counted=True))
    assert np.allclose(np.unique(counted.round(9)), [0.2, 1.0])


def test_a_segment_counts_as_long_as_its_place_is_dear() -> None:
    segments = np.array([[[0.0, 0, 0], [2.0, 0, 0]], [[9.0, 0, 0], [10.0, 0, 0]]])
    dear = SeamPrices(places=Places(np.array([[0.0, 0, 0], [10.0, 0, 0]]), np.array([1.0, 5.0])))
    assert counted_length(segments, SeamPrices()) == 3.0
    assert counted_length(segments, dear) == 2.0 + 5.0
