"""Sheets: faces that lie on each other come apart, front with front and back with back."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.topology import boundary_loops, components, edge_table, euler_characteristic
from flexpara.runtime.io.clean.sheets import separate_sheets, twins
from flexpara.runtime.samples import make_sample


def apart(faces: list[list[int]] | np.ndarray) -> np.ndarray:
    """The faces after the split; every vertex stays where it was."""
    given = np.asarray(faces, dtype=np.int64)
    result, source = separate_sheets(given, twins(given))
    np.testing.assert_array_equal(source[result], given)
    assert source[: given.max() + 1].tolist() == list(range(given.max() + 1))
    return result


def reverse(faces: np.ndarray) -> np.ndarray:
    return np.asarray(faces)[:, [0, 2, 1]]


def grid(n: int) -> np.ndarray:
    """N × n squares of two triangles, all winding alike."""
    i, j = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    a = (i * (n + 1) + j).ravel()
    return np.concatenate([np.stack([a, a + n + 1, a + 1], 1), np.stack([a + 1, a + n + 1, a + n + 2], 1)])


def test_faces_without_twins_are_left_alone() -> None:
    _, faces = make_sample("trefoil")
    assert apart(faces) is faces or (apart(faces) == faces).all()


def test_twins_have_the_same_vertices_whatever_their_winding() -> None:
    assert twins(np.array([[0, 1, 2], [2, 1, 0], [1, 2, 3], [1, 2, 0]])).tolist() == [0, 0, 1, 0]


@pytest.mark.parametrize("second", [[0, 2, 1], [0, 1, 2], [1, 2, 0]])
def test_a_triangle_and_its_second_side_or_copy_share_nothing(second: list[int]) -> None:
    result = apart([[0, 1, 2], second])
    assert result[0].tolist() == [0, 1, 2]
    assert not set(result[0].tolist()) & set(result[1].tolist())


@pytest.mark.parametrize("order", ["blocks", "alternating", "shuffled"])
def test_a_sheet_with_two_sides_becomes_two_disks(order: str) -> None:
    front = grid(4)
    whole = np.concatenate([front, reverse(front)])
    rng = np.random.default_rng(0)
    place = {
        "blocks": np.arange(64),
        "alternating": np.arange(64).reshape(2, -1).T.ravel(),
        "shuffled": rng.permutation(64),
    }[order]
    result = apart(whole[place])
    label = components(result)
    assert sorted(np.bincount(label).tolist()) == [32, 32]
    is_front = place < 32
    assert len(set(label[is_front].tolist())) == 1
    assert edge_table(result).edge_count.max() == 2
    for side in (result[is_front], result[~is_front]):
        assert len(boundary_loops(side)) == 1
        assert euler_characteristic(side) == 1


@pytest.mark.parametrize("turned", [False, True])
def test_a_closed_part_that_stands_twice_becomes_two_closed_parts(turned: bool) -> None:
    _, faces = make_sample("trefoil")
    result = apart(np.concatenate([faces, reverse(faces) if turned else faces]))
    label = components(result)
    assert np.bincount(label).tolist() == [len(faces), len(faces)]
    assert (label == np.repeat([0, 1], len(faces))).all()
    assert edge_table(result).edge_count.max() == 2


def test_three_copies_become_three() -> None:
    result = apart(np.concatenate([grid(2)] * 3))
    assert components(result).tolist() == np.repeat([0, 1, 2], 8).tolist()


def test_a_single_copy_in_a_whole_surface_is_a_triangle_of_its_own() -> None:
    _, faces = make_sample("trefoil")
    for copy in (faces[:1], reverse(faces[:1])):
        result = apart(np.concatenate([faces, copy]))
        np.testing.assert_array_equal(result[:-1], faces)
        assert not set(result[-1].tolist()) & set(faces.ravel().tolist())


def test_a_fin_with_two_sides_leaves_the_plate_whole_that_it_stands_on() -> None:
    plate = grid(2)  # vertices 0 … 8; the fin stands on the middle line 3 4 5
    fin = np.array([[3, 4, 9], [4, 10, 9], [4, 5, 10]])
    result = apart(np.concatenate([plate, fin, reverse(fin)]))
    np.testing.assert_array_equal(result[: len(plate)], plate)
    assert edge_table(result).edge_count.max() == 2
    assert np.bincount(components(result)).tolist() == [8, 3, 3]


def test_a_plate_goes_on_in_the_front_of_a_part_with_two_sides() -> None:
    whole = grid(2)
    result = apart(np.concatenate([whole, reverse(whole[:4])]))  # the faces before it have a back
    np.testing.assert_array_equal(result[: len(whole)], whole)
    assert edge_table(result).edge_count.max() == 2
    assert len(set(components(result)[: len(whole)].tolist())) == 1
    assert not set(result[: len(whole)].ravel().tolist()) & set(result[len(whole) :].ravel().tolist())


def test_many_faces_along_one_edge_end() -> None:
    pages = np.array([[0, 1, 2 + index] for index in range(2000)])
    result = apart(np.concatenate([pages, reverse(pages), pages]))
    assert len(result) == 6000
