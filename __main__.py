"""The command line: `flexpara …` and `python -m flexpara …`.  Wiring only: options in, one call, files and summary out.

Results and summaries go to stdout, progress and errors to stderr.  Exit codes: 0 done · 1 a defect (traceback) ·
2 bad input or options · 3 a dependency is missing · 130 interrupted.  Sizes and paddings are in texels.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter
from cyclopts.exceptions import CycloptsError

from . import __version__, load, unwrap_asset
from .bake.output import check_maps, check_outputs, write_textures
from .runtime.errors import FlexparaError, InputError
from .runtime.options import Options, Outputs
from .runtime.progress import Clock, progress_bars

if TYPE_CHECKING:
    from collections.abc import Sequence

INTERRUPTED = 130
SAMPLE_FORMATS = (".ply", ".obj", ".stl", ".off", ".glb")
SUMMARY = {
    "charts": "{}",
    "symmetric_dirichlet_mean": "{:.4f}",
    "isometric_mean": "{:.5f}",
    "conformal_mean": "{:.4f}",
    "seam_length": "{:.2f}",
    "flipped_faces": "{}",
    "overlap_fraction": "{:.2g}",
    "packing_efficiency": "{:.1%}",
    "rms_texels": "{:.2f}",
    "chart_agreement": "{:.2%}",
}

Output = Annotated[Path, Parameter(name=["--output", "-o"])]
Flag = Annotated[bool, Parameter(negative="")]

app = App(
    name="flexpara",
    help="UV atlases with few charts and little distortion, an ONNX file that knows them, and baked textures.",
    version=__version__,
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code.  argv: the words after `flexpara`, those of the process by default."""
    try:
        return app(argv, exit_on_error=False, print_error=False) or 0
    except CycloptsError as error:
        return _complain(f"{error} See: {' '.join(['flexpara', *(error.command_chain or ()), '--help'])}", 2)
    except FlexparaError as error:
        return _complain(str(error), error.exit_code)
    except KeyboardInterrupt:
        return _complain("interrupted, nothing half-written is left", INTERRUPTED)


@app.command
def unwrap(
    mesh: Path,
    *,
    output: Output,
    charts: int = 8,
    size: int = 2048,
    padding: int | None = None,
    maps: str = "auto",
    format: str = "glb",
    texture_format: Literal["png", "exr"] | None = None,
    normal_format: Literal["opengl", "directx"] = "opengl",
    seed: int = 0,
    preset: str = "fast",
    preview: bool = True,
    quiet: Flag = False,
    force: Flag = False,
) -> int:
    """Unwrap a mesh into an atlas of few charts, an ONNX file and textures.

    Args:
        mesh: any file trimesh reads: obj, ply, stl, glb, gltf, off, …
        output: folder for STEM.glb, STEM.onnx, STEM_MAP.png or .exr, STEM.report.json and STEM.preview.png
        charts: the most charts a connected surface may get
        size: atlas side, texels
        padding: texels kept free around each chart (default: size / 256, at least 2)
        maps: comma-separated; auto: normal, position, and the source's colours or else a checker; none: uv only
        format: mesh files, comma-separated: glb, obj, ply
        texture_format: of all maps that can be stored so (default: each map's own)
        normal_format: green channel of the normal map: opengl (+Y) or directx (-Y)
        seed: same seed, same machine, same bytes
        preset: how much work training does: fast
        preview: draw STEM.preview.png
        quiet: no progress, no summary
        force: overwrite files that flexpara did not write
    """
    options = Options(charts=charts, size=size, padding=padding, seed=seed, preset=preset)
    outputs = Outputs(_names(maps), _names(format), preview, texture_format, normal_format)
    check_maps(outputs.maps)
    from .runtime.files import OutputFolder

    asset = load(mesh)
    with OutputFolder(output, asset.stem, force=force, source=mesh) as folder:
        check_outputs(folder, outputs.for_asset(asset), size)
        with progress_bars(quiet=quiet) as progress:
            result = unwrap_asset(asset, options, progress)
            written = result.write(folder, outputs.for_asset(asset), progress)
    if not quiet:
        _show({**result.report["metrics"], **result.report["network"]}, written)
    return 0


@app.command
def query(bundle: Path, points: Path, *, output: Output, force: Flag = False) -> int:
    """Chart and uv of any points of an unwrapped surface, without torch and without the mesh.

    Args:
        bundle: the .onnx file that unwrap wrote
        points: .npy, .npz, .csv or .ply, in the units of the source file
        output: .npz or .csv, receives points, uv, chart and score
        force: overwrite the file
    """
    from .runtime.files import OutputFolder, write_whole
    from .runtime.pointfile import check_output, read_points, write_unwrapped
    from .runtime.session import UnwrapSession

    check_output(output)
    OutputFolder(output.parent, output.stem, force=force).check([output.name])
    session, xyz = UnwrapSession(bundle), read_points(points)
    answer = session.unwrap(xyz)
    write_whole(output, lambda path: write_unwrapped(path, xyz, *answer), force=force)
    return 0


