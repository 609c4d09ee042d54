"""Baking: one context, one G-buffer, every map a function of it; then gutters; files last.

h w texels, row 0 = top · t texels of one call.  `bake` makes Textures in memory, files/textures.py makes files of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from ..runtime.errors import InputError
from .closing import ClosingConfig, closed_seams
from .maps.catalogue import find_map
from .maps.surface import SurfaceFunction, function_map, surface_alone
from .raster.gutter import check_padding, fill_gutters
from .raster.layout import check_size
from .raster.plan import Plan, open_rasterizer
from .seams import agrees_across_seams, find_seams, sample_seams, seam_error
from .texture import Texture
from .windows import background_of, blank_gbuffer, computed, map_windows, put_together

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ..runtime.mesh import Asset, Atlas
    from .bakemap import BakeMap, NormalFormat
    from .raster.plan import Device


def bake(
    atlas: Atlas,
    asset: Asset | Mapping[str, SurfaceFunction],
    maps: Sequence[str | BakeMap] | Mapping[str, SurfaceFunction] | None = None,
    *,
    size: int | None = None,
    padding: int | None = None,
    samples: int = 1,
    normal_format: NormalFormat = "opengl",
    device: Device = "auto",
    limit: int | None = None,
    tile: tuple[int, int] | None = None,
    scratch: Path | None = None,
    progress: Callable[[str], None] | None = None,
    warn: Callable[[str], None] | None = None,
) -> dict[str, Texture]:
    """Bake maps of an atlas, or functions of its surface: `bake(atlas, {"mymap": f})`.

    Args:
        atlas: what is drawn; its faces are those of `asset`, in the same order.
        asset: source of colours, normals and textures; may be left out where maps are functions.
        maps: names (see `maps.MAP_NAMES`) or maps of one's own; the order is kept.  Or name → function of positions
            (t, 3), unit normals (t, 3), both float32, and face numbers (t,) int64, which returns (t,) or (t, 1 to 4).
        size: texels per side; the atlas' own unless given.
        padding: texels of gutter around the charts; None fills the whole image.
        samples: 1, 4 or 16 per texel.
        normal_format: green channel of the tangent-space normal map, opengl (+Y) or directx (−Y).
        device: "auto", "opengl" or "software", see `tiles.open_rasterizer`.
        limit: the largest side drawn at once, in samples; what the device allows unless given.
        tile: the UDIM tile (a, b) to draw, see `udim.py`.
        scratch: a folder on whose disk the images are kept, in files without a name, instead of in memory: for 16k.
        progress: called with each map's name before it is made.
        warn: called with one line when OpenGL cannot be had and numpy draws instead.

    Returns: name → Texture, linear float32 pixels (size, size, c).

    Raises: InputError for an unknown map, a size or uv that cannot be drawn, a map that lacks its source;
        MissingDependencyError when "opengl" is asked for and cannot be had.
    """
    if isinstance(asset, Mapping):
        if maps is not None:
            raise InputError(
                "two collections of maps, expected one; pass bake(atlas, functions) or (atlas, asset, maps)"
            )
        atlas, asset, maps = replace(atlas, source_vertex=np.arange(len(atlas.positions))), surface_alone(atlas), asset
    chosen = find_maps(maps or (), normal_format=normal_format)
    if not chosen:
        return {}
    texels = atlas.size if size is None else size
    check_size(texels)
    check_padding(padding)
    plan = Plan(texels, samples, limit, tile)
    drawn = [entry for entry in chosen if not entry.everywhere]
    pixels: dict[str, NDArray[np.float32]] = {}
    if drawn:
        with open_rasterizer(atlas, plan, device=device, warn=warn) as (rasterizer, pieces):
            baked = map_windows(rasterizer, pieces, plan, drawn, atlas, asset, progress)
            pixels, covered, inside = put_together(baked, texels, scratch)
        images = [(pixels[entry.name], background_of(entry, pixels[entry.name])) for entry in drawn]
        fill_gutters(images, covered, padding)
        if padding != 0 and tile is None:
            close_seams(atlas, drawn, pixels, inside)
    for entry in (entry for entry in chosen if entry.everywhere):
        _announce(progress, entry.name)
        pixels[entry.name] = computed(entry, blank_gbuffer(texels), atlas, asset)
    return {entry.name: as_texture(entry, pixels[entry.name]) for entry in chosen}


def find_maps(
    maps: Sequence[str | BakeMap] | Mapping[str, SurfaceFunction], *, normal_format: NormalFormat = "opengl"
) -> list[BakeMap]:
    """Names, maps and functions → maps.  Raises: InputError for an unknown name."""
    if isinstance(maps, Mapping):
        return [function_map(name, function) for name, function in maps.items()]
    return [find_map(entry, normal_format=normal_format) if isinstance(entry, str) else entry for entry in maps]


def chart_labels(atlas: Atlas, size: int, padding: int | None) -> NDArray[np.int32]:
    """(size, size) int32 chart of each texel, gutters included, −1 beyond: what `seamcheck.clean_mip` takes."""
    labels = bake(atlas, {"chart": lambda _, __, face: atlas.face_chart[face] + 1}, size=size, padding=padding)
    return labels["chart"].pixels[..., 0].astype(np.int32) - 1


def close_seams(
    atlas: Atlas, entries: Sequence[BakeMap], pixels: Mapping[str, NDArray[np.float32]], inside: NDArray[np.bool_]
) -> None:
    """Where the two sides of seams differ visibly, move texels at the borders of charts, in place: see closing.py."""
    entries = [entry for entry in entries if agrees_across_seams(entry.name, entry.space)]
    seams = find_seams(atlas) if entries else np.zeros((0, 2, 2, 2))
    if len(seams) == 0:
        return
    samples, config = sample_seams(seams, len(inside)), ClosingConfig()
    for entry in entries:
        image, shown = pixels[entry.name], entry.value_range == "[0, 1]"
        error = seam_error(as_texture(entry, image), samples)
        if error is not None and error.maximum > config.visible:
            found = closed_seams(image, samples, inside, config, estimated=entry.estimated, measured=not shown)
            row, column = np.divmod(found[0], len(inside))
            low, high = {"[0, 1]": (0.0, 1.0), "[-1, 1]": (-1.0, 1.0)}.get(entry.value_range, (-np.inf, np.inf))
            image[row, column] = np.clip(found[1], low, high)


def as_texture(entry: BakeMap, pixels: NDArray[np.float32]) -> Texture:
    """Pixels with what the map says of them."""
    metadata = {"map": entry.name, "space": entry.space, "units": entry.units, "range": entry.value_range}
    return Texture(pixels, entry.encoding, entry.bits, entry.file_type, entry.dither, metadata)


def _announce(progress: Callable[[str], None] | None, name: str) -> None:
    if progress is not None:
        progress(name)
