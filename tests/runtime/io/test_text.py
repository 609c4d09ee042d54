"""Text of any encoding → lines and numbers."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.errors import InputError
from flexpara.runtime.io.text import decode, finite, lines_of, number_table, shown

TEXT = "v 1 2 3 # Maßstab\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-16-be", "latin-1"])
def test_text_is_decoded_whatever_its_encoding(encoding: str) -> None:
    assert decode(TEXT.encode(encoding)) == TEXT
    assert decode(b"") == ""


def test_any_bytes_are_some_text() -> None:
    rng = np.random.default_rng(0)
    for _ in range(200):
        assert isinstance(decode(rng.bytes(int(rng.integers(1, 40)))), str)


def test_lines_end_as_lines_do_and_nowhere_else() -> None:
    assert lines_of(b"a\nb\r\nc\rd\x0be\x85f") == ["a", "b", "c", "d\x0be\x85f"]


def test_short_lines_are_filled_with_nan_and_counted() -> None:
    table, width = number_table(["1 2 3", "4 5", "6 7 8 9"], [3, 4, 9], 2, 3)
    np.testing.assert_array_equal(table, [[1, 2, 3], [4, 5, np.nan], [6, 7, 8]])
    assert width.tolist() == [3, 2, 3]
    empty, none = number_table([], [], 2, 3)
    assert (empty.shape, none.shape) == ((0, 2), (0,))


def test_lines_too_short_or_without_numbers_are_named() -> None:
    with pytest.raises(InputError, match=r"line 9 has 1 numbers \('4'\), expected 2 or more"):
        number_table(["1 2", "4"], [8, 9], 2, 2)
    with pytest.raises(InputError, match=r"line 9 holds what is no number \('4 x'\)"):
        number_table(["1 2", "4 x"], [8, 9], 2, 2)


def test_long_text_is_shown_by_its_beginning() -> None:
    assert shown("a \n b") == "'a b'"
    assert shown("x" * 41) == "'" + "x" * 40 + "…'"


@pytest.mark.parametrize("value", ["nan", "inf", "one", None, [1]])
def test_finite_refuses_what_is_no_finite_number(value: object) -> None:
    assert finite("1.5") == 1.5
    with pytest.raises(ValueError, match=r"finite|float"):
        finite(value)
