"""Slivers: a cap and a needle by hand, soups of them; sound triangles are left alone."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.slivers import longest_sides, steadied
from flexpara.train.config import SliverConfig

if TYPE_CHECKING:
    from collections.abc import Callable

CONFIG = SliverConfig()


def capped_square(height: float) -> Surface:
    """The unit square, and on its lower side a triangle of this height with its apex in the middle."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0.5, -height, 0]])
    return Surface(vertices, np.array([[0, 1, 2], [0, 2, 3], [1, 0, 4]]))


def heights_of(surface: Surface) -> np.ndarray:
    return longest_sides(surface.triangles)[1]


def test_the_longest_side_and_the_height_over_it() -> None:
    triangle = np.array([[[0.0, 0, 0], [0, 3, 0], [4, 0, 0]]])
    (side, longest), height = longest_sides(triangle)
    assert (side.tolist(), longest.tolist()) == ([1], [5.0])
    assert height == pytest.approx([12.0 / 5.0])


@pytest.mark.parametrize("name", ["sphere", "cone", "cube", "torus"])
def test_a_surface_without_slivers_is_returned_as_it_is(name: str) -> None:
    surface = Surface(*make_sample(name, resolution=24))
    assert steadied(surface, CONFIG) is surface


def test_a_small_triangle_is_no_sliver() -> None:
    tiny = 1e-8 * np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    surface = Surface(np.concatenate([capped_square(0.5).vertices, tiny]), np.array([[0, 1, 2], [0, 2, 3], [5, 6, 7]]))
    assert steadied(surface, CONFIG) is surface


@pytest.mark.parametrize("height", [0.0, 1e-12, -1e-12, 1e-8])
def test_a_cap_is_drawn_away_from_the_face_beyond_it_within_its_plane(height: float) -> None:
    surface = capped_square(height)
    steady = steadied(surface, CONFIG)
    step = steady.vertices[4] - surface.vertices[4]
    assert step[1] < 0.0
    assert step[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-12)
    assert np.array_equal(steady.vertices[:4], surface.vertices[:4])
    assert heights_of(steady)[2] >= CONFIG.height


def test_a_needle_gets_a_height() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1e-12, 0], [1, 1, 0]])
    steady = steadied(Surface(vertices, np.array([[0, 1, 2], [0, 2, 3]])), CONFIG)
    assert heights_of(steady).min() >= CONFIG.height


def test_a_triangle_all_on_one_line_gets_a_height_too() -> None:
    line = Surface(np.array([[0.0, 0, 0], [2, 0, 0], [1, 0, 0]]), np.array([[0, 1, 2]]))
    assert heights_of(steadied(line, CONFIG)).min() >= 2.0 * CONFIG.height


def test_a_fan_of_caps_on_one_side_gets_heights_everywhere() -> None:
    """A strip of 20 points on a straight side, as cutting solids leaves them."""
    line = np.stack([np.linspace(0.0, 1.0, 21), np.zeros(21), np.zeros(21)], axis=1)
    vertices = np.concatenate([line, [[0.5, 1.0, 0.0]]])
    fan = [[0, i, i + 1] for i in range(1, 20)]
    surface = Surface(vertices, np.array([[0, 20, 21], *fan]))
    assert heights_of(steadied(surface, CONFIG)).min() >= CONFIG.height * 0.9


def test_steadying_moves_nothing_by_more_than_some_millionths() -> None:
    surface = capped_square(0.0)
    assert np.abs(steadied(surface, CONFIG).vertices - surface.vertices).max() < 1e-5


def test_size_and_place_do_not_matter(moved: Callable[..., Surface]) -> None:
    for size in (1e-3, 1e3):
        surface = moved(capped_square(0.0), size=size)
        assert heights_of(steadied(surface, CONFIG)).min() >= 0.9 * size * CONFIG.height


def test_the_source_is_not_written_to() -> None:
    surface = capped_square(0.0)
    before = surface.vertices.copy()
    steadied(surface, CONFIG)
    assert np.array_equal(surface.vertices, before)
