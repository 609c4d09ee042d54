"""The command that bakes onto the uv a mesh already has.  Options in, one call, files and summary out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from .. import __version__
from ..runtime.console import Flag, Output, names, show
from ..runtime.errors import InputError
from ..runtime.options import Options, Outputs
from ..runtime.progress import Clock, progress_bars
from .output import check_maps, check_outputs, write_textures


def bake(
    mesh: Path,
    *,
    output: Output,
    maps: str = "position,normal",
    size: int = 2048,
    padding: int | None = None,
    texture_format: Literal["png", "exr"] | None = None,
    normal_format: Literal["opengl", "directx"] = "opengl",
    quiet: Flag = False,
    force: Flag = False,
) -> int:
    """Bake maps onto the uv that a mesh already has, whoever made it.

    Args:
        mesh: a mesh with uv
        output: folder for STEM_MAP.png or .exr, and STEM.bake.json, which lists them
        maps: comma-separated; auto: normal, position, and the source's colours or else a checker
        size: side, texels
        padding: texels of gutter around each chart (default: size / 256, at least 2)
        texture_format: of all maps that can be stored so (default: each map's own)
        normal_format: green channel of the normal map: opengl (+Y) or directx (-Y)
        quiet: no progress, no summary
        force: overwrite files that flexpara did not write
    """
    options = Options(size=size, padding=padding)
    outputs = Outputs(names(maps), texture_format=texture_format, normal_format=normal_format, preview=False)
    if not outputs.maps:
        raise InputError("maps is none, expected at least one; pass for instance --maps normal")
    check_maps(outputs.maps)
    from ..runtime.files import OutputFolder
    from ..runtime.meshfile import load
    from ..runtime.packing import atlas_from_uv

    asset = load(mesh)
    outputs, atlas = outputs.for_asset(asset), atlas_from_uv(asset)
    with OutputFolder(output, asset.stem, force=force, source=mesh, report=f"{asset.stem}.bake.json") as folder:
        check_outputs(folder, outputs, size, meshes=False)
        with progress_bars(quiet=quiet) as progress:
            write_textures(folder, replace(atlas, size=size), asset, outputs, options.margin, Clock(progress))
        settings = {"maps": outputs.maps, "size": size, "padding": options.margin}
        folder.write_report({"version": __version__, "source": {"sha256": asset.sha256}, "settings": settings})
        written = folder.commit()
    if not quiet:
        show({}, written)
    return 0
