"""The preview: one picture of the shape with a checkerboard through its uv, the uv layout, and the distortion.

f faces · k charts · s seam edges.  Colours are linear light until the file is written.  A chart has one colour, left
and middle.  Right, red faces are larger in uv than their share of the surface, blue ones smaller (see heat.py).
Lines on the shape are seams alone: edges that lie in uv twice.  Light falls on the normals of the source; where it has
none, they are smooth up to a crease.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.geometry.metrics import face_distortion
from ...runtime.sessions.wrapagreement import corner_normals
from ..colors.color import chart_colors
from ..colors.heat import distortion_scale, face_areas, heat_colors, signed_distortion
from ..colors.lettering import with_text
from ..files.images import write_png
from ..raster.context import open_context
from ..seams.seamcheck import chart_outlines, seam_edges
from ..texture import Texture
from .canvas import Camera, Lines, Shape, draw, three_quarter_axes

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas

PANEL = 640
FOOT = 56
"""Pixels below each panel for its caption."""
PAPER = (0.93, 0.935, 0.94)
SHEET = (0.99, 0.99, 0.99)
INK = (0.02, 0.022, 0.03)
LETTERS, LETTER_HEIGHT = (0.075, 0.08, 0.09), 18.0
"""Colour, and height of the font in pixels."""
CHECKS = 26.0
"""Checker squares along the bounding box's diagonal."""
BAR = slice(14, 26)
"""Rows of the scale of distortion, below its panel."""


def render_preview(atlas: Atlas, asset: Asset, path: Path) -> None:
    """Write the preview as an 8-bit sRGB PNG of three panels, 1920 × 696 pixels.

    Args:
        atlas: the finished atlas.
        asset: what it is an atlas of; its faces are those of the atlas, in the same order.
        path: the PNG file.

    Raises: MissingDependencyError without OpenGL.
    """
    write_png(Texture(preview_pixels(atlas, asset), "srgb", 8, "png"), path)


def preview_pixels(atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """(696, 1920, 3) float32 linear light.  Arguments and errors as `render_preview`."""
    stretch = face_distortion(asset.surface, atlas.even_uv)
    top, charts = distortion_scale(stretch), int(atlas.face_chart.max()) + 1
    normals, seams = shading_normals(asset), seam_edges(atlas)
    checkered = solid(atlas, normals, chart_colors(charts)[atlas.face_chart], cells=checker_cells(atlas))
    heated = solid(atlas, normals, heat_colors(signed_distortion(atlas, stretch, top)))
    with open_context() as context:
        camera = Camera.fit(atlas.positions[atlas.faces].reshape(-1, 3), three_quarter_axes())
        panels = [
            draw(context, camera, checkered, Lines(seams, INK, 1.8), pixels=PANEL, paper=PAPER),
            draw(context, *layout(atlas, chart_colors(charts)), pixels=PANEL, paper=PAPER),
            draw(context, camera, heated, Lines(seams, INK, 1.2), pixels=PANEL, paper=PAPER),
        ]
    feet = [caption("Checker through the new uv"), caption(f"UV layout, {counted(charts)}"), legend(top)]
    return np.concatenate([np.concatenate(pair, axis=0) for pair in zip(panels, feet, strict=True)], axis=1)


def counted(charts: int) -> str:
    """The number of charts in words of a caption."""
    return "1 chart" if charts == 1 else f"{charts} charts"


def shading_normals(asset: Asset) -> NDArray[np.float64]:
    """(f, 3, 3) float64 corner normals: the source's own; smooth up to a crease where it has none."""
    if asset.normals is None:
        return corner_normals(asset.surface)
    return asset.normals[asset.faces].astype(np.float64)


def solid(atlas: Atlas, normals: NDArray[np.float64], colors: NDArray[np.float32], *, cells: float = 0.0) -> Shape:
    """The surface in 3D with normals (f, 3, 3) and a colour per face (f, 3)."""
    return Shape(atlas.positions[atlas.faces], normals, atlas.even_uv, colors, cells=cells)


def layout(atlas: Atlas, colors: NDArray[np.float32]) -> tuple[Camera, Shape, Lines]:
    """The page seen from above: white sheet, charts in their colours (k, 3), their outlines."""
    extent = atlas.page.extent
    sheet = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]]) * extent
    flat = np.concatenate([sheet, atlas.even_uv])
    height = np.concatenate([np.zeros(2), np.ones(len(atlas.faces))])
    positions = np.dstack([flat, np.broadcast_to(height[:, None, None], (*flat.shape[:2], 1))])
    normals = np.broadcast_to(np.array([0.0, 0.0, 1.0]), positions.shape)
    tones = np.concatenate([np.full((2, 3), SHEET[0], np.float32), colors[atlas.face_chart]])
    outline = chart_outlines(atlas) * extent
    square = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * extent
    flat_lines = np.concatenate([outline, np.stack([square, np.roll(square, -1, axis=0)], axis=1)])
    lines = np.concatenate([flat_lines, np.ones((*flat_lines.shape[:2], 1))], axis=2)
    camera = Camera.fit(np.array([[0.0, 0.0, 0.0], [*extent, 1.0]]), np.eye(3))
    return camera, Shape(positions, normals, flat, tones, lit=False), Lines(lines, INK, 1.2)


def checker_cells(atlas: Atlas) -> float:
    """Checker squares per uv unit that make about `CHECKS` along the bounding box's diagonal."""
    surface, flat = face_areas(atlas)
    diagonal = float(np.linalg.norm(np.ptp(atlas.positions, axis=0)))
    density = np.sqrt(max(float(surface.sum()), 1e-300) / max(float(flat.sum()), 1e-300))
    return max(round(CHECKS * density / diagonal), 1) if diagonal > 0.0 else 1.0


def caption(text: str) -> NDArray[np.float32]:
    """(FOOT, PANEL, 3) float32 linear light: one line in the middle."""
    foot = np.full((FOOT, PANEL, 3), PAPER, np.float32)
    return with_text(foot, text, (20.0, PANEL / 2), height=LETTER_HEIGHT, color=LETTERS)


def legend(top: float) -> NDArray[np.float32]:
    """(FOOT, PANEL, 3) float32 linear light: the scale of distortion, its ends and what they mean."""
    foot = np.full((FOOT, PANEL, 3), PAPER, np.float32)
    left, right = PANEL // 4, PANEL * 3 // 4
    foot[BAR, left:right] = heat_colors(np.linspace(-1.0, 1.0, right - left))
    words, ends = (BAR.start + BAR.stop) / 2.0 - 1.0, BAR.stop + 13.0
    for text, row, column in (
        ("smaller", words, left - 52.0),
        ("larger", words, right + 48.0),
        (f"{top:g}", ends, left),
        ("1", ends, PANEL / 2),
        (f"{top:g}", ends, right),
    ):
        foot = with_text(foot, text, (row, column), height=LETTER_HEIGHT, color=LETTERS)
    return foot
