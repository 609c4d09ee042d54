"""The command that bakes onto the uv a mesh already has.  Options in, one call, files and summary out."""

from __future__ import annotations

from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from .. import __version__
from ..runtime.console import Console, Manners
from ..runtime.errors import InputError
from ..runtime.extras import requires
from ..runtime.options import AUTO, AtlasOptions, Flag, MapOptions, Names, Output, Outputs, Paths, Seeded, demand
from ..runtime.progress import Clock
from .checks import check_outputs, chosen_maps, padding_of
from .output import bake_textures, bleeding, gutter_of, texture_facts, texture_notes, with_tangents

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..runtime.files import OutputFolder
    from ..runtime.mesh import Asset, Atlas
    from .bakemap import BakeMap
    from .highpoly.highmaps import HighSource


@dataclass(frozen=True, kw_only=True)
class BakeOptions(Seeded, AtlasOptions, MapOptions):
    """What is baked onto a mesh that has uv."""

    maps: Names = (AUTO,)
    """The maps to bake, by name.  auto stands for what the source has: colours and the textures of its materials, and
    the normals of a high-poly mesh."""
    fields: Annotated[Paths, Parameter(name="--field")] = ()
    """An ONNX file from points to channels, which becomes a map; may be given several times."""
    udim: Flag = False
    """Bake uv beyond the unit square into further images, STEM_MAP.1001.png and so on."""

    def __post_init__(self) -> None:
        for concern in (MapOptions, AtlasOptions, Seeded):
            concern.__post_init__(self)
        demand(bool(self.maps or self.fields), "maps is none, expected at least one; pass for instance --maps normal")
        both = self.udim and (self.target is not None or self.layers)
        demand(not both, "udim with a target or layers, expected one of the three; leave the others out")

    @property
    def outputs(self) -> Outputs:
        """The part of it that an unwrap has too."""
        return Outputs(**{field.name: getattr(self, field.name) for field in fields(MapOptions)}, preview=False)


@dataclass(frozen=True, kw_only=True)
class HighOptions:
    """The high-poly meshes that maps are taken from."""

    high: Paths = ()
    """A high-poly mesh that the maps are taken from; may be given several times."""
    cage: str = "0.02"
    """How far the rays reach for it: a share of the bounding box's diagonal, or a cage mesh with the low-poly's
    faces."""
    match_names: Flag = False
    """Let each part of the low-poly mesh see only the high-poly parts that have its name."""

    def __post_init__(self) -> None:
        alone = not self.high and (self.cage, self.match_names) != (HighOptions.cage, HighOptions.match_names)
        demand(not alone, "cage or match-names without high, expected a high-poly mesh; add --high, or leave them out")


def bake(
    mesh: Path,
    *,
    output: Output,
    options: Annotated[BakeOptions, Parameter(name="*")] = BakeOptions(),
    source: Annotated[HighOptions, Parameter(name="*")] = HighOptions(),
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
        source: See HighOptions.
        console: See Console.
    """
    padding = padding_of(options.padding, options.target, options.size)
    options, outputs = replace(options, padding=padding), options.outputs
    high = _high_source(source)
    chosen_maps(outputs, high=high)
    from ..runtime.files import OutputFolder
    from ..runtime.io.meshfile import load
    from ..runtime.pack.packing import atlas_from_uv

    asset = load(mesh)
    console.note_changes(asset)
    atlas = replace(atlas_from_uv(asset), size=options.size, padding=options.margin)
    outputs = outputs.for_asset(asset) if high is None else high.outputs(outputs)
    entries = chosen_maps(outputs, high=high, fields=options.fields, seed=options.seed)
    if not entries:
        raise InputError(f"maps is auto, which finds nothing to bake in {mesh.name}; pass for instance --maps ao")
    atlas = with_tangents(atlas, entries)
    facts: dict[str, Any] = {"version": __version__, "source": {"sha256": asset.sha256}}
    facts["settings"] = settings(options, source) | {"maps": [entry.name for entry in entries]}
    report = f"{asset.stem}.bake.json"
    with OutputFolder(output, asset.stem, force=console.force, source=mesh, report=report) as folder:
        check_outputs(folder, outputs, entries, meshes=False)
        with console.progress() as progress:
            if options.udim:
                facts["tiles"] = _bake_squares(folder, atlas, asset, entries, options)
            else:
                baked = bake_textures(folder, atlas, asset, outputs, entries, Clock(progress))
                facts["textures"] = texture_facts(atlas, baked)
                facts["textures"]["clean_mip"] = bleeding(atlas, options.size, gutter_of(atlas, outputs))
        facts |= {} if high is None else {"high": high.report()}
        folder.write_report(facts)
        written = folder.commit()
    for fact in texture_notes(facts.get("textures", {})):
        console.note(fact)
    console.show({}, written)
    console.show({} if high is None else high.report(), ())
    return 0


def _bake_squares(
    folder: OutputFolder, atlas: Atlas, asset: Asset, maps: Sequence[BakeMap], options: BakeOptions
) -> list[int]:
    """Bake and write one image for each map and square of uv; returns the squares' numbers."""
    from .udim import bake_udim, write_udim

    gutter = gutter_of(atlas, options.outputs)
    tiles = bake_udim(atlas, asset, list(maps), size=options.size, padding=gutter, samples=options.samples)
    kind = options.texture_format
    folder.write_several(lambda path: write_udim(tiles, path, asset.stem, file_type=kind))
    return list(tiles)


def settings(options: BakeOptions, source: HighOptions) -> dict[str, Any]:
    """All options as JSON; files by their names, padding as it is in force."""
    plain = {**asdict(options), **asdict(source), "padding": options.margin}
    return plain | {name: [path.name for path in plain[name]] for name in ("fields", "high")}


def _high_source(options: HighOptions) -> HighSource | None:
    """The high-poly meshes and how far rays reach for them.  Raises: InputError for a cage that is neither."""
    if not options.high:
        return None
    with requires("bake"):
        from .highpoly.cage import CageSettings
        from .highpoly.highmaps import HighSource
    from ..runtime.io.meshfile import load_asset

    try:
        cage = CageSettings(float(options.cage), match_names=options.match_names)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        cage = CageSettings(cage=load_asset(Path(options.cage)), match_names=options.match_names)
    return HighSource([load_asset(path, instances=True) for path in options.high], cage)
