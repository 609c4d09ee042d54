"""Several atlases of one scene: each page with textures and a preview of its own, and one scene file of all.

OpenGL and image libraries are imported when something needs them.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..checks import check_outputs, chosen_maps, possible_files
from .meshes import MeshJob, write_scenes
from .output import (
    BakeJob,
    bake_settings,
    baking,
    texture_facts,
    texture_notes,
    write_baked,
    write_preview,
    written_notes,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.unwrap import Outputs
    from ...runtime.process.progress import Clock
    from ..texture import Texture


def check_pages(output: OutputFolder, outputs: Outputs, pages: Iterable[Asset]) -> None:
    """Refuse before the work what writing would refuse after it.

    Raises: InputError for formats that hold one atlas; else as `checks.check_outputs`.
    """
    outputs.for_pages()
    names: list[str] = []
    for page in pages:
        own = outputs.for_asset(page)
        names += possible_files(page.stem, own, chosen_maps(own))
        names += [f"{page.stem}.{ending}" for ending in ("onnx", *(["wrap.onnx"] if own.inverse else []))]
        names += [f"{page.stem}.preview.png"] if own.preview else []
    check_outputs(output, outputs, chosen_maps(outputs), more=names)


def page_jobs(outputs: Outputs, pages: Sequence[tuple[Asset, Atlas]], seed: int) -> list[BakeJob]:
    """What is baked of each page, where auto stands for what its own materials have.  seed: of the rays."""
    chosen = [(asset, atlas, outputs.for_asset(asset)) for asset, atlas in pages]
    return [BakeJob.of(atlas, asset, own, chosen_maps(own, seed=seed)) for asset, atlas, own in chosen]


def write_pages(output: OutputFolder, jobs: Sequence[BakeJob], clock: Clock, *, apart: bool = False) -> dict[str, Any]:
    """As `output.write_outputs` for several pages of one scene; "textures" has an entry for each.

    apart: whether in no page two triangles are known to overlap.
    """
    facts, files = dict[str, Any](), list[MeshJob]()
    for job, textures in zip(jobs, _baked(jobs, clock), strict=True):
        baked = write_baked(output, job, textures, clock)
        facts[job.asset.stem] = texture_facts(job.atlas, baked)
        files.append(MeshJob(job.atlas, job.asset, job.outputs, baked.textures, baked.files))
        if job.outputs.preview:
            with clock.stage("preview"):
                write_preview(output, job.atlas, job.asset)
    with clock.stage("write"):
        return {"textures": facts, "written": write_scenes(output, files, apart=apart)}


def _baked(jobs: Sequence[BakeJob], clock: Clock) -> list[dict[str, Texture]]:
    """The maps of each page; seams between pages are closed."""
    if not any(job.maps for job in jobs):
        return [{} for _ in jobs]
    from ..baker import Part, bake_together
    from ..windows import Ground

    parts = [
        Part(Ground(job.atlas, job.asset), job.maps, bake_settings(job), (number, 0)) for number, job in enumerate(jobs)
    ]
    with baking(clock, sum(len(job.maps) for job in jobs)) as begun:
        return bake_together(side_by_side([job.atlas for job in jobs]), parts, begun)


def side_by_side(atlases: Sequence[Atlas]) -> Atlas:
    """Several atlases of one size as one, whose uv lie in tiles (0, 0), (1, 0), …; float64, for look-ups alone."""
    first = np.cumsum([0, *(len(atlas.positions) for atlas in atlases)])
    chart = np.cumsum([0, *(int(atlas.face_chart.max(initial=-1)) + 1 for atlas in atlases)])
    number = range(len(atlases))
    return replace(
        atlases[0],
        positions=np.concatenate([atlas.positions for atlas in atlases]),
        normals=np.concatenate([atlas.normals for atlas in atlases]),
        uv=np.concatenate([atlases[place].uv + np.array([float(place), 0.0]) for place in number]),
        faces=np.concatenate([atlases[place].faces + first[place] for place in number]),
        face_chart=np.concatenate([atlases[place].face_chart + chart[place] for place in number]),
        source_vertex=np.concatenate([atlas.source_vertex for atlas in atlases]),
        placement=None,
    )


def page_notes(facts: dict[str, Any]) -> list[str]:
    """What a user should know of written pages: a line each."""
    constant = [f"{stem}: {fact}" for stem, found in facts["textures"].items() for fact in texture_notes(found)]
    return [*written_notes(facts["written"]), *constant]
