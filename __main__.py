"""The command line: `flexpara …` and `python -m flexpara …`.  Wiring only: options in, one call, files and summary out.

Results and summaries go to stdout, progress and errors to stderr.  Exit codes: 0 done · 1 a defect (traceback) ·
2 bad input or options · 3 a dependency is missing · 130 interrupted.  Sizes and paddings are in texels.
"""

from __future__ import annotations

import os
import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NoReturn

from cyclopts import App
from cyclopts.exceptions import CycloptsError

from . import UnwrapResult, __version__, load, load_any, unwrap_asset, unwrap_cloud
from .bake.commands import bake
from .bake.output import check_outputs, chosen_maps, padding_of
from .runtime.commands import evaluate, query, sample
from .runtime.console import Flag, Output, complain, names, show
from .runtime.errors import FlexparaError, InputError
from .runtime.extras import requires
from .runtime.options import Options, Outputs
from .runtime.progress import Clock, progress_bars
from .runtime.runfile import Run

if TYPE_CHECKING:
    from collections.abc import Sequence

INTERRUPTED = 130
TRAINED = "trained.safetensors"
app = App(
    name="flexpara",
    help="UV atlases with few charts and little distortion, an ONNX file that knows them, and baked textures.",
    version=__version__,
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
for command in (query, bake, evaluate, sample):
    app.command(command)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code.  argv: the words after `flexpara`, those of the process by default."""
    try:
        return app(argv, exit_on_error=False, print_error=False) or 0
    except CycloptsError as error:
        return complain(f"{error} See: {' '.join(['flexpara', *(error.command_chain or ()), '--help'])}", 2)
    except FlexparaError as error:
        return complain(str(error), error.exit_code)
    except KeyboardInterrupt:
        return complain("interrupted, nothing half-written is left", INTERRUPTED)


def run() -> NoReturn:
    """`main` for a process of its own: ends without taking torch and OpenGL down piece by piece, which takes 0.6 s."""
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


@app.command
def unwrap(
    mesh: Path | None = None,
    *,
    output: Output | None = None,
    charts: int = 8,
    size: int = 2048,
    padding: int | None = None,
    maps: str = "auto",
    format: str = "glb",
    texture_format: Literal["png", "exr"] | None = None,
    normal_format: Literal["opengl", "directx"] = "opengl",
    target: str | None = None,
    samples: int = 1,
    rays: int = 64,
    inverse: Flag = False,
    preview: bool | None = None,
    seed: int = 0,
    preset: str = "fast",
    mode: str = "multi-chart",
    steps: int | None = None,
    width: int | None = None,
    points: int | None = None,
    precision: str = "float32",
    ablation: str = "none",
    checkpoint_every: int | None = None,
    resume: Path | None = None,
    quiet: Flag = False,
    force: Flag = False,
) -> int:
    """Unwrap a mesh or a point cloud into an atlas of few charts, an ONNX file and textures.

    Args:
        mesh: any file trimesh reads: obj, ply, stl, glb, gltf, off, …; or points: ply without faces, xyz, csv, npy
        output: folder for STEM.glb, STEM.onnx, STEM_MAP.png or .exr, STEM.report.json and STEM.preview.png
        charts: the most charts a connected surface may get
        size: atlas side, texels
        padding: texels kept free around each chart (default: size / 256, at least 2)
        maps: comma-separated, see bake; auto: normal, position, and what the source's materials have, or else a
            checker; none: uv only
        format: mesh files, comma-separated: glb, obj, ply, usda
        texture_format: of all maps that can be stored so (default: each map's own)
        normal_format: green channel of the normal map: opengl (+Y) or directx (-Y)
        target: gltf, unreal, unity, godot, blender or usd: file names, packing, depth, green channel and padding
        samples: of each texel: 1, 4 or 16
        rays: of ray-traced maps, per sample
        inverse: also write STEM.wrap.onnx: uv and chart to point and normal
        preview: draw STEM.preview.png (default: where maps are drawn)
        seed: same seed, same machine, same bytes
        preset: fast: seconds on a CPU; paper: trained as published, best on a GPU
        mode: of preset paper: multi-chart or global (one chart)
        steps: of preset paper (default: 10000)
        width: channels of its hidden layers (default: 512)
        points: of the surface, in each of its steps (default: 4900); fewer is faster
        precision: of its products: float32 or bfloat16
        ablation: its parts left out or added, comma-separated: no-triangle, no-differential, no-upper, no-lower;
            bidirectional, chart-differential
        checkpoint_every: steps of preset paper between checkpoints
        resume: output folder of a run with checkpoints that was cut short; takes no other options
        quiet: no progress, no summary
        force: overwrite files that flexpara did not write
    """
    if resume is not None:
        from .runtime.runfile import find_run

        return _perform(find_run(resume), quiet=quiet, force=force)
    if mesh is None or output is None:
        missing = "--mesh" if mesh is None else "--output"
        raise InputError(f"{missing} is missing, expected a mesh and an output folder; see flexpara unwrap --help")
    margin = padding_of(padding, target, size)
    options = Options(charts, size, margin, seed, preset, mode, steps, width, points, precision, names(ablation))
    kinds = texture_format, normal_format
    drawn = bool(names(maps)) if preview is None else preview
    outputs = Outputs(names(maps), names(format), drawn, *kinds, inverse, target, samples=samples, rays=rays)
    run = Run(mesh.absolute(), output, options, outputs, checkpoint_every)
    return _perform(run, quiet=quiet, force=force)


def _perform(run: Run, *, quiet: bool, force: bool) -> int:
    """One unwrap, from its beginning or its last checkpoint."""
    from .runtime.files import OutputFolder
    from .runtime.mesh import Asset

    chosen_maps(run.outputs)
    source = load_any(run.mesh)
    with OutputFolder(run.output, source.stem, force=force, source=run.mesh) as folder:
        if isinstance(source, Asset):
            outputs = run.outputs.for_asset(source)
            check_outputs(folder, outputs, chosen_maps(outputs))
        run.save()
        with progress_bars(quiet=quiet) as progress:
            if isinstance(source, Asset):
                result = unwrap_asset(source, run.options, progress, run.keep)
            else:
                result = unwrap_cloud(source, run.options, progress, run.keep)
            written = result.write(folder, run.outputs, progress)
    run.forget()
    if not quiet:
        show({**result.report["metrics"], **result.report["network"]}, written)
    return 0


@app.command
def train(
    mesh: Path,
    *,
    output: Output,
    charts: int = 8,
    seed: int = 0,
    preset: str = "fast",
    mode: str = "multi-chart",
    steps: int | None = None,
    width: int | None = None,
    points: int | None = None,
    precision: str = "float32",
    ablation: str = "none",
    quiet: Flag = False,
    force: Flag = False,
) -> int:
    """The first half of unwrap: charts and networks, as STEM.trained.safetensors for flexpara export.

    Args:
        mesh: any file trimesh reads
        output: folder for STEM.trained.safetensors and STEM.train.json
        charts: the most charts a connected surface may get
        seed: same seed, same machine, same bytes
        preset: fast: seconds on a CPU; paper: trained as published, best on a GPU
        mode: of preset paper: multi-chart or global (one chart)
        steps: of preset paper (default: 10000)
        width: channels of its hidden layers (default: 512)
        points: of the surface, in each of its steps (default: 4900); fewer is faster
        precision: of its products: float32 or bfloat16
        ablation: its parts left out or added, see unwrap
        quiet: no progress, no summary
        force: overwrite files that flexpara did not write
    """
    options = Options(
        charts=charts,
        seed=seed,
        preset=preset,
        mode=mode,
        steps=steps,
        width=width,
        points=points,
        precision=precision,
        ablation=names(ablation),
    )
    from .runtime.files import OutputFolder

    asset = load(mesh)
    name = f"{asset.stem}.{TRAINED}"
    with OutputFolder(output, asset.stem, force=force, source=mesh, report=f"{asset.stem}.train.json") as folder:
        folder.check([name, folder.report_name])
        with requires("train"):
            from .export.unwrapping import train_asset
            from .train.saved import to_bytes
        with progress_bars(quiet=quiet) as progress:
            trained = train_asset(asset, options, Clock(progress))
        folder.write(name, lambda path: path.write_bytes(to_bytes(trained, asset.sha256)))
        source = {"stem": asset.stem, "sha256": asset.sha256, "faces": len(asset.faces)}
        facts = {"version": __version__, "source": source, "settings": trained.settings, "train": trained.report}
        folder.write_report(facts)
        written = folder.commit()
    if not quiet:
        show({}, written)
    return 0


@app.command
def export(
    trained: Path,
    mesh: Path,
    *,
    output: Output,
    size: int = 2048,
    padding: int | None = None,
    maps: str = "none",
    format: str = "glb",
    inverse: Flag = False,
    preview: bool = True,
    quiet: Flag = False,
    force: Flag = False,
) -> int:
    """The second half of unwrap: pack what flexpara train found, export the ONNX file, write the mesh, bake.

    Args:
        trained: STEM.trained.safetensors
        mesh: the mesh it was trained on
        output: folder for what unwrap writes
        size: atlas side, texels
        padding: texels kept free around each chart (default: size / 256, at least 2)
        maps: comma-separated, see unwrap
        format: mesh files, comma-separated: glb, obj, ply
        inverse: also write STEM.wrap.onnx: uv and chart to point and normal
        preview: draw STEM.preview.png
        quiet: no progress, no summary
        force: overwrite files that flexpara did not write
    """
    options = Options(size=size, padding=padding)
    outputs = Outputs(names(maps), names(format), preview, inverse=inverse)
    chosen_maps(outputs)
    from .runtime.files import OutputFolder

    asset = load(mesh)
    with OutputFolder(output, asset.stem, force=force, source=mesh) as folder:
        check_outputs(folder, outputs.for_asset(asset), chosen_maps(outputs.for_asset(asset)))
        with requires("train"):
            from .export.unwrapping import assemble
            from .train.saved import read_trained
        with progress_bars(quiet=quiet) as progress:
            found = assemble(asset, read_trained(trained, asset), Clock(progress), size=size, padding=options.margin)
            written = UnwrapResult(asset, found).write(folder, outputs, progress)
    if not quiet:
        show({**found.report["metrics"], **found.report["network"]}, written)
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
    info = import_module(".bake.raster.context", __package__).describe()
    return f"{info.renderer}, {info.version}, up to {info.max_size} texels"


if __name__ == "__main__":
    run()
