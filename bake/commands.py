"""The command that bakes onto the uv a mesh already has.  Options in, one call, files and summary out."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from .. import __version__
from ..runtime.cli.console import Console, Manners
from ..runtime.errors import InputError
from ..runtime.options.atlas import AtlasOptions, Seeded
from ..runtime.options.sources import MapSources
from ..runtime.options.unwrap import LAST_SET, Flag, MapOptions, Output, Outputs, demand
from ..runtime.process.progress import Clock
from .checks import check_outputs, chosen_maps, padding_of
from .highsource import high_source, mesh_maps
from .results.output import BakeJob, bake_textures, bleeding, gutter_of, texture_facts, texture_notes

if TYPE_CHECKING:
    from ..runtime.files import OutputFolder
    from ..runtime.mesh import Asset, Atlas
    from .highpoly.highmaps import HighSource


@dataclass(frozen=True, kw_only=True)
class BakeOptions(Seeded, AtlasOptions, MapSources, MapOptions):
    """What is baked onto a mesh that has uv."""

    uv_set: int | None = None
    """The uv set that is baked onto, 0 to 7; by default the one that the material's textures are read with."""
    udim: Flag = False
    """Bake uv beyond the unit square into further images, STEM_MAP.1001.png and so on."""

    def __post_init__(self) -> None:
        for concern in (MapOptions, MapSources, AtlasOptions, Seeded):
            concern.__post_init__(self)
        demand(bool(self.maps or self.fields), "maps is none, expected at least one; pass for instance --maps normal")
        fits = self.uv_set is None or 0 <= self.uv_set <= LAST_SET
        demand(fits, f"uv-set is {self.uv_set}, expected 0 to {LAST_SET}; pass for instance --uv-set 1")
        both = self.udim and (self.target is not None or self.layers)
        demand(not both, "udim with a target or layers, expected one of the three; leave the others out")

    @property
    def outputs(self) -> Outputs:
        """The part of it that an unwrap has too."""
        shared = (*fields(MapOptions), *fields(MapSources))
        return Outputs(**{field.name: getattr(self, field.name) for field in shared}, preview=False)


def bake(
    mesh: Path,
    *,
    output: Output,
    options: Annotated[BakeOptions, Parameter(name="*")] = BakeOptions(),
    console: Manners = Console(),
) -> int:
    """Bake maps onto the uv that a mesh already has, whoever made it.

    Maps: normal, normal-object, bent-normal, bent-normal-object, position, height, ao, thickness, curvature, chart,
    face-id, material-id, distortion, uv-checker, vertex-color, base-color, metallic-roughness, occlusion, emissive,
    orm.

    Args:
        mesh: A mesh with uv.
        output: The folder for STEM_MAP.png or .exr, and STEM.bake.json, which lists them.
        options: See BakeOptions.
        console: See Console.
    """
    options = replace(options, padding=padding_of(options.padding, options.target, options.page.side))
    high = high_source(options, options.crease_angle)
    chosen_maps(options.outputs, high=high)
    from ..runtime.files import OutputFolder
    from ..runtime.io.asset.shading import shaded
    from ..runtime.io.meshfile import load

    asset = shaded(load(mesh, options.select), options.crease_angle)
    console.note_changes(asset)
    job = _job(_layout(asset, options, console), asset, options, high)
    if not job.maps:
        raise InputError(f"maps is auto, which finds nothing to bake in {mesh.name}; pass for instance --maps ao")
    facts: dict[str, Any] = {"version": __version__, "source": {"sha256": asset.sha256}}
    facts["settings"] = settings(options) | {"maps": [entry.name for entry in job.maps]}
    report = f"{asset.stem}.bake.json"
    with OutputFolder(output, asset.stem, force=console.force, source=mesh, report=report) as folder:
        check_outputs(folder, job.outputs, job.maps, meshes=False)
        with console.progress() as progress:
            bake_files = _bake_squares if options.udim else _bake_one
            facts |= bake_files(folder, job, Clock(progress))
        facts |= {} if high is None else {"high": high.report()}
        folder.write_report(facts)
        written = folder.commit()
    for fact in texture_notes(facts.get("textures", {})):
        console.note(fact)
    console.show({}, written)
    console.show({} if high is None else high.report(), ())
    return 0


def _layout(asset: Asset, options: BakeOptions, console: Console) -> Atlas:
    """The uv that are baked onto; what makes them unfit for that is said, or refused when strict."""
    from ..runtime.geometry.layout import layout_faults
    from ..runtime.io.gltf.uvsets import with_set
    from ..runtime.pack.packing import atlas_from_uv
    from .square import into_square

    laid_out = with_set(asset, options.uv_set, console.note)
    atlas = replace(atlas_from_uv(laid_out), size=options.page.stored, padding=options.margin)
    console.demand_none(asset.stem, layout_faults(atlas.corner_uv, tiles=options.udim))
    if options.udim:
        return atlas
    atlas, left_out = into_square(atlas)
    if left_out:
        console.note(f"{asset.stem}: {left_out} faces span several repeats of the texture and are not baked")
    return atlas


def _job(atlas: Atlas, asset: Asset, options: BakeOptions, high: HighSource | None) -> BakeJob:
    """The maps asked for, over the uv of the atlas."""
    outputs = mesh_maps(options.outputs, asset, high)
    return BakeJob.of(atlas, asset, outputs, chosen_maps(outputs, high=high, seed=options.seed))


def _bake_one(folder: OutputFolder, job: BakeJob, clock: Clock) -> dict[str, Any]:
    """Bake and write one image for each map; what the report says of them."""
    textures = texture_facts(job.atlas, bake_textures(folder, job, clock))
    textures["clean_mip"] = bleeding(job.atlas, gutter_of(job.atlas, job.outputs))
    return {"textures": textures}


def _bake_squares(folder: OutputFolder, job: BakeJob, clock: Clock) -> dict[str, Any]:
    """Bake and write one image for each map and square of uv; the squares' numbers for the report."""
    from .results.tiles import baked_tiles
    from .results.udim import write_udim

    tiles, kind = baked_tiles(job, clock), job.outputs.texture_format
    folder.write_several(lambda path: write_udim(tiles, path, job.asset.stem, file_type=kind))
    return {"tiles": list(tiles)}


def settings(options: BakeOptions) -> dict[str, Any]:
    """All options as JSON; files by their names, padding as it is in force."""
    return {**options.facts(), "padding": options.margin}
