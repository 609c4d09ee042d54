"""What can be refused before any work is done: unknown maps, foreign files, packages that are absent.

OpenGL and image libraries are imported when something needs them: an obj file alone does without.
"""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from ..runtime.errors import InputError
from ..runtime.extras import requires

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..runtime.files import OutputFolder
    from ..runtime.options.unwrap import Options, Outputs
    from .bakemap import BakeMap
    from .files.exr import ExrSettings
    from .highpoly.highmaps import HighSource


def chosen_maps(outputs: Outputs, *, high: HighSource | None = None, seed: int = 0) -> list[BakeMap]:
    """The maps asked for, without "auto".

    Args:
        outputs: names, fields, normal format, rays.
        high: high-poly meshes that the maps are taken from.
        seed: of the rays.

    Raises: InputError for an unknown map or a field that is none; MissingDependencyError without flexpara[bake].
    """
    if not outputs.maps and not outputs.fields:
        return []
    with requires("bake"):
        from .maps.catalogue import find_map
        from .maps.field import field_map
        from .maps.rays import RaySettings
    green, rays = outputs.normal_format, RaySettings(outputs.rays, seed=seed)
    find = find_map if high is None else high.find_map
    entries = [find(name, normal_format=green, rays=rays) for name in outputs.maps if name != "auto"]
    return [with_background(entry, outputs) for entry in (*entries, *(field_map(path) for path in outputs.fields))]


def ready_for(options: Options, outputs: Outputs) -> None:
    """Refuse before a batch what would be refused for each of its assets.

    Raises: InputError for maps, targets and options that are none, or exclude each other; MissingDependencyError.
    """
    padding_of(options.padding, outputs.target, options.page.side)
    maps = tuple(name for name in outputs.maps if not (outputs.high and name == "height"))
    chosen_maps(replace(outputs, maps=maps, fields=()))
    if options.udim:
        outputs.for_tiles()
    elif options.several:
        outputs.for_pages()


def with_background(entry: BakeMap, outputs: Outputs) -> BakeMap:
    """The map with the background asked for, where it is one of colours; others keep their neutral value."""
    if outputs.background is None or entry.encoding != "srgb":
        return entry
    from .colors.color import linear_from_srgb

    levels = np.array([int(outputs.background[start : start + 2], 16) for start in (1, 3, 5)])
    return replace(entry, background=tuple(linear_from_srgb(levels / 255.0).tolist()))


def check_outputs(
    output: OutputFolder, outputs: Outputs, maps: Sequence[BakeMap], *, more: Sequence[str] = (), meshes: bool = True
) -> None:
    """Refuse early what writing would refuse after the work: foreign files, packages that are absent.

    more: further file names.  meshes: whether meshes and networks are written.

    Raises: InputError, ForeignFileError, MissingDependencyError.
    """
    if meshes and "usda" in outputs.formats:
        check_green(outputs)
    names = [*possible_files(output.stem, outputs, maps), *more]
    if meshes:
        endings = [*outputs.formats, "onnx"]
        endings += ["bin"] if "gltf" in outputs.formats else []
        endings += ["wrap.onnx"] if outputs.inverse else []
        names += [f"{output.stem}.{ending}" for ending in endings]
        names += [f"{output.stem}.preview.png"] if outputs.preview else []
        names += [f"{output.stem}.report.html"] if outputs.report else []
    output.check([*names, output.report_name])
    wanted = {
        "baker": bool(maps),
        "files.images": bool(maps),
        "files.gltf": meshes and bool({"glb", "gltf"} & set(outputs.formats)),
        "pictures.preview": outputs.preview,
    }
    if outputs.denoise and maps:
        from .denoise import check_denoiser

        check_denoiser()
    with requires("bake"):
        for module in (name for name, needed in wanted.items() if needed):
            import_module(f".{module}", __package__)
        if maps or outputs.preview:
            import_module("OpenImageIO")


def check_green(outputs: Outputs) -> None:
    """USD reads +Y, and a usda file names the normal map beside it.  Raises: InputError where that is −Y."""
    with requires("bake"):
        from .files.targets import find_target
    green = outputs.normal_format if outputs.target is None else find_target(outputs.target).green
    if green != "opengl":
        raise InputError(f"format usda beside {green} normal maps, expected opengl; leave usda or that choice out")


def padding_of(padding: int | None, target: str | None, size: int, *, light: bool = False) -> int | None:
    """The padding asked for, else that of the target, else None.  light: for a light map.

    Raises: InputError for an unknown target.
    """
    if target is None:
        return padding
    with requires("bake"):
        from .files.targets import find_target
    preset = find_target(target)
    return preset.padding(size, light=light) if padding is None else padding


def possible_files(stem: str, outputs: Outputs, maps: Sequence[BakeMap]) -> list[str]:
    """Texture files that these maps may become; with a target, both endings that a product may get.

    Raises: InputError for an unknown target.
    """
    if not maps:
        return []
    if outputs.layers:
        exr_settings(outputs)
        return [f"{stem}.exr"]
    if outputs.target is None:
        from .files.textures import texture_names

        return list(
            texture_names({entry.name: entry for entry in maps}, stem, file_type=outputs.texture_format).values()
        )
    from .files.targets import find_target

    plain = find_target(outputs.target).file_names([entry.name for entry in maps], stem).values()
    return [f"{name}.{ending}" for name in plain for ending in ("png", "exr")]


def exr_settings(outputs: Outputs) -> ExrSettings:
    """How layers are stored.  Raises: EncodingError for a compression that OpenEXR has not."""
    from .files.exr import ExrSettings

    return ExrSettings(outputs.exr_bits, cast("Any", outputs.exr_compression))