@app.command
def bake(
    mesh: Path,
    *,
    output: Output,
    maps: str = "position,normal",
    size: int = 2048,
    padding: int | None = None,
    texture_format: Literal["png", "exr"] | None = None,
    normal_format: Literal["opengl", "directx"] = "opengl",
    quiet: Flag = False,
    force: Flag = False,
) -> int:
    """Bake maps onto the uv that a mesh already has, whoever made it.

    Args:
        mesh: a mesh with uv
        output: folder for STEM_MAP.png or .exr, and STEM.bake.json, which lists them
        maps: comma-separated; auto: normal, position, and the source's colours or else a checker
        size: side, texels
        padding: texels of gutter around each chart (default: size / 256, at least 2)
        texture_format: of all maps that can be stored so (default: each map's own)
        normal_format: green channel of the normal map: opengl (+Y) or directx (-Y)
        quiet: no progress, no summary
        force: overwrite files that flexpara did not write
    """
    options = Options(size=size, padding=padding)
    outputs = Outputs(_names(maps), texture_format=texture_format, normal_format=normal_format, preview=False)
    if not outputs.maps:
        raise InputError("maps is none, expected at least one; pass for instance --maps normal")
    check_maps(outputs.maps)
    from .runtime.files import OutputFolder
    from .runtime.packing import atlas_from_uv

    asset = load(mesh)
    outputs, atlas = outputs.for_asset(asset), atlas_from_uv(asset)
    with OutputFolder(output, asset.stem, force=force, source=mesh, report=f"{asset.stem}.bake.json") as folder:
        check_outputs(folder, outputs, size, meshes=False)
        with progress_bars(quiet=quiet) as progress:
            write_textures(folder, replace(atlas, size=size), asset, outputs, options.margin, Clock(progress))
        settings = {"maps": outputs.maps, "size": size, "padding": options.margin}
        folder.write_report({"version": __version__, "source": {"sha256": asset.sha256}, "settings": settings})
        written = folder.commit()
    if not quiet:
        _show({}, written)
    return 0


@app.command
def evaluate(
    mesh: Path, *, size: int | None = None, as_json: Annotated[bool, Parameter(name="--json", negative="")] = False
) -> int:
    """Metrics of a mesh with uv, whoever made it.

    Args:
        mesh: a mesh with uv
        size: atlas side in texels, for texel density and bleeding
        as_json: print JSON
    """
    if size is not None:
        Options(size=size)
    from .runtime.metrics import measure

    asset = load(mesh)
    if asset.uv is None:
        raise InputError(
            f"{mesh} has no uv, expected a mesh that carries them; make some: flexpara unwrap {mesh} -o out/"
        )
    metrics = measure(asset.surface, asset.uv[asset.faces], size=size).to_dict()
    if as_json:
        sys.stdout.write(json.dumps(metrics, indent=2) + "\n")
    else:
        _show(metrics, ())
    return 0


@app.command
def sample(name: str, *, output: Output, resolution: int | None = None, force: Flag = False) -> int:
    """Write a procedural test surface.

    Args:
        name: sphere, torus, trefoil, gyroid, bracket, cloth, …
        output: .ply, .obj, .stl, .off or .glb
        resolution: edges along the longest line
        force: overwrite the file
    """
    from .runtime.files import OutputFolder, write_whole
    from .runtime.samples import make_sample

    if output.suffix.lower() not in SAMPLE_FORMATS:
        expected = ", ".join(SAMPLE_FORMATS)
        raise InputError(f"output ends in {output.suffix or 'nothing'}, expected one of {expected}; rename {output}")
    OutputFolder(output.parent, output.stem, force=force).check([output.name])
    vertices, faces = make_sample(name) if resolution is None else make_sample(name, resolution=resolution)
    import trimesh

    mesh = trimesh.Trimesh(vertices, faces, process=False)
    write_whole(output, lambda path: mesh.export(path), force=force)
    return 0


@app.command
def doctor() -> int:
    """Versions, CPU features, torch device, ONNX providers, OpenGL renderer, and how to mend what is missing.

    Ends with 0 whatever it finds; what is missing is marked ✗ and followed by its remedy.
    """
    from .runtime.doctor import Finding, cpu, onnx_providers, packages, probe

    findings = [
        *packages(),
        Finding("CPU", cpu()),
        probe("ONNX providers", onnx_providers, "pip install onnxruntime"),
        probe("torch device", _torch_device, 'pip install "flexpara[train]"'),
        probe("OpenGL", _opengl, 'pip install "flexpara[bake]"; apt-get install libegl1 libgl1 libgl1-mesa-dri'),
    ]
    sys.stdout.write("".join(f"{finding}\n" for finding in findings))
    return 0


def _torch_device() -> str:
    torch = import_module("torch")
    return f"cuda: {torch.cuda.get_device_name()}" if torch.cuda.is_available() else "cpu"


def _opengl() -> str:
    info = import_module(".bake.context", __package__).describe()
    return f"{info.renderer}, {info.version}, up to {info.max_size} texels"


def _complain(message: str, code: int) -> int:
    """One line on stderr."""
    sys.stderr.write(f"flexpara: error: {' '.join(message.split())}\n")
    return code


def _names(text: str) -> tuple[str, ...]:
    """Comma-separated words; "none" is no word."""
    return () if text == "none" else tuple(word.strip() for word in text.split(",") if word.strip())


def _show(numbers: dict[str, Any], files: Sequence[Path]) -> None:
    """The summary on stdout: one figure a line, then the files."""
    lines = [
        f"{name.replace('_', ' '):<26} {form.format(numbers[name])}"
        for name, form in SUMMARY.items()
        if name in numbers
    ]
    sys.stdout.write("".join(f"{line}\n" for line in (*lines, *map(str, files))))


if __name__ == "__main__":
    sys.exit(main())
