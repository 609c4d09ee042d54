"""Contact sheets: unwraps one below the other, as papers show them, drawn with the canvas of the preview.

A row is one unwrap: its title, and a panel for each of `COLUMNS`.  Colours are linear light until the file is written.
uv are v up; a layout is coloured by (n + 1) / 2 of the surface normal n in the space of the mesh, read as sRGB.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from flexpara.bake.colors.color import chart_colors, linear_from_srgb
from flexpara.bake.colors.lettering import text_cover, with_text
from flexpara.bake.files.images import write_png
from flexpara.bake.pictures.canvas import Camera, Lines, draw, three_quarter_axes
from flexpara.bake.pictures.preview import INK, PAPER, checker_cells, layout, shading_normals, solid
from flexpara.bake.raster.context import open_context
from flexpara.bake.seams.seamcheck import seam_edges
from flexpara.bake.texture import Texture
from flexpara.runtime.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    import moderngl
    from numpy.typing import NDArray

    from flexpara.runtime.mesh import Asset, Atlas

    Entry = tuple[str, Asset, Atlas]

COLUMNS = ("Checker", "Checker, back", "Seams", "Charts", "UV by normal", "UV by chart")
PANEL = 420
SMALLEST_PANEL = 240
"""Below it the columns' names run into each other."""
BAND = 44
"""Pixels above each row for its title, and above the sheet for the columns' names."""
RED = (0.80, 0.008, 0.008)
GREY = (0.25, 0.25, 0.25)
COLUMN_HEIGHT, TITLE_HEIGHT, MARGIN = 20.0, 26.0, 24
"""Heights of the fonts, and the free part left and right of a title, pixels."""
CLAY = 0.55
"""Linear grey of a shape that shows its seams."""


def render_sheet(entries: Sequence[Entry], path: Path, *, pixels: int = PANEL) -> None:
    """Write a contact sheet as an 8-bit sRGB PNG.  Arguments and errors as `sheet_pixels`."""
    write_png(Texture(sheet_pixels(entries, pixels=pixels), "srgb", 8, "png"), path)


def sheet_pixels(entries: Sequence[Entry], *, pixels: int = PANEL) -> NDArray[np.float32]:
    """The contact sheet.

    Args:
        entries: (title, asset, atlas) a row; a title longer than the sheet is wide ends in dots.
        pixels: side of a panel, 240 or more.

    Returns:
        (BAND + rows · (BAND + pixels), 6 · pixels, 3) float32 linear light.

    Raises:
        InputError: no entry, or panels too small for their names.
        MissingDependencyError: there is no OpenGL.
    """
    if not entries:
        raise InputError("a contact sheet has 0 rows, expected one or more; name at least one unwrap")
    if pixels < SMALLEST_PANEL:
        raise InputError(f"panels are {pixels} pixels, expected {SMALLEST_PANEL} or more; leave pixels out")
    width = len(COLUMNS) * pixels
    head = np.full((BAND, width, 3), PAPER, np.float32)
    for number, name in enumerate(COLUMNS):
        head = with_text(head, name, (BAND / 2, (number + 0.5) * pixels), height=COLUMN_HEIGHT, color=GREY)
    rows = [head]
    with open_context() as context:
        for title, asset, atlas in entries:
            band = np.full((BAND, width, 3), PAPER, np.float32)
            text, place = shortened(title, width), (BAND / 2, float(MARGIN))
            rows.append(with_text(band, text, place, height=TITLE_HEIGHT, color=GREY, align="left"))
            rows.append(np.concatenate(panels(context, asset, atlas, pixels), axis=1))
    return np.concatenate(rows, axis=0)


def panels(context: moderngl.Context, asset: Asset, atlas: Atlas, pixels: int) -> list[NDArray[np.float32]]:
    """A panel (pixels, pixels, 3) float32 linear light for each of `COLUMNS`."""
    front = three_quarter_axes()
    back = front * np.array([-1.0, 1.0, -1.0])
    views = [Camera.fit(atlas.positions[atlas.faces].reshape(-1, 3), axes) for axes in (front, back)]
    colors = chart_colors(int(atlas.face_chart.max()) + 1)
    seams = seam_edges(atlas)
    charts = solid(atlas, shading_normals(asset), colors[atlas.face_chart])
    checkered = replace(charts, cells=checker_cells(atlas))
    clay = replace(charts, colors=np.full((len(atlas.faces), 3), CLAY, np.float32))
    by_face = replace(atlas, face_chart=np.arange(len(atlas.faces)))
    scenes = [
        (views[0], checkered, Lines(seams, INK, 1.2)),
        (views[1], checkered, Lines(seams, INK, 1.2)),
        (views[0], clay, Lines(seams, RED, 2.4)),
        (views[0], charts, Lines(seams, INK, 1.2)),
        layout(by_face, normal_colors(atlas)),
        layout(atlas, colors),
    ]
    return [draw(context, *scene, pixels=pixels, paper=PAPER) for scene in scenes]


def normal_colors(atlas: Atlas) -> NDArray[np.float32]:
    """(f, 3) float32 linear light: (n + 1) / 2 of the mean of each face's corner normals, read as sRGB."""
    mean = atlas.normals[atlas.faces].astype(np.float64).mean(axis=1)
    unit = mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    return linear_from_srgb((unit + 1.0) / 2.0).astype(np.float32)


def shortened(title: str, width: int) -> str:
    """The title as far as a band of that many pixels holds it, a margin left and right."""
    room = width - 2 * MARGIN
    if text_cover(title, TITLE_HEIGHT).shape[1] <= room:
        return title
    fits = [most for most in range(len(title)) if text_cover(f"{title[:most]}...", TITLE_HEIGHT).shape[1] <= room]
    return f"{title[: max(fits, default=0)]}..."
