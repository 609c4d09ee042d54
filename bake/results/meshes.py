"""The mesh files of a run, each format with what it can hold, and what was read back of them.

OpenGL and image libraries are imported when something needs them: an obj file alone does without.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.extras import requires
from ...runtime.io.formats.npz import write_npz
from ...runtime.io.gltf.instances import every_instance, instance_faces
from ...runtime.io.loops import first_faces, loops_of
from ...runtime.material import used_materials
from ...runtime.options.unwrap import SCENES

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.files import OutputFolder
    from ...runtime.mesh import Asset, Atlas
    from ...runtime.options.unwrap import Outputs
    from ..files.usdshapes import Shape
    from ..texture import Texture

USD_KEYS = {"orm": "occlusionRoughnessMetallic"}
"""Products of the USD preset that have another name among flexpara's own maps."""
SHOWN = ("base-color", "uv-checker", "chart")
"""The first of these maps that was baked is the colour in formats that have one picture."""


@dataclass(frozen=True, eq=False)
class MeshJob:
    """What is written: an atlas of an asset with its textures.

    files: product (a map, or a packed file of a target) → name of the file that was written of it.
    """

    atlas: Atlas
    asset: Asset
    outputs: Outputs
    textures: Mapping[str, Texture]
    files: Mapping[str, str]


def write_meshes(output: OutputFolder, job: MeshJob, *, apart: bool = False) -> dict[str, dict[str, Any]]:
    """The mesh in each format asked for; what was read back of it, format → fields of `written.WrittenUv`."""
    source, shapes = job.asset, []
    job = replace(job, asset=_as_scene(job.asset, job.outputs))
    spread, own = every_instance(job.atlas, job.asset)
    flat = replace(job, atlas=spread)
    writers: dict[str, Callable[[Path], None]] = {
        "glb": lambda path: _write_gltf(job, path),
        "gltf": lambda path: _write_gltf(job, path),
        "obj": lambda path: _write_obj(flat, path, instance_faces(job.asset)),
        "ply": lambda path: _write_ply(flat, path),
        "usda": lambda path: shapes.extend(_write_usda(replace(job, asset=source), path)),
        "npz": lambda path: write_npz(spread, job.asset, path),
    }
    staged: dict[str, Path] = {}

    def write(kind: str, path: Path) -> None:
        writers[kind](path)
        staged[kind] = path

    for kind in (name for name in writers if name in job.outputs.formats):
        output.write(f"{job.asset.stem}.{kind}", partial(write, kind))
    from ..files.written import Reading, parts_of, written_report

    staged.pop("npz", None)  # the arrays themselves
    uv = job.atlas.uv[job.atlas.faces]
    order, parts = parts_of(job.asset, job.outputs.uv_set or 0)
    scenes = {kind: path for kind, path in staged.items() if kind in SCENES}
    plain = {kind: path for kind, path in staged.items() if kind not in (*SCENES, "usda")}
    fans = spread.uv[loops_of(spread, job.asset).triangles]
    return {
        **written_report(scenes, uv[order], Reading(apart=apart, parts=parts)),
        **written_report(plain, uv, Reading(apart=apart, fans=fans, faces=own)),
        **({"usda": _usda_report(staged["usda"], job.atlas, shapes, apart=apart)} if "usda" in staged else {}),
    }


def write_scenes(output: OutputFolder, jobs: Sequence[MeshJob], *, apart: bool = False) -> dict[str, dict[str, Any]]:
    """The scene that all jobs are pages of, in each format asked for; what was read back, as `write_meshes`."""
    from ..files.written import Reading, parts_of, written_report

    formats, uv_set = jobs[0].outputs.formats, jobs[0].outputs.uv_set
    staged: dict[str, Path] = {}

    def write(kind: str, path: Path) -> None:
        _write_scene(jobs, path)
        staged[kind] = path

    for kind in formats:
        output.write(f"{output.stem}.{kind}", partial(write, kind))
    found = [(job.atlas.uv[job.atlas.faces], *parts_of(job.asset, uv_set or 0)) for job in jobs]
    reading = Reading(apart=apart, parts=[part for _, _, parts in found for part in parts])
    return written_report(staged, np.concatenate([uv[order] for uv, order, _ in found]), reading)


