"""Unwraps of one mesh with different numbers of charts, side by side: a table, and one sheet with a picture each.

A column is one unwrap: the shape with a checkerboard and its seams, the uv layout below it, and a caption.
"""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...runtime.errors import InputError
from ...runtime.options.seams import AUTO
from ..colors.color import chart_colors
from ..colors.lettering import with_text
from ..raster.context import open_context
from ..seams.seamcheck import seam_edges
from .canvas import Camera, Lines, draw, three_quarter_axes
from .preview import FOOT, INK, LETTER_HEIGHT, LETTERS, PAPER, checker_cells, counted, layout, shading_normals, solid

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.unwrap import Options

    Unwrap = Callable[[Options], Any]
    """What makes a result with asset, atlas and report of options."""

PANEL = 420
COLUMNS = {
    "asked": "{}", "charts": "{}", "stretch": "{:.4f}", "seam": "{:.2f}", "packing": "{:.3f}", "seconds": "{:.1f}",
}  # fmt: skip


class Compared(NamedTuple):
    """One unwrap.  numbers: of the table, by column.  report: what is known besides."""

    asset: Asset
    atlas: Atlas
    numbers: dict[str, Any]
    report: Mapping[str, Any] = MappingProxyType({})


class Comparison(NamedTuple):
    """The unwraps in the order asked for."""

    rows: tuple[Compared, ...]

    @property
    def table(self) -> str:
        """The table as text, its columns aligned."""
        cells = [list(COLUMNS)]
        cells += [[form.format(row.numbers[name]) for name, form in COLUMNS.items()] for row in self.rows]
        widths = [max(len(line[column]) for line in cells) for column in range(len(COLUMNS))]
        return "".join("  ".join(map(str.rjust, line, widths)) + "\n" for line in cells)


def numbers_of_charts(words: Sequence[str]) -> list[int | str]:
    """What --compare names: numbers, or auto.  Raises: InputError for anything else."""
    found: list[int | str] = []
    for word in words:
        if word != AUTO and not (word.isdecimal() and int(word) >= 1):
            raise InputError(f"compare has {word!r}, expected numbers of charts, or auto; pass --compare 1,2,4,8,16")
        found.append(AUTO if word == AUTO else int(word))
    return found


def compare(options: Options, words: Sequence[str], unwrap: Unwrap) -> Comparison:
    """An unwrap for each number of charts; figures as in `runtime.geometry.metrics`, seconds by the clock."""
    rows = []
    for count in numbers_of_charts(words):
        start = perf_counter()
        result = unwrap(replace(options, charts=count))
        metrics = result.report["metrics"]
        numbers = {
            "asked": count,
            "charts": metrics["charts"],
            "stretch": metrics["symmetric_dirichlet_mean"],
            "seam": metrics["seam_length"],
            "packing": metrics["packing_efficiency"],
            "seconds": perf_counter() - start,
        }
        rows.append(Compared(result.asset, result.atlas, numbers, result.report))
    return Comparison(tuple(rows))


def comparison_pixels(rows: Sequence[Compared]) -> NDArray[np.float32]:
    """(2 · PANEL + FOOT, PANEL · rows, 3) float32 linear light.  Raises: MissingDependencyError without OpenGL."""
    columns = []
    with open_context() as context:
        for asset, atlas, numbers, _ in rows:
            colors = chart_colors(int(atlas.face_chart.max()) + 1)
            shape = solid(atlas, shading_normals(asset), colors[atlas.face_chart], cells=checker_cells(atlas))
            camera = Camera.fit(atlas.positions[atlas.faces].reshape(-1, 3), three_quarter_axes())
            seams = Lines(seam_edges(atlas), INK, 1.6)
            above = draw(context, camera, shape, seams, pixels=PANEL, paper=PAPER)
            below = draw(context, *layout(atlas, colors), pixels=PANEL, paper=PAPER)
            words = f"{counted(numbers['charts'])}, {numbers['stretch']:.4f}, seam {numbers['seam']:.2f}"
            foot = np.full((FOOT, PANEL, 3), PAPER, np.float32)
            foot = with_text(foot, words, (20.0, PANEL / 2), height=LETTER_HEIGHT, color=LETTERS)
            columns.append(np.concatenate([above, below, foot], axis=0))
    return np.concatenate(columns, axis=1)
