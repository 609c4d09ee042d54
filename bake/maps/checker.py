"""The uv test card: shows stretch, scale, orientation and mirroring wherever it lands on a surface.

16 × 16 labelled cells over [0, 1]², fewer along the shorter side of a page: letter = row from the bottom (v), number =
column from the left (u), so that "A1" is at the uv origin.
Hue runs with u, lightness with v; cells alternate light and dark, each holds 4 × 4 finer squares and an arrow along v.
No symmetry maps the card onto itself.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...runtime.pagesize import PageSize
from ..colors.color import linear_from_oklab
from ..colors.lettering import text_cover

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from ...runtime.mesh import Asset, Atlas
    from ...runtime.pagesize import Size
    from ..raster.gbuffer import GBuffer

CELLS = 16
DOTS = 64
"""Dots per cell side of the drawing of labels."""
LABEL, LABEL_ROW, ARROW_ROW = 22.0, 16, 45
"""Height of the font, and rows of a cell in whose middle the label and the arrow stand, in dots."""
FINE = 4


def uv_card(size: Size | PageSize) -> NDArray[np.float32]:
    """(h, w, 3) float32 linear light: the card sampled at texel centres, row 0 = top (v = 1)."""
    page = PageSize.of(size)
    # in cells: to the right, and upwards from the bottom
    across, up = (
        (np.arange(texels) + 0.5) / texels * max(round(CELLS * share), 1)
        for texels, share in zip(page, page.extent.tolist(), strict=True)
    )
    up = up[::-1]
    column, row = np.floor(across).astype(int), np.floor(up).astype(int)
    fine_column, fine_row = np.floor(across * FINE).astype(int), np.floor(up * FINE).astype(int)
    tone = (column[None, :] + row[:, None]) % 2 * 2 + (fine_column[None, :] + fine_row[:, None]) % 2
    dot_column, dot_row = np.floor(across * DOTS).astype(int), CELLS * DOTS - np.ceil(up * DOTS).astype(int)
    ink = _ink()[dot_row[:, None], dot_column[None, :]]
    tone[ink] = 4
    return _palette()[tone, row[:, None], column[None, :]]


def uv_checker_map(gbuffer: GBuffer, atlas: Atlas, asset: Asset) -> NDArray[np.float32]:
    """The test card of checker.py over the whole image.

    Space uv, linear light in [0, 1]; srgb, PNG 8 bits by default (3 channels).
    """
    del atlas, asset
    return uv_card(gbuffer.page)


def _palette() -> NDArray[np.float32]:
    """(5, 16, 16, 3) float32 linear light by tone, row, column.  Tones: two dark, two light, ink."""
    row, column = np.mgrid[0:CELLS, 0:CELLS] / (CELLS - 1)
    hue = 2.0 * np.pi * (0.08 + 0.84 * column)
    tones = []
    for lightness, chroma in ((0.50, 0.09), (0.53, 0.09), (0.80, 0.075), (0.83, 0.075)):
        level = lightness + 0.12 * (row - 0.5)
        tones.append(np.stack([level, chroma * np.cos(hue), chroma * np.sin(hue)], axis=-1))
    alternate = (np.indices((CELLS, CELLS)).sum(axis=0) % 2).astype(np.float64)
    ink = np.where(alternate == 0, 0.97, 0.22)
    tones.append(np.stack([ink, np.zeros_like(ink), np.zeros_like(ink)], axis=-1))
    return np.clip(linear_from_oklab(np.stack(tones)), 0.0, 1.0).astype(np.float32)


def _ink() -> NDArray[np.bool_]:
    """(16 · DOTS, 16 · DOTS) bool, row 0 = top: the label and the arrow of every cell."""
    ink = np.zeros((CELLS * DOTS, CELLS * DOTS), np.bool_)
    for row in range(CELLS):
        for column in range(CELLS):
            cell = ink[(CELLS - 1 - row) * DOTS : (CELLS - row) * DOTS, column * DOTS : (column + 1) * DOTS]
            _stamp(cell, text_cover(f"{chr(ord('A') + row)}{column + 1}", LABEL) > 0.5, LABEL_ROW)
            _stamp(cell, _arrow(), ARROW_ROW)
    return ink


def _stamp(cell: NDArray[np.bool_], mask: NDArray[np.bool_], row: int) -> None:
    """Set a mask into a cell, in place: its middle in that row and the cell's middle column."""
    top, left = row - mask.shape[0] // 2, (cell.shape[1] - mask.shape[1]) // 2
    cell[top : top + mask.shape[0], left : left + mask.shape[1]] |= mask


def _arrow() -> NDArray[np.bool_]:
    """(22, 15) bool: an arrow that points up, along v: a head of 45°, a shaft three dots wide."""
    row, column = np.mgrid[:22, -7:8]
    return (np.abs(column) <= row) & ((np.abs(column) <= 1) | (row <= 7) & (np.abs(column) >= row - 2))
