"""Seams closed in the images of an atlas: one image, or a tile each, whose charts meet on the surface.

h w texels · c channels · f faces.  Tiles are laid into one tall page, a row of texels between them that repeats their
rims, so that a seam between two tiles is a seam like any other.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..texture import as_texture
from .closing import ClosingConfig, closed_seams
from .seamcheck import agrees_across_seams, find_seams, page_of, sample_seams, seam_error

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas
    from ..bakemap import BakeMap

RIM = 1
"""Rows above and below each tile."""


class Drawn(NamedTuple):
    """Images of one tile: map → (h, w, c), gutters filled; the texels (h, w) bool whose centres lie in a chart.

    tile: the square of uv [a, a + 1] × [b, b + 1].
    """

    images: dict[str, NDArray[np.float32]]
    inside: NDArray[np.bool_]
    tile: tuple[int, int] = (0, 0)


def close_seams(atlas: Atlas, entries: Sequence[BakeMap], tiles: Sequence[Drawn]) -> None:
    """Where the two sides of seams differ visibly, move texels at the borders of charts, in place: see closing.py.

    atlas: its uv in the tiles.  entries: maps that all of them have.
    """
    entries = [entry for entry in entries if agrees_across_seams(entry.name, entry.space)]
    if not entries or not tiles:
        return
    page = page_of(tiles[0].inside)
    whole = atlas if len(tiles) == 1 else on_tall_page(atlas, [one.tile for one in tiles], page.height)
    seams = find_seams(whole) if len(whole.faces) else np.zeros((0, 2, 2, 2))
    if len(seams) == 0:
        return
    inside = stacked([one.inside for one in tiles])
    samples, config = sample_seams(seams, page_of(inside)), ClosingConfig()
    for entry in entries:
        images = [one.images[entry.name] for one in tiles]
        image, shown = stacked(images), entry.value_range == "[0, 1]"
        error = seam_error(as_texture(entry, image), samples)
        if error is None or error.maximum <= config.visible:
            continue
        found = closed_seams(image, samples, inside, config, estimated=entry.estimated, measured=not shown)
        row, column = np.divmod(found[0], page.width)
        low, high = {"[0, 1]": (0.0, 1.0), "[-1, 1]": (-1.0, 1.0)}.get(entry.value_range, (-np.inf, np.inf))
        image[row, column] = np.clip(found[1], low, high)
        for number, part in enumerate(images if len(images) > 1 else ()):
            start = number * (page.height + 2 * RIM) + RIM
            part[...] = image[start : start + page.height]


def stacked(images: Sequence[NDArray[np.generic]]) -> NDArray:
    """Images (h, w, …) one under the other, the rows at their rims repeated; a single one as it is."""
    if len(images) == 1:
        return images[0]
    return np.concatenate([np.pad(one, ((RIM, RIM), *((0, 0),) * (one.ndim - 1)), mode="edge") for one in images])


def on_tall_page(atlas: Atlas, tiles: Sequence[tuple[int, int]], height: int) -> Atlas:
    """The faces that lie in one of the tiles, their uv on the page of all of them."""
    corner = atlas.corner_uv
    square = np.floor(corner.mean(axis=1)).astype(np.int64)
    local = corner - square[:, None]
    number = np.full(len(corner), -1)
    for place, tile in enumerate(tiles):
        number[(square == tile).all(axis=1) & (local >= 0.0).all(axis=(1, 2)) & (local <= 1.0).all(axis=(1, 2))] = place
    tall = len(tiles) * (height + 2 * RIM)
    down = number[:, None] * (height + 2 * RIM) + RIM + (1.0 - local[..., 1]) * height
    kept = np.flatnonzero(number >= 0)
    used, faces = np.unique(atlas.faces[kept], return_inverse=True)
    uv = np.zeros((len(atlas.positions), 2))
    uv[atlas.faces[kept]] = np.stack([local[..., 0], 1.0 - down / tall], axis=-1)[kept]
    return replace(
        atlas,
        positions=atlas.positions[used],
        normals=atlas.normals[used],
        uv=uv[used],
        faces=faces.reshape(-1, 3).astype(np.int64),
        face_chart=atlas.face_chart[kept],
        source_vertex=atlas.source_vertex[used],
    )
