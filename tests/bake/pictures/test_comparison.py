"""Several numbers of charts side by side: a row and a picture each, and only numbers are taken."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import flexpara
from flexpara.bake.pictures.comparison import FOOT, PANEL, Comparison, compare, comparison_pixels, numbers_of_charts
from flexpara.runtime.errors import InputError
from flexpara.runtime.options.unwrap import Options

pytest.importorskip("igl")

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])


@pytest.fixture(scope="module")
def found() -> Comparison:
    def unwrap(options: Options) -> Any:
        return flexpara.unwrap((VERTICES, FACES), options)

    return compare(Options(size=64), ("1", "auto"), unwrap)


def test_each_number_of_charts_has_a_row_of_the_table(found: Comparison) -> None:
    head, *rows = found.table.splitlines()
    assert head.split() == ["asked", "charts", "stretch", "seam", "packing", "seconds"]
    assert [row.split()[0] for row in rows] == ["1", "auto"]
    assert len({len(row) for row in (head, *rows)}) == 1


def test_each_number_of_charts_has_a_column_of_the_sheet(found: Comparison) -> None:
    pixels = comparison_pixels(found.rows)
    assert pixels.shape == (2 * PANEL + FOOT, 2 * PANEL, 3)
    assert np.ptp(pixels[:PANEL, :PANEL]) > 0.2


@pytest.mark.parametrize("word", ["0", "few", "-1", "1.5"])
def test_what_is_no_number_of_charts_is_refused(word: str) -> None:
    with pytest.raises(InputError, match="expected numbers of charts"):
        numbers_of_charts(["2", word])
