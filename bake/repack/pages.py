"""Islands on several pages: as UDIM tiles, or each page with a material and textures of its own.   f faces."""

from __future__ import annotations

from dataclasses import asdict, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import InputError
from ...runtime.io.asset.pages import part_of
from ...runtime.options.unwrap import SCENES
from ...runtime.pack.packing import atlas_of_corners
from ...runtime.pack.pages import ACROSS
from ..checks import check_outputs
from ..results.meshes import MeshJob, write_meshes
from ..results.output import gutter_of
from ..results.pages import check_pages, page_jobs, page_notes, write_pages

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.pack import PackOutputs
    from ...runtime.progress import Clock
    from ..results.output import BakeJob
    from .repacked import PackResult


def write_on_tiles(
    result: PackResult, output: OutputFolder, outputs: PackOutputs, clock: Clock, note: Callable[[str], None]
) -> dict[str, Any]:
    """Meshes whose uv lie in UDIM tiles, and an image for each map and tile; the report.

    Raises: InputError for formats and options that know no tiles.
    """
    from ..results.udim import udim_names, udim_tiles, write_udim

    whole, pieces = result.jobs(replace(outputs, preview=False))
    _refuse_untiled(whole, pieces)
    kind, stem, tiles = whole.outputs.texture_format, result.asset.stem, udim_tiles(result.atlas)
    maps = {entry.name: entry for entry in whole.maps}
    named = [file for number in tiles for file in udim_names(maps, stem, number, file_type=kind).values()]
    meshes = [f"{piece.asset.stem}.{ending}" for piece in pieces for ending in piece.outputs.formats]
    check_outputs(output, replace(whole.outputs, report=False), [], meshes=False, more=[*named, *meshes])
    baked = _baked_tiles(whole, clock)
    files = udim_names(maps, stem, file_type=kind)
    output.write_several(lambda folder: write_udim(baked, folder, stem, file_type=kind) if maps else [])
    written: dict[str, Any] = {}
    with clock.stage("write"):
        for piece in pieces:
            facts = write_meshes(output, MeshJob(piece.atlas, piece.asset, piece.outputs, {}, files))
            prefix = f"{piece.asset.stem}." if len(pieces) > 1 else ""
            written |= {f"{prefix}{ending}": found for ending, found in facts.items()}
    note(f"{stem}: tiles {tiles[0]} to {tiles[-1]}")
    facts = {"outputs": asdict(whole.outputs), "written": written, "tiles": tiles, "textures": {"files": files}}
    return {**result.report, **facts}


def _baked_tiles(job: BakeJob, clock: Clock) -> dict[int, Any]:
    from ..results.udim import bake_udim

    if not job.maps:
        return {}
    with clock.stage("bake"):
        asked = {"size": job.atlas.size, "samples": job.outputs.samples, "denoise": job.outputs.denoise}
        return bake_udim(job.atlas, job.asset, list(job.maps), padding=gutter_of(job.atlas, job.outputs), **asked)


def _refuse_untiled(whole: BakeJob, pieces: list[BakeJob]) -> None:
    """Raises: InputError for what knows no UDIM."""
    found = sorted({kind for piece in pieces for kind in piece.outputs.formats} & set(SCENES))
    if found:
        raise InputError(
            f"format {', '.join(found)} with udim, which glTF does not know, expected obj, ply, usda or npz; pass for "
            "instance --format obj, or leave --udim out"
        )
    if whole.outputs.layers or whole.outputs.target is not None or whole.outputs.report:
        raise InputError("udim with layers, a target or report, expected none of them; leave them out")


def write_on_pages(
    result: PackResult, output: OutputFolder, outputs: PackOutputs, clock: Clock, note: Callable[[str], None]
) -> dict[str, Any]:
    """One glb or gltf file, in which each page has a material and textures of its own; the report.

    Raises: InputError for several meshes, and formats that hold one atlas.
    """
    from ..files.gltfmade import with_document

    if len(result.assets) > 1:
        raise InputError(f"{len(result.assets)} meshes on several pages, expected one mesh, or UDIM tiles; add --udim")
    shared = outputs.for_mesh(result.asset, result.suffixes[0])
    shared = replace(shared, preview=False if shared.preview is None else shared.preview)
    pages = pages_with_atlases(replace(result, asset=with_document(result.asset)))
    check_pages(output, shared, [page for page, _ in pages])
    jobs = page_jobs(shared, pages, result.report["settings"]["seed"])
    apart = result.report["metrics"]["overlap_fraction"] == 0.0
    report = {**result.report, "outputs": asdict(shared), **write_pages(output, jobs, clock, apart=apart)}
    for fact in page_notes(report):
        note(fact)
    return report


def pages_with_atlases(result: PackResult) -> list[tuple[Asset, Atlas]]:
    """Each page as a mesh of its own, STEM_1, STEM_2, …, with its atlas in the unit square."""
    assert result.page is not None
    found: list[tuple[Asset, Atlas]] = []
    for number in np.unique(result.page).tolist():
        own = result.page == number
        page = part_of(result.asset, own, f"{result.asset.stem}_{number + 1}")
        uv = result.atlas.uv[result.atlas.faces[own]] - np.array([number % ACROSS, number // ACROSS], np.float32)
        found.append((page, atlas_of_corners(page, result.atlas.face_chart[own], uv, result.atlas)))
    return found
