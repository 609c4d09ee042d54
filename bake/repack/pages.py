"""Islands on several pages: as UDIM tiles, or each page with a material and textures of its own.   f faces."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import InputError
from ...runtime.io.asset.pages import part_of
from ...runtime.pack.packing import atlas_of_corners
from ...runtime.pack.pages import tile_corners
from ..results.output import with_cut
from ..results.pages import check_pages, page_jobs, page_notes, write_pages
from ..results.tiles import tile_notes, write_tiles

if TYPE_CHECKING:
    from collections.abc import Callable

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.pack import PackOutputs
    from ...runtime.process.progress import Clock
    from .repacked import PackResult


def write_on_tiles(
    result: PackResult, output: OutputFolder, outputs: PackOutputs, clock: Clock, note: Callable[[str], None]
) -> dict[str, Any]:
    """Meshes whose uv lie in UDIM tiles, and an image for each map and tile; the report.

    Raises: as `tiles.write_tiles`.
    """
    whole, pieces = result.jobs(replace(outputs, preview=False))
    report = {**result.report, **write_tiles(output, whole, pieces, clock)}
    for fact in tile_notes(report, result.asset.stem):
        note(fact)
    return with_cut(report)


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
    report = {**result.report, "outputs": shared.facts(), **write_pages(output, jobs, clock, apart=apart)}
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
        uv = result.atlas.uv[result.atlas.faces[own]] - tile_corners(number)
        found.append((page, atlas_of_corners(page, result.atlas.face_chart[own], uv, result.atlas)))
    return found
