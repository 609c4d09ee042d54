"""Several numbers of charts side by side: a row and a picture each, and only numbers are taken."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

import flexpara
from flexpara.bake.pictures.comparison import FOOT, PANEL, Comparison, compare, comparison_pixels, numbers_of_charts
from flexpara.bake.report.gather import write_compared
from flexpara.runtime.errors import InputError
from flexpara.runtime.options.unwrap import Options

if TYPE_CHECKING:
    from pathlib import Path

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


def test_a_sheet_is_written_over_another_file_only_when_forced(found: Comparison, tmp_path: Path) -> None:
    path = found.write(tmp_path / "sheet.png", force=False)
    assert path.read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InputError):
        found.write(path, force=False)
    found.write(path, force=True)


def test_a_page_of_them_names_each_by_what_was_asked(found: Comparison, tmp_path: Path) -> None:
    named = [(f"at most {row.numbers['asked']}", row.atlas, row.asset, row.report) for row in found.rows]
    write_compared(named, "mesh, charts compared", tmp_path / "compare.html")
    page = (tmp_path / "compare.html").read_text(encoding="utf-8")
    assert "mesh, charts compared" in page
    assert page.count("at most 1") >= 1
    assert page.count("at most auto") >= 1


@pytest.mark.parametrize("word", ["0", "few", "-1", "1.5"])
def test_what_is_no_number_of_charts_is_refused(word: str) -> None:
    with pytest.raises(InputError, match="expected numbers of charts"):
        numbers_of_charts(["2", word])
