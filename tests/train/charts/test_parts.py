"""Parts: one, two, copies moved, turned and mirrored; what only looks like a copy is none."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.charts.parts import Part, is_copy, pattern, split_parts

if TYPE_CHECKING:
    from collections.abc import Callable

TOLERANCE = 1e-5


def lopsided() -> Surface:
    """A closed surface without any symmetry."""
    vertices, faces = make_sample("sphere", resolution=12)
    bump = 1.0 + 0.3 * np.exp(-4.0 * ((vertices - [0.5, 0.6, 0.62]) ** 2).sum(axis=1, keepdims=True))
    return Surface(vertices * bump * [1.0, 1.3, 1.9], faces)


def parts_of(surface: Surface) -> list[Part]:
    return split_parts(surface, TOLERANCE)


def test_one_triangle_is_one_part_of_area_one() -> None:
    triangle = Surface(np.array([[1.0, 1, 1], [4, 1, 1], [1, 5, 1]]), np.array([[0, 1, 2]]))
    (part,) = parts_of(triangle)
    assert part.ids.tolist() == [0]
    assert part.surface.face_areas().sum() == pytest.approx(1.0)
    assert part.scale == pytest.approx(np.sqrt(6.0))
    assert part.copy_of == -1


def test_a_part_put_back_at_its_scale_and_place_is_the_surface(
    together: Callable[..., Surface], moved: Callable[..., Surface]
) -> None:
    surface = together(lopsided(), moved(Surface(*make_sample("cone", resolution=8)), size=0.1))
    for part in parts_of(surface):
        back = part.surface.triangles * part.scale + part.origin
        np.testing.assert_allclose(back, surface.triangles[part.ids], atol=1e-12)


def test_parts_are_numbered_by_their_lowest_face_and_hold_each_face_once(together: Callable[..., Surface]) -> None:
    first, second = lopsided(), Surface(*make_sample("cone", resolution=8))
    both = together(first, second)
    order = np.random.default_rng(0).permutation(len(both.faces))
    parts = parts_of(Surface(both.vertices, both.faces[order]))
    assert len(parts) == 2
    assert parts[0].ids[0] == 0
    assert np.array_equal(np.sort(np.concatenate([part.ids for part in parts])), np.arange(len(both.faces)))
    assert all((np.diff(part.ids) > 0).all() for part in parts)


def test_sheets_that_share_an_edge_of_three_faces_are_parts_of_their_own() -> None:
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    book = Surface(vertices, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]]))
    assert len(parts_of(book)) == 3


@pytest.mark.parametrize("size", [1.0, 0.01, 300.0])
@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_part_moved_turned_scaled_or_mirrored_is_a_copy(
    size: float, mirrored: bool, seed: int, together: Callable[..., Surface], moved: Callable[..., Surface]
) -> None:
    surface = together(lopsided(), moved(lopsided(), size=size, seed=seed, mirrored=mirrored))
    first, second = parts_of(surface)
    assert (first.copy_of, second.copy_of, second.mirrored) == (-1, 0, mirrored)
    assert second.scale == pytest.approx(size * first.scale)


def test_a_copy_is_of_the_first_of_its_kind(together: Callable[..., Surface], moved: Callable[..., Surface]) -> None:
    cone = Surface(*make_sample("cone", resolution=8))
    surface = together(cone, lopsided(), moved(cone, seed=1), moved(lopsided(), seed=2), moved(cone, seed=3))
    assert [part.copy_of for part in parts_of(surface)] == [-1, -1, 0, 1, 0]


def test_a_part_of_the_same_connectivity_and_another_shape_is_no_copy(together: Callable[..., Surface]) -> None:
    one = lopsided()
    dented = one.vertices.copy()
    dented[7] *= 1.001
    for other in (Surface(one.vertices * [1.0, 1.0, 1.1], one.faces), Surface(dented, one.faces)):
        moved = Surface(other.vertices + 9.0, other.faces)
        assert [part.copy_of for part in parts_of(together(one, moved))] == [-1, -1]


def test_a_mirror_image_with_its_faces_inside_out_is_no_copy(together: Callable[..., Surface]) -> None:
    """Turned about, no motion brings it onto the first; mirrored, its faces would look the other way."""
    one = lopsided()
    inverted = Surface(one.vertices * [-1.0, 1.0, 1.0] + 9.0, one.faces)
    assert [part.copy_of for part in parts_of(together(one, inverted))] == [-1, -1]


def test_the_same_faces_in_another_order_may_go_unnoticed_but_are_never_wrong(
    together: Callable[..., Surface],
) -> None:
    one = lopsided()
    shuffled = Surface(one.vertices + 9.0, one.faces[np.random.default_rng(0).permutation(len(one.faces))])
    first, second = parts_of(together(one, shuffled))
    assert second.copy_of == -1 or is_copy(first, second, TOLERANCE, mirrored=second.mirrored)


def test_vertices_that_differ_by_less_than_the_tolerance_are_no_difference(together: Callable[..., Surface]) -> None:
    one = lopsided()
    noise = np.random.default_rng(0).uniform(-1e-7, 1e-7, one.vertices.shape)
    near = Surface(one.vertices + noise + 9.0, one.faces)
    assert [part.copy_of for part in parts_of(together(one, near))] == [-1, 0]


def leaves(count: int, moved: Callable[..., Surface]) -> list[Surface]:
    """Leaves of one pattern and the same edges, bent differently; each fifth is an earlier one, mirrored by turns."""
    rng = np.random.default_rng(0)
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    made: list[Surface] = []
    for number in range(count):
        if number % 5 == 4:
            made.append(moved(made[number // 2], size=1.0 + number, seed=number, mirrored=number % 2 == 0))
            continue
        bend = rng.uniform(0.0, 3.0)
        points = np.array([[0.0, 0, 0], [1, -1, 0], [3, 0, 0], [1, np.cos(bend), np.sin(bend)]])
        made.append(Surface(points, faces))
    return made


def test_among_leaves_of_one_pattern_the_copies_are_those_that_pairs_compared_one_by_one_show(
    together: Callable[..., Surface], moved: Callable[..., Surface]
) -> None:
    parts = parts_of(together(*leaves(60, moved)))
    own: list[int] = []
    for number, part in enumerate(parts):
        ways = [(known, mirrored) for mirrored in (False, True) for known in own]
        same = [way for way in ways if is_copy(parts[way[0]], part, TOLERANCE, mirrored=way[1])]
        own += [] if same else [number]
        assert (part.copy_of, part.mirrored) == (same[0] if same else (-1, False))
    assert 10 <= len(parts) - len(own) < 20


def test_a_tree_of_leaves_is_compared_with_few_of_its_leaves(
    together: Callable[..., Surface], moved: Callable[..., Surface], monkeypatch: pytest.MonkeyPatch
) -> None:
    pairs: list[tuple[Part, Part]] = []

    def counted(first: Part, second: Part, tolerance: float, *, mirrored: bool) -> bool:
        pairs.append((first, second))
        return is_copy(first, second, tolerance, mirrored=mirrored)

    monkeypatch.setattr("flexpara.train.charts.parts.is_copy", counted)
    parts = parts_of(together(*leaves(500, moved)))
    assert sum(part.copy_of >= 0 for part in parts) >= 100
    assert len(pairs) < 2 * len(parts)


def test_a_pattern_does_not_depend_on_numbers_but_on_how_faces_meet() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3]])
    assert pattern(faces, mirrored=False) != pattern(np.array([[0, 1, 2], [1, 2, 3]]), mirrored=False)
    mirrored = np.array([[0, 2, 1], [2, 3, 1]])
    assert pattern(mirrored, mirrored=True) == pattern(np.array([[0, 1, 2], [2, 1, 3]]), mirrored=False)
