"""Equal rows: labels by hand, zeros of both signs, numbering by first appearance."""

from __future__ import annotations

import numpy as np

from flexpara.runtime.geometry.rows import by_first_appearance, equal_rows, first_of_each


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
