"""Unwraps of one mesh with different numbers of charts, as files: pictures, the table, a page."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

from ..files.images import write_png
from ..pictures.comparison import comparison_pixels
from ..report.gather import write_compared
from ..texture import Texture

if TYPE_CHECKING:
    from pathlib import Path

    from ...runtime.files import OutputFolder
    from ..pictures.comparison import Comparison

TABLE = "{}.compare.json"
"""Name of the report, which has the table, by the stem of the mesh."""


def compared_files(stem: str, *, page: bool) -> list[str]:
    """Names of the files beside the report."""
    return [f"{stem}.compare.png", *([f"{stem}.compare.html"] if page else [])]


def write_comparison(output: OutputFolder, found: Comparison, *, page: bool) -> tuple[Path, ...]:
    """Write the sheet (PNG, 8 bits, sRGB) and the table; page: also one HTML file of all of them.

    Raises: MissingDependencyError without OpenGL; ForeignFileError over a file of anybody else.
    """
    sheet, *pages = compared_files(output.stem, page=page)
    pixels = comparison_pixels(found.rows)
    output.write(sheet, lambda place: write_png(Texture(pixels, "srgb", 8, "png"), place))
    named = [(f"at most {row.numbers['asked']}", row.atlas, row.asset, row.report) for row in found.rows]
    for name in pages:
        output.write(name, partial(write_compared, named, f"{output.stem}, charts compared"))
    output.write_report({"compared": [row.numbers for row in found.rows]})
    return output.commit()
