"""Texture files of flexpara's own naming: `<stem>_<map>.png` or `.exr`, one a map."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

from .images import write_texture

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from ..bakemap import BakeMap
    from ..texture import FileType, Texture

WRITERS = 2
"""Files encoded at once: each holds a whole image in memory."""


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
