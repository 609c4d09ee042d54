"""Charts on several pages as UDIM tiles: mesh files whose uv lie in them, and an image for each map and tile."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.io.asset.changes import told
from ...runtime.pack.packing import atlas_of_corners
from ...runtime.pack.pages import tile_corners
from ..checks import check_outputs, chosen_maps
from .meshes import MeshJob, write_meshes
from .output import BakeJob, bake_settings, baking, polygons_cut, written_notes
from .udim import udim_tiles

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.unwrap import Outputs
    from ...runtime.process.progress import Clock
    from ..texture import Texture


def write_tiles(output: OutputFolder, whole: BakeJob, pieces: Sequence[BakeJob], clock: Clock) -> dict[str, Any]:
    """Mesh files of the pieces and images of the whole; what the report says of them.

    whole: its uv in their tiles.  pieces: meshes that it is made of, files of their own with one set of textures.
    Raises: InputError for formats and options that know no tiles; as `udim.udim_tiles`.
    """
    from .udim import udim_names, write_udim

    for piece in pieces:
        piece.outputs.for_tiles()
    kind, stem, tiles = whole.outputs.texture_format, whole.asset.stem, udim_tiles(whole.atlas)
    maps = {entry.name: entry for entry in whole.maps}
    named = [file for number in tiles for file in udim_names(maps, stem, number, file_type=kind).values()]
    meshes = [f"{piece.asset.stem}.{ending}" for piece in pieces for ending in piece.outputs.formats]
    check_outputs(output, replace(whole.outputs, report=False), [], meshes=False, more=[*named, *meshes])
    baked = baked_tiles(whole, clock)
    files = udim_names(maps, stem, file_type=kind)
    output.write_several(lambda folder: write_udim(baked, folder, stem, file_type=kind) if maps else [])
    written: dict[str, Any] = {}
    with clock.stage("write"):
        for piece in pieces:
            facts = write_meshes(output, MeshJob(piece.atlas, piece.asset, piece.outputs, {}, files))
            prefix = f"{piece.asset.stem}." if len(pieces) > 1 else ""
            written |= {f"{prefix}{ending}": found for ending, found in facts.items()}
    facts = {"outputs": whole.outputs.facts(), "written": written, "tiles": tiles, "textures": {"files": files}}
    return {**facts, "polygons_cut": polygons_cut(pieces)}


def tile_notes(facts: Mapping[str, Any], stem: str) -> list[str]:
    """What a user should know of written tiles: a line each."""
    tiles, cut = facts["tiles"], told({"polygons_cut": facts["polygons_cut"]})
    found = (f"tiles {tiles[0]} to {tiles[-1]}", *cut, *written_notes(facts["written"]))
    return [f"{stem}: {fact}" for fact in found]


def tiled_job(asset: Asset, tile: NDArray[np.int64], atlases: Sequence[Atlas], outputs: Outputs, seed: int) -> BakeJob:
    """What is baked and written of a mesh whose faces lie in tiles (f,): those of an atlas each, in their order."""
    corner_uv, chart, first = np.zeros((len(tile), 3, 2), np.float32), np.zeros(len(tile), np.int64), 0
    for number, atlas in enumerate(atlases):
        own = tile == number
        corner_uv[own], chart[own] = atlas.uv[atlas.faces] + tile_corners(number), atlas.face_chart + first
        first += int(atlas.face_chart.max(initial=-1)) + 1
    outputs = replace(outputs.for_asset(asset), preview=False)
    like = replace(atlases[0], placement=None)
    return BakeJob.of(atlas_of_corners(asset, chart, corner_uv, like), asset, outputs, chosen_maps(outputs, seed=seed))


def baked_tiles(job: BakeJob, clock: Clock) -> dict[int, dict[str, Texture]]:
    """Tile number → name → Texture; none where nothing is baked.  Raises: as `udim.bake_udim`."""
    from .udim import bake_udim

    if not job.maps:
        return {}
    with baking(clock, len(job.maps) * len(udim_tiles(job.atlas))) as begun:
        return bake_udim(job.atlas, job.asset, list(job.maps), bake_settings(job), progress=begun)
