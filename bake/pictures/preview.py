"""The preview: one picture of the shape with a checkerboard through its uv, the uv layout, and the distortion.

f faces · k charts.  Colours are linear light until the file is written.  The same chart has the same colour left and
middle.
Right, red faces are larger in uv than their share of the surface, blue ones smaller; how deep the colour is says how
distorted the face is, whatever the kind of distortion.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import ShapeError
from ..color import chart_colors, linear_from_srgb
from ..files.images import write_png
from ..heat import distortion_scale, face_areas, heat_colors, signed_distortion
from ..raster.context import open_context
from ..raster.layout import border_edges
from ..texture import Texture
from .canvas import Camera, Lines, Shape, draw, three_quarter_axes
from .glyphs import ROWS, text_mask

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas

PANEL = 640
FOOT = 56
"""Pixels below each panel for its caption."""
PAPER = (0.93, 0.935, 0.94)
SHEET = (0.99, 0.99, 0.99)
INK = (0.02, 0.022, 0.03)
CHECKS = 26.0
"""Checker squares along the bounding box's diagonal."""


def render_preview(atlas: Atlas, face_distortion: NDArray[np.float64], path: Path) -> None:
    """Write the preview as an 8-bit sRGB PNG of three panels, 1920 × 696 pixels.

    Args:
        atlas: the finished atlas.
        face_distortion: (f,) symmetric Dirichlet per face, 1 = isometric; infinite where a face has collapsed.
        path: the PNG file.

    Raises: ShapeError for another number of values than faces; MissingDependencyError without OpenGL.
    """
    write_png(Texture(preview_pixels(atlas, face_distortion), "srgb", 8, "png"), path)


def preview_pixels(atlas: Atlas, face_distortion: NDArray[np.float64]) -> NDArray[np.float32]:
    """(696, 1920, 3) float32 linear light.  Arguments and errors as `render_preview`."""
    if face_distortion.shape != (len(atlas.faces),):
        raise ShapeError(f"face_distortion is {face_distortion.shape}; expected one value for {len(atlas.faces)} faces")
    top = distortion_scale(face_distortion)
    charts = int(atlas.face_chart.max()) + 1
    with open_context() as context:
        camera = Camera.fit(atlas.positions[atlas.faces].reshape(-1, 3), three_quarter_axes())
        seams = Lines(seam_segments(atlas, atlas.positions), INK, 1.6)
        checkered = solid(atlas, chart_colors(charts)[atlas.face_chart], cells=checker_cells(atlas))
        heated = solid(atlas, heat_colors(signed_distortion(atlas, face_distortion, top)))
        panels = [
            draw(context, camera, checkered, seams, pixels=PANEL, paper=PAPER),
            draw(context, *layout(atlas, chart_colors(charts)), pixels=PANEL, paper=PAPER),
            draw(context, camera, heated, Lines(seams.segments, INK, 1.0), pixels=PANEL, paper=PAPER),
        ]
    count = f"{charts} CHART" if charts == 1 else f"{charts} CHARTS"
    feet = [caption("CHECKER THROUGH THE NEW UV"), caption(f"UV LAYOUT - {count}"), legend(top)]
    return np.concatenate([np.concatenate(pair, axis=0) for pair in zip(panels, feet, strict=True)], axis=1)


def solid(atlas: Atlas, colors: NDArray[np.float32], *, cells: float = 0.0) -> Shape:
    """The surface in 3D with a colour per face."""
    faces = atlas.faces
    return Shape(atlas.positions[faces], atlas.normals[faces].astype(np.float64), atlas.corner_uv, colors, cells=cells)


def layout(atlas: Atlas, colors: NDArray[np.float32]) -> tuple[Camera, Shape, Lines]:
    """The uv square seen from above: white sheet, charts in their colours, their borders."""
    sheet = np.array([[[0, 0], [1, 0], [1, 1]], [[0, 0], [1, 1], [0, 1]]], np.float64)
    flat = np.concatenate([sheet, atlas.corner_uv])
    height = np.concatenate([np.zeros(2), np.ones(len(atlas.faces))])
    positions = np.dstack([flat, np.broadcast_to(height[:, None, None], (*flat.shape[:2], 1))])
    normals = np.broadcast_to(np.array([0.0, 0.0, 1.0]), positions.shape)
    tones = np.concatenate([np.full((2, 3), SHEET[0], np.float32), colors[atlas.face_chart]])
    border = seam_segments(atlas, np.column_stack([atlas.uv, np.ones(len(atlas.uv))]))
    square = np.array([[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]], np.float64)
    frame = np.stack([square, np.roll(square, -1, axis=0)], axis=1)
    camera = Camera.fit(np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 1.0]]), np.eye(3))
    return camera, Shape(positions, normals, flat, tones, lit=False), Lines(np.concatenate([border, frame]), INK, 1.2)


def seam_segments(atlas: Atlas, points: NDArray[np.floating]) -> NDArray[np.float64]:
    """(s, 2, 3) float64: ends of all chart borders, among points (n, 3) per atlas vertex."""
    face, corner = border_edges(atlas.faces, atlas.uv).T
    ends = np.stack([atlas.faces[face, corner], atlas.faces[face, (corner + 1) % 3]], axis=1)
    return points[ends].astype(np.float64)


def checker_cells(atlas: Atlas) -> float:
    """Checker squares per uv unit that make about `CHECKS` along the bounding box's diagonal."""
    surface, flat = face_areas(atlas)
    diagonal = float(np.linalg.norm(np.ptp(atlas.positions, axis=0)))
    density = np.sqrt(max(float(surface.sum()), 1e-300) / max(float(flat.sum()), 1e-300))
    return max(round(CHECKS * density / diagonal), 1) if diagonal > 0.0 else 1.0


def caption(text: str) -> NDArray[np.float32]:
    """(FOOT, PANEL, 3) float32 linear light: one line in the middle."""
    foot = np.full((FOOT, PANEL, 3), PAPER, np.float32)
    write_text(foot, text, PANEL // 2, 14)
    return foot


def legend(top: float) -> NDArray[np.float32]:
    """(FOOT, PANEL, 3) float32 linear light: the distortion scale with its ends."""
    foot = np.full((FOOT, PANEL, 3), PAPER, np.float32)
    left, right = PANEL // 4, PANEL * 3 // 4
    foot[16:26, left:right] = heat_colors(np.linspace(-1.0, 1.0, right - left))
    for text, middle in ((f"{top:g}", left), ("1", PANEL // 2), (f"{top:g}", right)):
        write_text(foot, text, middle, 32)
    write_text(foot, "SMALLER", left // 2 + 8, 14)
    write_text(foot, "LARGER", (right + PANEL) // 2 - 8, 14)
    return foot


def write_text(picture: NDArray[np.float32], text: str, middle: int, top: int) -> None:
    """Draw a line of text, 14 pixels high, into the picture (the one function here that changes its argument)."""
    mask = text_mask(text, scale=2)
    left = middle - mask.shape[1] // 2
    picture[top : top + 2 * ROWS, left : left + mask.shape[1]][mask] = linear_from_srgb(np.full(3, 0.30))