def _as_scene(asset: Asset, outputs: Outputs) -> Asset:
    """With a document for what is written as one: several materials, or uv that go beside others."""
    wanted = outputs.uv_set is not None or len(used_materials(asset)) > 1
    if asset.document is not None or not wanted or set(SCENES).isdisjoint(outputs.formats):
        return asset
    with requires("bake"):
        from ..files.gltfmade import with_document
    return with_document(asset)


def shown_color(files: Mapping[str, str]) -> str | None:
    """The file of the picture that formats with one picture show; None where none of those maps was baked."""
    return next((files[name] for name in SHOWN if name in files), None)


def _write_gltf(job: MeshJob, path: Path) -> None:
    """A .glb or .gltf file: the document with new uv, where there is one."""
    if job.asset.document is not None:
        _write_scene([job], path)
        return
    with requires("bake"):
        from ..files.gltf import write_glb
    write_glb(job.atlas, job.asset, job.textures, path)


def _write_scene(jobs: Sequence[MeshJob], path: Path) -> None:
    """The document of all jobs, each of which is a page of it."""
    with requires("bake"):
        from ..files.gltfscene import Page, write_scene
    write_scene([Page(job.atlas, job.asset, job.textures, job.outputs.uv_set) for job in jobs], path)


def _write_obj(job: MeshJob, path: Path, faces: NDArray[np.int64]) -> None:
    """The source's own lines where it is an OBJ file; with materials that name the pictures, or vertex colours.

    faces: (f,) which of the asset's faces each of the atlas is.
    """
    shown = shown_color(job.files)
    if job.asset.obj is None:
        from ...runtime.io.obj.named import named
        from ...runtime.io.obj.write import write_obj

        loops = loops_of(job.atlas, job.asset)
        names = named(job.asset, faces, first_faces(job.asset, loops), shown)
        colors = job.asset.colors if shown is None else None
        write_obj(job.atlas, path, texture=shown, colors=colors, loops=loops, names=names)
        return
    from ...runtime.io.obj.rewrite import rewrite_obj

    pictures = {**job.files, **({} if shown is None else {"base-color": shown})}
    rewrite_obj(job.atlas, job.asset, job.asset.obj, path, pictures)


def _write_ply(job: MeshJob, path: Path) -> None:
    """With the source's vertex colours, and the name of its picture."""
    from ...runtime.io.ply.write import write_ply

    loops, shown = loops_of(job.atlas, job.asset), shown_color(job.files)
    write_ply(job.atlas, path, colors=job.asset.colors, loops=loops, texture=shown)


def _write_usda(job: MeshJob, path: Path) -> list[Shape]:
    """With materials that name the texture files beside it; what each mesh in it has."""
    with requires("bake"):
        from ..files.usd import write_usda
    color = job.textures.get("base-color")
    alpha = color is not None and color.pixels.shape[2] == 4
    named = {USD_KEYS.get(name, name): file for name, file in job.files.items()}
    return write_usda(job.atlas, job.asset, named, path, alpha=alpha)


def _usda_report(path: Path, atlas: Atlas, shapes: Sequence[Shape], *, apart: bool) -> dict[str, Any]:
    """What was read back of a .usda file."""
    from ..files.written import PartUv, Reading, written_report

    uv = np.concatenate([atlas.uv[shape.triangles] for shape in shapes])
    parts = [PartUv(mirrored=shape.mirrored) for shape in shapes]
    return written_report({"usda": path}, uv, Reading(apart=apart, parts=parts))["usda"]
