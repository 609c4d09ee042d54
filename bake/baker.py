"""Baking: one context, one G-buffer, every map a function of it; then gutters; files last.

h w texels, row 0 = top · t texels of one call.  `bake` makes Textures in memory, files/textures.py makes files of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..runtime.errors import InputError
from ..runtime.options.keywords import from_keywords
from ..runtime.pagesize import PageSize
from .denoise import check_denoiser, denoised
from .maps.catalogue import find_map
from .maps.surface import SurfaceFunction, function_map, surface_alone
from .raster.gutter import check_padding, fill_gutters
from .raster.layout import check_size
from .raster.plan import Plan, open_rasterizer
from .seams.across import Drawn, close_seams
from .settings import BakeSettings
from .texture import as_texture
from .windows import Ground, background_of, blank_gbuffer, computed, map_windows, put_together

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from ..runtime.mesh import Asset, Atlas
    from ..runtime.pagesize import Size
    from .bakemap import BakeMap, NormalFormat
    from .texture import Texture


class Part(NamedTuple):
    """What one image of several shows, and the tile (a, b) that it is among them."""

    ground: Ground
    maps: Sequence[BakeMap]
    settings: BakeSettings
    tile: tuple[int, int]


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

    Returns: name → Texture, linear float32 pixels (h, w, c).

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
    chosen = find_maps(maps or (), normal_format=settings.normal_format)
    if not chosen:
        return {}
    drawn = draw(Ground(atlas, asset), chosen, settings, progress or (lambda _: None), warn)
    if settings.padding != 0 and settings.tile is None:
        close_seams(atlas, drawn_maps(chosen), [drawn])
    return as_textures(chosen, drawn)


def bake_together(
    atlas: Atlas, parts: Sequence[Part], progress: Callable[[str], None] = lambda _: None
) -> list[dict[str, Texture]]:
    """As `bake` for parts of one surface, each in a tile of its own; seams between them are closed too.

    atlas: all of them, its uv in their tiles.
    """
    drawn = [draw(part.ground, part.maps, part.settings, progress)._replace(tile=part.tile) for part in parts]
    if all(part.settings.padding != 0 for part in parts):
        common = [entry for entry in drawn_maps(parts[0].maps) if all(entry.name in one.images for one in drawn)]
        close_seams(atlas, common, drawn)
    return [as_textures(part.maps, one) for part, one in zip(parts, drawn, strict=True)]


def draw(
    ground: Ground,
    chosen: Sequence[BakeMap],
    settings: BakeSettings,
    progress: Callable[[str], None],
    warn: Callable[[str], None] | None = None,
) -> Drawn:
    """All maps of one tile, gutters filled, seams not closed yet.  Raises: as `bake`."""
    page = PageSize.of(ground.atlas.size if settings.size is None else settings.size)
    check_size(page)
    check_padding(settings.padding)
    if settings.denoise:
        check_denoiser()
    images, inside = dict[str, "NDArray[np.float32]"](), np.zeros(page.shape, np.bool_)
    if shown := drawn_maps(chosen):
        images, inside = draw_maps(ground, shown, page, settings, progress, warn)
    for entry in (entry for entry in chosen if entry.everywhere):
        progress(entry.name)
        images[entry.name] = computed(entry, blank_gbuffer(page), ground)
    return Drawn(images, inside, settings.tile or (0, 0))


def drawn_maps(maps: Sequence[BakeMap]) -> list[BakeMap]:
    """Those that show the surface."""
    return [entry for entry in maps if not entry.everywhere]


def as_textures(maps: Sequence[BakeMap], drawn: Drawn) -> dict[str, Texture]:
    """Name → Texture."""
    return {entry.name: as_texture(entry, drawn.images[entry.name]) for entry in maps}


def draw_maps(
    ground: Ground,
    maps: Sequence[BakeMap],
    page: PageSize,
    settings: BakeSettings,
    progress: Callable[[str], None],
    warn: Callable[[str], None] | None,
) -> tuple[dict[str, NDArray[np.float32]], NDArray[np.bool_]]:
    """Name → image (h, w, c) of maps that show the surface, gutters filled; and the texels (h, w) inside of it."""
    plan = Plan(page, settings.samples, settings.limit, settings.tile)
    with open_rasterizer(ground.atlas, plan, device=settings.device, warn=warn) as (rasterizer, pieces):
        baked = map_windows(rasterizer, pieces, plan, maps, ground, progress)
        pixels, covered, inside = put_together(baked, page, settings.scratch)
    images = [(pixels[entry.name], background_of(entry, pixels[entry.name])) for entry in maps]
    fill_gutters(images, covered, settings.padding)
    if settings.denoise and any(entry.estimated for entry in maps):
        for entry in (entry for entry in maps if entry.estimated):
            pixels[entry.name][covered] = denoised(entry, pixels[entry.name], covered)[covered]
        fill_gutters(images, covered, settings.padding)
    return pixels, inside


def find_maps(
    maps: Sequence[str | BakeMap] | Mapping[str, SurfaceFunction], *, normal_format: NormalFormat = "opengl"
) -> list[BakeMap]:
    """Names, maps and functions → maps.  Raises: InputError for an unknown name."""
    if isinstance(maps, Mapping):
        return [function_map(name, function) for name, function in maps.items()]
    return [find_map(entry, normal_format=normal_format) if isinstance(entry, str) else entry for entry in maps]


def chart_labels(atlas: Atlas, size: Size, padding: int | None) -> NDArray[np.int32]:
    """(h, w) int32 chart of each texel, gutters included, −1 beyond: what `seamcheck.clean_mip` takes."""
    labels = bake(atlas, {"chart": lambda _, __, face: atlas.face_chart[face] + 1}, size=size, padding=padding)
    return labels["chart"].pixels[..., 0].astype(np.int32) - 1
