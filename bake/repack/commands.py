"""The command that packs the islands meshes have.  Options in, one call, files and summary out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ...runtime.cli.console import Console, Manners
from ...runtime.cli.inputs import meshes_of
from ...runtime.errors import InputError
from ...runtime.extras import requires
from ...runtime.options.pack import PackOptions, PackOutputs
from ...runtime.options.unwrap import Output
from ...runtime.process.progress import Clock
from ..checks import padding_of

PAGE = Parameter(name="*", group="Islands and page")
FILES = Parameter(name="*", group="Maps and files")


def pack(
    *mesh: Path,
    output: Output,
    options: Annotated[PackOptions, PAGE] = PackOptions(),
    outputs: Annotated[PackOutputs, FILES] = PackOutputs(),
    console: Manners = Console(),
) -> int:
    """Pack the islands that meshes have into one page; their shapes stay, and textures move with them.

    Args:
        mesh: Meshes with uv, or folders of meshes; the islands of several share the page and its textures.
        output: The folder for the meshes with new uv, STEM_MAP.png or .exr, and STEM.report.json; STEM is "packed" for
            several meshes.
        options: See PackOptions.
        outputs: See PackOutputs.
        console: See Console.
    """
    if not mesh:
        raise InputError("MESH is missing, expected a mesh with uv; see flexpara pack --help")
    light = outputs.uv_set is not None
    options = replace(options, padding=padding_of(options.padding, outputs.target, options.page.side, light=light))
    from ...runtime.files import OutputFolder
    from ...runtime.io.asset.changes import lost, told
    from ...runtime.io.asset.shading import shaded
    from ...runtime.io.meshfile import load

    with requires("bake"):
        from .repacked import TOGETHER, pack_assets
    paths = meshes_of(mesh)
    assets = [shaded(load(path, options.select), options.crease_angle) for path in paths]
    endings = [options.ending(path.suffix) for path in paths]
    losses = [lost(asset, outputs.for_mesh(asset, ending)) for asset, ending in zip(assets, endings, strict=True)]
    for asset, loss in zip(assets, losses, strict=True):
        console.note_changes(asset, loss)
    stem = assets[0].stem if len(assets) == 1 else TOGETHER
    with OutputFolder(output, stem, force=console.force, source=paths[0]) as folder, console.progress() as progress:
        clock = Clock(progress)
        result = pack_assets(assets, endings, options, outputs.uv_set, clock)
        console.demand_none(stem, told(result.report["pack"]["changes"]))
        written = result.write(folder, outputs, clock, console.note)
    console.show(result.report["metrics"], written)
    return 0
