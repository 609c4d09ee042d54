"""Baking: one context, one G-buffer, every map a function of it; then gutters; files last.

h w texels, row 0 = top · t texels of one call.  `bake` makes Textures in memory, files/textures.py makes files of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..runtime.errors import InputError
from ..runtime.options.keywords import from_keywords
from .denoise import check_denoiser, denoised
from .maps.catalogue import find_map
from .maps.surface import SurfaceFunction, function_map, surface_alone
from .raster.gutter import check_padding, fill_gutters
from .raster.layout import check_size
from .raster.plan import Plan, open_rasterizer
from .seams.closing import ClosingConfig, closed_seams
from .seams.seamcheck import agrees_across_seams, find_seams, sample_seams, seam_error
from .settings import BakeSettings
from .texture import Texture
from .windows import Ground, background_of, blank_gbuffer, computed, map_windows, put_together

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ..runtime.mesh import Asset, Atlas
    from .bakemap import BakeMap, NormalFormat


def bake(
    atlas: Atlas,
    asset: Asset | Mapping[str, SurfaceFunction],
    maps: Sequence[str | BakeMap] | Mapping[str, SurfaceFunction] | None = None,
    settings: BakeSettings | None = None,
    *,
    progress: Callable[[str], None] | None = None,
    warn: Callable[[str], None] | None = None,
    **keywords: Any,
) -> dict[str, Texture]:
    """Bake maps of an atlas, or functions of its surface: `bake(atlas, {"mymap": f}, size=1024)`.

    Args:
        atlas: what is drawn; its faces are those of `asset`, in the same order.
        asset: source of colours, normals and textures; may be left out where maps are functions.
        maps: names (see `catalogue.MAP_NAMES`) or maps of one's own; the order is kept.  Or name → function of
            positions (t, 3), unit normals (t, 3), both float32, and face numbers (t,) int64, which returns (t,) or
            (t, 1 to 4).
        settings: see `BakeSettings`; None is its defaults.
        progress: called with each map's name before it is made.
        warn: called with one line when OpenGL cannot be had and numpy draws instead.
        **keywords: fields of `BakeSettings`, in place of those of settings: size=1024, padding=8, …

    Returns: name → Texture, linear float32 pixels (size, size, c).

    Raises:
        InputError: an unknown map or keyword, a size or uv that cannot be drawn, a map that lacks its source.
        MissingDependencyError: "opengl" or the denoiser is asked for and cannot be had.
    """
    if isinstance(asset, Mapping):
        if maps is not None:
            raise InputError(
                "two collections of maps, expected one; pass bake(atlas, functions) or (atlas, asset, maps)"
            )
        atlas, asset, maps = replace(atlas, source_vertex=np.arange(len(atlas.positions))), surface_alone(atlas), asset
    settings = from_keywords(BakeSettings, settings, keywords)
    texels = atlas.size if settings.size is None else settings.size
    chosen = find_maps(maps or (), normal_format=settings.normal_format)
    if not chosen:
        return {}
    check_size(texels)
    check_padding(settings.padding)
    if settings.denoise:
        check_denoiser()
    tell = progress or (lambda _: None)
    drawn = [entry for entry in chosen if not entry.everywhere]
    pixels = draw_maps(Ground(atlas, asset), drawn, texels, settings, tell, warn) if drawn else {}
    for entry in (entry for entry in chosen if entry.everywhere):
        tell(entry.name)
        pixels[entry.name] = computed(entry, blank_gbuffer(texels), Ground(atlas, asset))
    return {entry.name: as_texture(entry, pixels[entry.name]) for entry in chosen}


def draw_maps(
    ground: Ground,
    maps: Sequence[BakeMap],
    size: int,
    settings: BakeSettings,
    progress: Callable[[str], None],
    warn: Callable[[str], None] | None,
) -> dict[str, NDArray[np.float32]]:
    """Name → image (size, size, c) of maps that show the surface: drawn, gutters filled, seams closed."""
    plan = Plan(size, settings.samples, settings.limit, settings.tile)
    with open_rasterizer(ground.atlas, plan, device=settings.device, warn=warn) as (rasterizer, pieces):
        baked = map_windows(rasterizer, pieces, plan, maps, ground, progress)
        pixels, covered, inside = put_together(baked, size, settings.scratch)
    images = [(pixels[entry.name], background_of(entry, pixels[entry.name])) for entry in maps]
    fill_gutters(images, covered, settings.padding)
    if settings.denoise and any(entry.estimated for entry in maps):
        for entry in (entry for entry in maps if entry.estimated):
            pixels[entry.name][covered] = denoised(entry, pixels[entry.name], covered)[covered]
        fill_gutters(images, covered, settings.padding)
    if settings.padding != 0 and settings.tile is None:
        close_seams(ground.atlas, maps, pixels, inside)
    return pixels


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
