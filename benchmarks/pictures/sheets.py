"""Sheets of pictures side by side: a shape, its layout in uv, and what was asked for below."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from PIL import Image

from flexpara.bake.colors.color import chart_colors, srgb_bytes_from_linear
from flexpara.bake.colors.lettering import with_text
from flexpara.bake.pictures.canvas import Camera, Lines, draw, three_quarter_axes
from flexpara.bake.pictures.preview import INK, LETTERS, PAPER, checker_cells, counted, layout, shading_normals, solid
from flexpara.bake.raster.context import open_context
from flexpara.bake.seams.seamcheck import seam_edges

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from flexpara.runtime.mesh import Asset, Atlas

FOLDER = Path(__file__).resolve().parents[2] / "docs" / "pictures"
QUALITY = 78
WIDTH = 900
"""Pixels of a sheet at most."""
PANEL = 420
FOOT = 76
HEIGHT = 20.0
"""Pixels of letters; a column's foot has two lines of them."""


@dataclass(frozen=True)
class Column:
    """One result.  words: the line of what was asked.  measured: a line of what came of it."""

    asset: Asset
    atlas: Atlas
    words: str
    measured: str

    @classmethod
    def of(cls, asset: Asset, atlas: Atlas, words: str, metrics: dict[str, Any]) -> Column:
        """With charts, mean stretch and seam length of its metrics."""
        stretch, seam = metrics["symmetric_dirichlet_mean"], metrics["seam_length"]
        return cls(asset, atlas, words, f"{counted(metrics['charts'])}, {stretch:.4f}, seam {seam:.2f}")


def save(name: str, pixels: NDArray[np.floating]) -> None:
    """Linear light (h, w, 3) as a small WebP file."""
    keep(name, Image.fromarray(srgb_bytes_from_linear(np.ascontiguousarray(pixels, np.float32))))


def keep(name: str, image: Image.Image) -> None:
    """An image, no larger than a sheet, as a file of that name."""
    path = FOLDER / f"{name}.webp"
    image.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    FOLDER.mkdir(exist_ok=True)
    image.save(path, quality=QUALITY, method=6)
    print(f"{name}: {path.stat().st_size // 1024} KiB", flush=True)


def foot(*lines: str, width: int = PANEL) -> NDArray[np.float32]:
    """(FOOT, width, 3) lines of text, one below the other."""
    pixels = np.full((FOOT, width, 3), PAPER, np.float32)
    for number, line in enumerate(lines):
        pixels = with_text(pixels, line, (18.0 + 28.0 * number, width / 2), height=HEIGHT, color=LETTERS)
    return pixels


def sheet(columns: Sequence[Column], *, grey: bool = False) -> NDArray[np.float32]:
    """(2 · PANEL + FOOT, PANEL · columns, 3) linear light.  grey: shapes without charts and checker."""
    drawn = []
    with open_context() as context:
        for column in columns:
            atlas, normals = column.atlas, shading_normals(column.asset)
            colors = chart_colors(int(atlas.face_chart.max()) + 1)
            faces = np.full((len(atlas.faces), 3), 0.5, np.float32) if grey else colors[atlas.face_chart]
            shape = solid(atlas, normals, faces, cells=0.0 if grey else checker_cells(atlas))
            camera = Camera.fit(atlas.positions[atlas.faces].reshape(-1, 3), three_quarter_axes())
            lines = Lines(seam_edges(atlas)[: 1 if grey else None], INK, 1.6)
            above = draw(context, camera, shape, lines, pixels=PANEL, paper=PAPER)
            below = draw(context, *layout(atlas, colors), pixels=PANEL, paper=PAPER)
            drawn.append(np.concatenate([above, below, foot(column.words, column.measured)]))
    return np.concatenate(drawn, axis=1)
