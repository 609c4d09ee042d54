"""Baking: one context, one G-buffer, every map a function of it; then gutters; files last.

h w texels, row 0 = top.  `bake` makes Textures in memory, `write_textures` makes files of them.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from ..runtime.errors import InputError
from .context import open_context
from .gbuffer import GBuffer, rasterize
from .gutter import Gutter, find_gutter
from .images import Texture, write_texture
from .maps import BakeMap, NormalFormat, find_map

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from ..runtime.mesh import Asset, Atlas
    from .images import FileType

WRITERS = 2
"""Files encoded at once: each holds a whole image in memory."""


def bake(
    atlas: Atlas,
    asset: Asset,
    maps: Sequence[str | BakeMap],
    *,
    size: int | None = None,
    padding: int | None = None,
    normal_format: NormalFormat = "opengl",
    progress: Callable[[str], None] | None = None,
) -> dict[str, Texture]:
    """Bake maps of an atlas.

    Args:
        atlas: what is drawn; its faces are those of `asset`, in the same order.
        asset: source of colours, normals and textures.
        maps: names (see `maps.MAP_NAMES`) or maps of one's own; the order is kept.
        size: texels per side; the atlas' own unless given.
        padding: texels of gutter around the charts; None fills the whole image.
        normal_format: green channel of the tangent-space normal map, opengl (+Y) or directx (−Y).
        progress: called with each map's name before it is made.

    Returns: name → Texture, linear float32 pixels (size, size, c).

    Raises: InputError for an unknown map, a size or uv that cannot be drawn, a map that lacks its source;
        MissingDependencyError without OpenGL.
    """
    chosen = [find_map(entry, normal_format=normal_format) if isinstance(entry, str) else entry for entry in maps]
    if not chosen:
        return {}
    gbuffer = make_gbuffer(atlas, size if size is not None else atlas.size)
    gutter = find_gutter(gbuffer.face >= 0, padding)
    textures: dict[str, Texture] = {}
    for entry in chosen:
        if progress is not None:
            progress(entry.name)
        textures[entry.name] = bake_map(entry, gbuffer, gutter, atlas, asset)
    return textures


def make_gbuffer(atlas: Atlas, size: int) -> GBuffer:
    """Rasterize in a context of its own.  Raises as `open_context` and `rasterize`."""
    if size < 1:
        raise InputError(f"size {size}: expected 1 texel or more per side; pass size=, for instance 2048")
    with open_context() as context:
        return rasterize(context, atlas, size)


def bake_map(entry: BakeMap, gbuffer: GBuffer, gutter: Gutter, atlas: Atlas, asset: Asset) -> Texture:
    """One map: compute, background, gutter.

    Raises: InputError when the function returns another shape than (h, w, 1 to 4).
    """
    pixels = entry.compute(gbuffer, atlas, asset)
    if pixels.ndim != 3 or pixels.shape[:2] != gbuffer.shape or not 1 <= pixels.shape[2] <= 4:
        raise InputError(f"map {entry.name}: its function returned {pixels.shape}; expected (*{gbuffer.shape}, 1 to 4)")
    pixels = np.asarray(pixels, np.float32)
    if not entry.everywhere:
        pixels = gutter.fill(pixels, np.asarray((*entry.background, 1.0)[: pixels.shape[2]], np.float32))
    metadata = {"map": entry.name, "space": entry.space, "units": entry.units, "range": entry.value_range}
    return Texture(pixels, entry.encoding, entry.bits, entry.file_type, entry.dither, metadata)


def texture_names(
    textures: Mapping[str, Texture | BakeMap], stem: str, *, file_type: FileType | None = None
) -> dict[str, str]:
    """Map → file name `<stem>_<map>.png|exr`, known before anything is baked.

    file_type overrules the maps' own where they can be stored that way.
    """
    endings = {name: _ending(texture, file_type) for name, texture in textures.items()}
    return {name: f"{stem}_{name}.{ending}" for name, ending in endings.items()}


def write_textures(
    textures: Mapping[str, Texture], folder: Path, stem: str, *, file_type: FileType | None = None
) -> list[Path]:
    """Write all textures into an existing folder; the paths, in the order of the maps.

    Files are not staged here: the caller hands a folder that may hold a part of them when this fails.
    Raises: EncodingError as `images.write_texture`.
    """
    names = texture_names(textures, stem, file_type=file_type)
    paths = [folder / names[name] for name in textures]
    with ThreadPoolExecutor(WRITERS) as pool:
        list(pool.map(write_texture, textures.values(), paths))  # list: waits, and raises what was raised
    return paths


def _ending(texture: Texture | BakeMap, file_type: FileType | None) -> FileType:
    """The file type asked for, but EXR for what a PNG cannot hold."""
    if texture.encoding == "linear":
        return "exr"
    return file_type or texture.file_type
