"""UDIM: uv beyond the unit square, one image for each square that holds a chart.

The square of uv [a, a + 1] × [b, b + 1] has the number 1001 + a + 10 b, with a from 0 to 9 and b from 0.  Files are
named NAME.1001.png, and programs find them by NAME.<UDIM>.png.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import InputError
from ...runtime.options.keywords import from_keywords
from ...runtime.pack.pages import ACROSS
from ..baker import Part, bake_together, find_maps
from ..files.images import write_texture
from ..files.textures import texture_names
from ..settings import BakeSettings
from ..windows import Ground

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from ...runtime.mesh import Asset, Atlas
    from ..bakemap import BakeMap
    from ..texture import FileType, Texture

FIRST, UP = 1001, 100
"""Number of the first tile, rows."""
SLACK = 1e-4
"""How far a chart may reach into a neighbouring square (rounding of other tools) without being part of it."""


def udim_tiles(atlas: Atlas) -> list[int]:
    """Numbers of the tiles that hold a part of a face, ascending.

    Raises: InputError for uv that are not finite, below 0, or beyond 10 across or 100 up.
    """
    corner = atlas.corner_uv
    if not np.isfinite(corner).all():
        raise InputError("uv holds NaN or infinite values; expected UDIM uv from 0; unwrap the mesh anew")
    low, high = corner.min(axis=(0, 1), initial=0.0), corner.max(axis=(0, 1), initial=0.0)
    if low.min() < -SLACK or high[0] > ACROSS + SLACK or high[1] > UP + SLACK:
        raise InputError(
            f"uv span {low[0]:.4g} to {high[0]:.4g} across and {low[1]:.4g} to {high[1]:.4g} up;"
            f" expected 0 to {ACROSS} and 0 to {UP}, which UDIM can name; move the charts"
        )
    first = np.floor(corner.min(axis=1) + SLACK).astype(np.int64)
    last = np.maximum(np.ceil(corner.max(axis=1) - SLACK).astype(np.int64) - 1, first)
    tiles: set[int] = set()
    for a, b, c, d in np.unique(np.hstack([first, last]), axis=0).tolist():
        tiles.update(FIRST + x + ACROSS * y for x in range(a, c + 1) for y in range(b, d + 1))
    return sorted(tiles)


def tile_of(number: int) -> tuple[int, int]:
    """(a, b) of a tile number.  Raises: InputError below 1001 or beyond 2000."""
    if not FIRST <= number < FIRST + ACROSS * UP:
        raise InputError(f"UDIM tile {number}: expected {FIRST} to {FIRST + ACROSS * UP - 1}")
    return (number - FIRST) % ACROSS, (number - FIRST) // ACROSS


def bake_udim(
    atlas: Atlas,
    asset: Asset,
    maps: Sequence[str | BakeMap],
    settings: BakeSettings | None = None,
    *,
    progress: Callable[[str], None] = lambda _: None,
    **keywords: Any,
) -> dict[int, dict[str, Texture]]:
    """Tile number → name → Texture, as `baker.bake` with the same settings; seams between tiles are closed too.

    progress: called with each map's name before it is made, for each tile.
    Raises: as `udim_tiles` and `baker.bake`.
    """
    made, numbers = from_keywords(BakeSettings, settings, keywords), udim_tiles(atlas)
    chosen, ground = find_maps(maps, normal_format=made.normal_format), Ground(atlas, asset)
    tiles = [tile_of(number) for number in numbers]
    parts = [Part(ground, chosen, replace(made, tile=tile), tile) for tile in tiles]
    return dict(zip(numbers, bake_together(atlas, parts, progress), strict=True))


def udim_names(
    textures: Mapping[str, Texture | BakeMap],
    stem: str,
    number: int | str = "<UDIM>",
    *,
    file_type: FileType | None = None,
) -> dict[str, str]:
    """Map → file name `<stem>_<map>.1001.png`; without a number the name with the token that stands for all tiles."""
    parts = {name: file.rpartition(".") for name, file in texture_names(textures, stem, file_type=file_type).items()}
    return {name: f"{head}.{number}.{ending}" for name, (head, _, ending) in parts.items()}


def write_udim(
    tiles: Mapping[int, Mapping[str, Texture]], folder: Path, stem: str, *, file_type: FileType | None = None
) -> list[Path]:
    """Write all tiles into an existing folder; the paths.  Raises: EncodingError as `images.write_texture`."""
    paths: list[Path] = []
    for number, textures in tiles.items():
        for name, file in udim_names(textures, stem, number, file_type=file_type).items():
            paths.append(folder / file)
            write_texture(textures[name], paths[-1])
    return paths
