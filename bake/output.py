"""What a run writes: textures, meshes and the preview, into an OutputFolder; and early refusals.   sizes in texels.

OpenGL and image libraries are imported when something needs them: an obj file alone does without.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any, cast

from ..runtime.errors import InputError
from ..runtime.extras import requires

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..runtime.files import OutputFolder
    from ..runtime.mesh import Asset, Atlas
    from ..runtime.options import Outputs
    from ..runtime.progress import Clock, Progress


def write_outputs(output: OutputFolder, atlas: Atlas, asset: Asset, outputs: Outputs, clock: Clock) -> None:
    """Textures, meshes in each format, preview.  outputs: without "auto".

    Raises: as `baker.bake`; ForeignFileError, InputError as OutputFolder.write.
    """
    textures = write_textures(output, atlas, asset, outputs, atlas.padding, clock)
    with clock.stage("write"):
        write_meshes(output, atlas, asset, outputs, textures)
    if outputs.preview:
        from ..runtime.metrics import face_distortion
        from .preview import render_preview

        with clock.stage("preview"):
            stretch = face_distortion(asset.surface, atlas.corner_uv)
            output.write(f"{output.stem}.preview.png", lambda path: render_preview(atlas, stretch, path))


def check_outputs(output: OutputFolder, outputs: Outputs, size: int, *, meshes: bool = True) -> None:
    """Refuse early what writing would refuse after the work: unknown maps, foreign files, OpenGL absent or too small.

    Raises: InputError, ForeignFileError, MissingDependencyError.
    """
    names = list(texture_files(output.stem, outputs).values())
    if meshes:
        endings = (*outputs.formats, "onnx", *(("wrap.onnx",) if outputs.inverse else ()))
        names += [f"{output.stem}.{ending}" for ending in endings]
        names += [f"{output.stem}.preview.png"] if outputs.preview else []
    output.check([*names, output.report_name])
    wanted = {"baker": bool(outputs.maps), "gltf": meshes and "glb" in outputs.formats, "preview": outputs.preview}
    with requires("bake"):
        for module in (name for name, needed in wanted.items() if needed):
            import_module(f".{module}", __package__)
    if outputs.maps or outputs.preview:
        from .context import describe

        limit = describe().max_size
        if outputs.maps and size > limit:
            raise InputError(f"size is {size}, this OpenGL device draws up to {limit} texels; pass --size {limit}")


def check_maps(names: Sequence[str]) -> None:
    """Raises: InputError for an unknown map, MissingDependencyError when maps are wanted and can't be made."""
    if names:
        with requires("bake"):
            from .maps import find_map
        for name in names:
            if name != "auto":
                find_map(name)


def texture_files(stem: str, outputs: Outputs) -> dict[str, str]:
    """Map → file name.  Raises: InputError for an unknown map."""
    if not outputs.maps:
        return {}
    with requires("bake"):
        from .baker import texture_names
        from .maps import find_map
    entries = {name: find_map(name, normal_format=outputs.normal_format) for name in outputs.maps}
    return texture_names(cast("Any", entries), stem, file_type=outputs.texture_format)


def write_textures(
    output: OutputFolder, atlas: Atlas, asset: Asset, outputs: Outputs, padding: int, progress: Progress
) -> dict[str, Any]:
    """Bake the maps and write them; map → Texture."""
    if not outputs.maps:
        return {}
    from . import baker

    names = list(outputs.maps)
    textures = baker.bake(
        atlas,
        asset,
        outputs.maps,
        padding=padding,
        normal_format=outputs.normal_format,
        progress=lambda name: progress("bake", names.index(name), len(names)),
    )
    kind, first = outputs.texture_format, next(iter(texture_files(output.stem, outputs).values()))
    output.write(first, lambda path: baker.write_textures(textures, path.parent, output.stem, file_type=kind))
    return textures


def write_meshes(output: OutputFolder, atlas: Atlas, asset: Asset, outputs: Outputs, textures: dict[str, Any]) -> None:
    """The mesh in each format asked for."""
    from ..runtime.meshwrite import write_obj, write_ply

    pictures = texture_files(output.stem, outputs)
    shown = next((pictures[name] for name in ("base-color", "uv-checker", "chart") if name in pictures), None)
    if "glb" in outputs.formats:
        with requires("bake"):
            from .gltf import write_glb
        output.write(f"{output.stem}.glb", lambda path: write_glb(atlas, asset, textures, path))
    if "obj" in outputs.formats:
        output.write(f"{output.stem}.obj", lambda path: write_obj(atlas, path, texture=shown))
    if "ply" in outputs.formats:
        output.write(f"{output.stem}.ply", lambda path: write_ply(atlas, path, colors=asset.colors))
