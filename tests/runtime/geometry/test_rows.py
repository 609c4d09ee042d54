"""Equal rows: labels by hand, zeros of both signs, numbering by first appearance."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.rows import (
    by_first_appearance,
    compacted,
    distinct,
    equal_rows,
    first_of_each,
    grouped,
    keys,
)


def test_equal_rows_share_a_label_and_no_others_do() -> None:
    label = equal_rows(np.array([[2.0, 1.0], [0.0, 1.0], [2.0, 1.0], [2.0, np.nextafter(1.0, 2.0)]]))
    assert label[0] == label[2]
    assert sorted(set(label.tolist())) == [0, 1, 2]


def test_zeros_of_both_signs_are_equal() -> None:
    assert len(set(equal_rows(np.array([[0.0, 1.0], [-0.0, 1.0]])).tolist())) == 1


def test_labels_of_random_rows_are_those_of_a_dictionary() -> None:
    rows = np.random.default_rng(0).integers(0, 3, (200, 4))
    number: dict[tuple[int, ...], int] = {}
    expected = [number.setdefault(tuple(row), len(number)) for row in rows.tolist()]
    assert by_first_appearance(equal_rows(rows)).tolist() == expected


def test_first_of_each_label_in_order() -> None:
    assert first_of_each(np.array([1, 0, 1, 2, 0])).tolist() == [1, 0, 3]


def test_no_rows_have_no_labels() -> None:
    assert len(equal_rows(np.zeros((0, 3)))) == 0


@pytest.mark.parametrize("bound", [3, 10**6, 10**9])
def test_labels_of_integers_ascend_as_those_of_the_same_numbers_in_floating_point(bound: int) -> None:
    rows = np.random.default_rng(1).integers(-bound, bound, (300, 3))
    rows = np.concatenate([rows, rows[:50]])
    assert np.array_equal(equal_rows(rows), equal_rows(rows.astype(np.float64)))
    assert (keys(rows) is None) == (bound == 10**9)


def test_classes_keep_their_members_when_they_are_numbered_anew() -> None:
    label = np.array([4, 4, 0, 7, 0, 4])
    assert by_first_appearance(label).tolist() == [0, 0, 1, 2, 1, 0]
    assert by_first_appearance(label[:0]).tolist() == []


def test_distinct_numbers_ascend() -> None:
    assert distinct(np.array([3, 1, 3, -2, 1])).tolist() == [-2, 1, 3]
    assert distinct(np.zeros(0, dtype=np.int64)).tolist() == []


def test_compacted_numbers_name_their_places_among_the_different_ones() -> None:
    index = np.random.default_rng(2).integers(0, 50, (20, 3))
    expected, inverse = np.unique(index, return_inverse=True)
    used, place = compacted(index)
    assert np.array_equal(used, expected)
    assert np.array_equal(place, inverse.reshape(20, 3))


def test_rows_are_grouped_by_label() -> None:
    assert [rows.tolist() for rows in grouped(np.array([1, 0, 1, 3]))] == [[1], [0, 2], [], [3]]
    assert [rows.tolist() for rows in grouped(np.array([1, 0]), 3)] == [[1], [0], []]
    assert grouped(np.zeros(0, dtype=np.int64)) == []
