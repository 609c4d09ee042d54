"""Numbers in words that need no glossary: what is measured, how it reads, and which way is better."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

LESS, MORE = -1, 1


@dataclass(frozen=True)
class Line:
    """One line of the table.

    name, meaning: words.  key: of the metrics.  form: for `str.format`.  better: LESS, MORE or 0 for neither.
    scale: factor before it is shown.  offset: added before that.
    """

    name: str
    key: str
    form: str
    meaning: str
    better: int = LESS
    scale: float = 1.0
    offset: float = 0.0


LINES = (
    Line("Charts", "charts", "{:.0f}", "Pieces that the surface was cut into."),
    Line(
        "Distortion",
        "symmetric_dirichlet_mean",
        "{:.2f} %",
        "How far triangles are from their true shape and size on average (symmetric Dirichlet energy above 1).",
        scale=100.0,
        offset=-1.0,
    ),
    Line(
        "Worst stretch", "stretch_linf", "{:.2f} ×", "The most that any place is shrunk in uv; a picture blurs there."
    ),
    Line(
        "Angles",
        "conformal_mean",
        "{:.2f}°",
        "How far the corners of triangles are off on average.",
        scale=180.0 / math.pi,
    ),
    Line(
        "Seam length",
        "seam_length",
        "{:.2f}",
        "Length of all cuts, where 1 is the side of a square as large as the surface.",
    ),
    Line(
        "Flipped triangles",
        "flipped_faces",
        "{:.0f}",
        "Triangles turned over against their chart: pictures are mirrored there.",
    ),
    Line(
        "Overlap",
        "overlap_fraction",
        "{:.2f} %",
        "Share of the layout where two places of the surface share texels.",
        scale=100.0,
    ),
    Line(
        "Use of the square", "packing_efficiency", "{:.1f} %", "Share of the texels that hold a surface.", MORE, 100.0
    ),
    Line("Texels per unit", "texel_density_mean", "{:.4g}", "Of the source's unit of length, on average.", MORE),
    Line(
        "Clean mip levels",
        "bleed_free_mip",
        "{:.0f}",
        "The highest mip level at which no chart takes in another's texels.",
        MORE,
    ),
    Line("Network error", "rms_texels", "{:.2f} texels", "How far the answers of the ONNX file are from the atlas."),
    Line(
        "Right chart",
        "chart_agreement",
        "{:.2f} %",
        "Share of points for which the ONNX file names the right chart.",
        MORE,
        100.0,
    ),
)


@dataclass(frozen=True)
class Row:
    """A line for several results.  values: a text each, "–" where it is unknown.  best: which are ahead of others."""

    name: str
    meaning: str
    values: tuple[str, ...]
    best: tuple[bool, ...]


def table(metrics: Sequence[Mapping[str, Any]], *, ranked: bool = True) -> list[Row]:
    """The lines for which some result has a number.  ranked: whether it is said which are ahead of others."""
    rows = []
    for line in LINES:
        numbers = [number_of(found.get(line.key)) for found in metrics]
        shown = [number for number in numbers if number is not None]
        if shown:
            texts = tuple("–" if n is None else line.form.format((n + line.offset) * line.scale) for n in numbers)
            ranks = ranked and line.better and len(set(texts)) > 1
            ahead = max(shown, key=lambda number: number * line.better) if ranks else None
            best = tuple(n is not None and n == ahead for n in numbers)
            rows.append(Row(line.name, line.meaning, texts, best))
    return rows


def number_of(value: object) -> float | None:
    """A finite number as it may come out of a foreign JSON file, else None."""
    plain = isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < 1e300
    return float(value) if plain and math.isfinite(value) else None  # pyright: ignore[reportArgumentType]
