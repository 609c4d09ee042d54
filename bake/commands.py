"""The command that bakes onto the uv a mesh already has.  Options in, one call, files and summary out."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from .. import __version__
from ..runtime.console import Flag, Output, names, show
from ..runtime.errors import InputError
from ..runtime.extras import requires
from ..runtime.options import Options, Outputs
from ..runtime.progress import Clock, progress_bars
from .output import bleeding, check_outputs, chosen_maps, padding_of, texture_facts, with_tangents, write_textures

if TYPE_CHECKING:
    from .highpoly.highmaps import HighSource


def bake(
    mesh: Path,
    *,
    output: Output,
    maps: str = "position,normal",
    size: int = 2048,
    padding: int | None = None,
    samples: int = 1,
    rays: int = 64,
    high: list[Path] | None = None,
    cage: str = "0.02",
    match_names: Flag = False,
    field: list[Path] | None = None,
    target: str | None = None,
    udim: Flag = False,
    layers: Flag = False,
    exr_bits: Literal[16, 32] = 32,
    exr_compression: str = "zip",
    texture_format: Literal["png", "exr"] | None = None,
    normal_format: Literal["opengl", "directx"] = "opengl",
    seed: int = 0,
    quiet: Flag = False,
    force: Flag = False,
) -> int:
    """Bake maps onto the uv that a mesh already has, whoever made it.

    Maps: normal, normal-object, bent-normal, bent-normal-object, position, height, ao, thickness, curvature, chart,
    face-id, material-id, distortion, uv-checker, vertex-color, base-color, metallic-roughness, occlusion, emissive,
    orm.

    Args:
        mesh: a mesh with uv
        output: folder for STEM_MAP.png or .exr, and STEM.bake.json, which lists them
        maps: comma-separated; auto: normal, position, and what the source's materials have, or else a checker
        size: side, texels
        padding: texels of gutter around each chart (default: size / 256, at least 2, or the target's)
        samples: of each texel: 1, 4 or 16
        rays: of ray-traced maps, per sample
        high: a high-poly mesh that the maps are taken from; may be given several times
        cage: how far its rays reach: a part of the bounding box diagonal, or a cage mesh of the low-poly's faces
        match_names: parts of the low-poly see the high-poly parts of their name alone
        field: an ONNX file points to channels, which becomes a map; may be given several times
        target: gltf, unreal, unity, godot, blender or usd: file names, packing, depth, green channel and padding
        udim: uv beyond the unit square become further images, STEM_MAP.1001.png and so on
        layers: all maps as layers of STEM.exr
        exr_bits: of that file's channels: 16 (half) or 32 (float)
        exr_compression: of that file: zip, zips, piz, rle, none, …
        texture_format: of all maps that can be stored so (default: each map's own)
        normal_format: green channel of the normal map: opengl (+Y) or directx (-Y)
        seed: of the rays
        quiet: no progress, no summary
        force: overwrite files that flexpara did not write
    """
    options = Options(size=size, padding=padding_of(padding, target, size), seed=seed)
    outputs = Outputs(
        names(maps),
        preview=False,
        texture_format=texture_format,
        normal_format=normal_format,
        target=target,
        layers=layers,
        exr_bits=exr_bits,
        exr_compression=exr_compression,
        samples=samples,
        rays=rays,
    )
    if not outputs.maps and not field:
        raise InputError("maps is none, expected at least one; pass for instance --maps normal")
    if udim and (target is not None or layers):
        raise InputError("udim with a target or layers, expected one of the three; leave the others out")
    chosen_maps(outputs)
    from ..runtime.files import OutputFolder
    from ..runtime.io.meshfile import load
    from ..runtime.pack.packing import atlas_from_uv

    asset = load(mesh)
    source = _high_source(high or [], cage, match_names=match_names)
    entries = chosen_maps(outputs.for_asset(asset), high=source, fields=field or [], seed=seed)
    atlas = with_tangents(replace(atlas_from_uv(asset), size=size), entries)
    facts: dict[str, Any] = {"version": __version__, "source": {"sha256": asset.sha256}}
    facts["settings"] = {
        "maps": [entry.name for entry in entries],
        "size": size,
        "padding": options.margin,
        "samples": samples,
        "rays": rays,
        "seed": seed,
        "target": target,
        "high": [path.name for path in high or []],
        "cage": cage,
    }
    with OutputFolder(output, asset.stem, force=force, source=mesh, report=f"{asset.stem}.bake.json") as folder:
        check_outputs(folder, outputs, entries, meshes=False)
        with progress_bars(quiet=quiet) as progress:
            if udim:
                from .udim import bake_udim, write_udim

                tiles = bake_udim(atlas, asset, entries, size=size, padding=options.margin, samples=samples)
                folder.write_several(lambda path: write_udim(tiles, path, asset.stem, file_type=texture_format))
                facts["tiles"] = list(tiles)
            else:
                baked = write_textures(folder, atlas, asset, outputs, entries, options.margin, Clock(progress))
                facts["textures"] = texture_facts(atlas, baked)
                facts["textures"]["bleed_free_mip"] = bleeding(atlas, size, options.margin)
        facts |= {} if source is None else {"high": source.report()}
        folder.write_report(facts)
        written = folder.commit()
    if not quiet:
        show({}, written)
        if source is not None:
            show(source.report(), ())
    return 0


def _high_source(paths: list[Path], cage: str, *, match_names: bool) -> HighSource | None:
    """The high-poly meshes and how far rays reach for them.  Raises: InputError for a cage that is neither."""
    if not paths:
        return None
    with requires("bake"):
        from .highpoly.cage import CageSettings
        from .highpoly.highmaps import HighSource
    from ..runtime.io.meshfile import load_asset

    try:
        settings = CageSettings(float(cage), match_names=match_names)
    except ValueError as error:
        if isinstance(error, InputError):
            raise
        settings = CageSettings(cage=load_asset(Path(cage)), match_names=match_names)
    return HighSource([load_asset(path) for path in paths], settings)
