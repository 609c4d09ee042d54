"""The command line: `flexpara …` and `python -m flexpara …`.  Wiring only: options in, one call, files and summary out.

Results and summaries go to stdout, progress and errors to stderr.  Exit codes: 0 done · 1 a defect (traceback) ·
2 bad input or options · 3 a dependency is missing · 130 interrupted.  Sizes and paddings are in texels.
"""

from __future__ import annotations

import os
import sys
from contextlib import nullcontext
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Annotated, NoReturn

from cyclopts import App, Parameter
from cyclopts.exceptions import CycloptsError

from . import UnwrapResult, __version__, load, unwrap_asset, unwrap_asset_pages, unwrap_cloud
from .bake.checks import check_outputs, chosen_maps, padding_of
from .bake.commands import bake
from .bake.highsource import high_source, mesh_maps
from .bake.repack.commands import pack
from .bake.report.commands import report
from .runtime.batch.commands import batch
from .runtime.cli.commands import evaluate, query, sample
from .runtime.cli.console import Console, Manners, complain
from .runtime.cli.inputs import STREAM, from_stdin, like_option, meshes_of
from .runtime.cli.runfile import Run
from .runtime.errors import FlexparaError, InputError
from .runtime.extras import requires
from .runtime.options.atlas import AtlasOptions
from .runtime.options.unwrap import SHARINGS, CheckpointOptions, Options, Output, Outputs
from .runtime.options.words import Names
from .runtime.process.deadline import Deadline, interrupts_ask
from .runtime.process.heap import keep_freed_memory
from .runtime.process.progress import Clock
from .train.commands import train

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .bake.highpoly.highmaps import HighSource
    from .runtime.files import OutputFolder
    from .runtime.mesh import Asset

INTERRUPTED = 130
CHARTS = Parameter(name="*", group="Charts and atlas")
FILES = Parameter(name="*", group="Maps and files")
"""Options of a class, under a heading in the help."""
app = App(
    name="flexpara",
    help="UV atlases with few charts and little distortion, an ONNX file that knows them, and baked textures.",
    version=__version__,
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
for command in (batch, query, train, bake, pack, evaluate, report, sample):
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
    keep_freed_memory()
    code = main()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


@app.command
def unwrap(
    *mesh: Annotated[Path, Parameter(allow_leading_hyphen=True)],
    output: Annotated[Output | None, Parameter(name=["--output", "-o"], allow_leading_hyphen=True)] = None,
    options: Annotated[Options, CHARTS] = Options(),
    outputs: Annotated[Outputs, FILES] = Outputs(),
    checkpoints: Annotated[CheckpointOptions, Parameter(name="*")] = CheckpointOptions(),
    compare: Names = (),
    console: Manners = Console(),
) -> int:
    """Unwrap meshes or point clouds into an atlas of few charts, an ONNX file and textures each.

    Args:
        mesh: Meshes (obj, ply, stl, glb, gltf, off, or what else trimesh reads), points (ply without faces, xyz, csv,
            npy), folders of meshes, or - for one on standard input.
        output: The folder for STEM.glb, STEM.onnx, STEM_MAP.png or .exr, STEM.report.json and STEM.preview.png, or -
            for one glb, obj, ply, usda or npz on standard output.
        options: See Options.
        outputs: See Outputs.
        checkpoints: See CheckpointOptions.
        compare: Numbers of charts, as 1,2,4,8,16: for each a line of a table, also in STEM.compare.json, and a picture
            in STEM.compare.png, and no mesh; with --report also STEM.compare.html.
        console: See Console.
    """
    if checkpoints.resume is not None:
        asked = mesh, output, options, outputs, checkpoints.every
        if asked != ((), None, Options(), Outputs(), None):
            raise InputError("resume beside other options, expected none, as the run keeps its own; leave them out")
        from .runtime.cli.runfile import find_run

        return _perform(find_run(checkpoints.resume), console)
    for word in (str(path) for path in mesh if str(path).startswith("-") and path != STREAM):
        remedy = like_option(word, app["unwrap"])
        raise InputError(f"unknown option {word}, expected those of flexpara unwrap; {remedy}")
    if not mesh or output is None:
        missing = "--output" if mesh else "MESH"
        raise InputError(f"{missing} is missing, expected a mesh and an output folder; see flexpara unwrap --help")
    options = replace(options, padding=_padding(options, outputs))
    if compare:
        return _compare(mesh, output, options, compare, console, report=outputs.report)
    if STREAM in mesh or output == STREAM:
        return _stream(mesh, output, options, outputs, console)
    runs = [Run(path.absolute(), output, options, outputs, checkpoints.every) for path in meshes_of(mesh)]
    return _perform(runs[0], console) if len(runs) == 1 else max(_one_of_several(entry, console) for entry in runs)


def _compare(
    mesh: Sequence[Path], output: Path, options: Options, words: Sequence[str], console: Console, *, report: bool
) -> int:
    """A table and a sheet of each mesh with several numbers of charts; a page to turn them around, where asked."""
    from .bake.pictures.comparison import compare
    from .bake.results.compared import TABLE, compared_files, write_comparison
    from .runtime.files import OutputFolder

    for path in meshes_of(mesh):
        asset = load(path, options.select)
        table = TABLE.format(asset.stem)
        with OutputFolder(output, asset.stem, force=console.force, report=table) as folder:
            folder.check([*compared_files(asset.stem, page=report), table])
            with console.progress() as progress:
                found = compare(options, words, lambda each, asset=asset: unwrap_asset(asset, each, progress))
                written = write_comparison(folder, found, page=report)
        console.show({}, written)
        sys.stdout.write("" if console.quiet else found.table)
    return 0


def _one_of_several(run: Run, console: Console) -> int:
    """One unwrap, whose failure keeps none of the others from being made."""
    try:
        return _perform(run, console)
    except FlexparaError as error:
        return complain(f"{run.mesh.name}: {error}", error.exit_code)


def unwrap_one(run: Run) -> None:
    """One unwrap of a batch, without a word: files and their report are what there is to know."""
    options = replace(run.options, padding=_padding(run.options, run.outputs))
    console = Console(quiet=True, force=run.force, strict=run.strict)
    _perform(replace(run, options=options), console, summary=False)


def _stream(mesh: Sequence[Path], output: Path, options: Options, outputs: Outputs, console: Console) -> int:
    """One unwrap from standard input, to standard output, or both."""
    if len(mesh) > 1 or (output == STREAM and (len(outputs.formats) > 1 or "gltf" in outputs.formats)):
        found = f"{len(mesh)} meshes as {', '.join(outputs.formats)}"
        raise InputError(f"{found} through a stream, expected one mesh and one file; pass for instance --format glb")
    with TemporaryDirectory() as folder:
        source = from_stdin(Path(folder)) if mesh[0] == STREAM else mesh[0].absolute()
        if output != STREAM:
            return _perform(Run(source, output, options, outputs), console)
        if "glb" not in outputs.formats:  # whose pictures would be files beside it
            outputs = replace(outputs, maps=())
        run = Run(source, Path(folder) / "out", options, replace(outputs, preview=False, report=False))
        code = _perform(run, console, summary=False)
        kind = ",".join(outputs.formats)
        sys.stdout.buffer.write((run.output / f"{source.stem}.{kind}").read_bytes())
        sys.stdout.buffer.flush()
    return code


def _padding(options: AtlasOptions, outputs: Outputs) -> int | None:
    """The padding asked for, by number or by target."""
    return padding_of(options.padding, outputs.target, options.page.side, light=outputs.uv_set is not None)


def _check_files(run: Run, folder: OutputFolder, source: Asset, high: HighSource | None) -> None:
    """Refuse before the work what writing would refuse after it.  Raises: as `check_outputs`, `check_pages`."""
    outputs = mesh_maps(run.outputs, source, high)
    check_outputs(folder, outputs, chosen_maps(outputs, high=high))
    if run.options.udim:
        run.outputs.for_tiles()
    elif run.options.pages > 1:
        run.outputs.for_pages()
    if run.options.atlas != SHARINGS[0]:
        from .runtime.io.asset.pages import pages_of

        with requires("bake"):
            from .bake.files.gltfmade import with_document
            from .bake.results.pages import check_pages
        check_pages(folder, run.outputs, pages_of(with_document(source), run.options.atlas))


def _perform(run: Run, console: Console, *, summary: bool = True) -> int:
    """One unwrap, from its beginning or its last checkpoint."""
    from .runtime.files import OutputFolder
    from .runtime.io.anyfile import load_any
    from .runtime.io.asset.changes import lost
    from .runtime.mesh import Asset

    high = high_source(run.outputs, run.options.crease_angle)
    chosen_maps(run.outputs, high=high)
    deadline = Deadline(run.options.time_budget)
    with console.progress() as progress:
        source = load_any(run.mesh, run.options.select)
        with OutputFolder(run.output, source.stem, force=console.force, source=run.mesh) as folder:
            if isinstance(source, Asset):
                console.note_changes(source, lost(source, mesh_maps(run.outputs, source, high)))
                _check_files(run, folder, source, high)
            run.save()
            clock, ending = Clock(progress, deadline), nullcontext()
            if run.options.preset == "fast":  # preset paper has checkpoints
                ending = interrupts_ask(deadline, console.note)
            with ending:
                if not isinstance(source, Asset):
                    result = unwrap_cloud(source, run.options, clock, run.keep)
                elif not run.options.several:
                    result = unwrap_asset(source, run.options, clock, run.keep)
                else:
                    result = unwrap_asset_pages(source, run.options, clock)
            held = {"high": high} if high is not None else {}  # several atlases have none
            written = result.write(folder, run.outputs, progress, console.note, **held)
            stale = sorted(set(folder.kept) - {path.name for path in written})
    if not isinstance(source, Asset):
        console.note_changes(result.asset)
    run.forget()
    if stale:
        console.note(f"{source.stem}: of an earlier run, whose uv may be others: {', '.join(stale)}")
    console.figures(result.reports, shown=summary)
    console.show({}, written if summary else ())
    return 0


@app.command
def export(
    trained: Path,
    mesh: Path,
    *,
    output: Output,
    options: Annotated[AtlasOptions, CHARTS] = AtlasOptions(),
    outputs: Annotated[Outputs, FILES] = Outputs(),
    console: Manners = Console(),
) -> int:
    """Do the second half of unwrap: pack what flexpara train found, export the ONNX file, write the mesh, bake.

    Args:
        trained: STEM.trained.safetensors.
        mesh: The mesh that it was trained on.
        output: The folder for what unwrap writes.
        options: See AtlasOptions.
        outputs: See Outputs.
        console: See Console.
    """
    options = replace(options, padding=_padding(options, outputs))
    high = high_source(outputs, options.crease_angle)
    chosen_maps(outputs, high=high)
    from .runtime.files import OutputFolder
    from .runtime.io.asset.changes import lost
    from .runtime.io.asset.shading import shaded

    asset = shaded(load(mesh, options.select), options.crease_angle)
    with OutputFolder(output, asset.stem, force=console.force, source=mesh) as folder:
        outputs = mesh_maps(outputs, asset, high)
        console.note_changes(asset, lost(asset, outputs))
        check_outputs(folder, outputs, chosen_maps(outputs, high=high))
        with requires("unwrap"):
            from .export.assemble import assemble
            from .runtime.pack.square import square_of
            from .train.saved import read_trained
        with console.progress() as progress:
            found = assemble(asset, read_trained(trained, asset), Clock(progress), square_of(options))
            written = UnwrapResult(asset, found).write(folder, outputs, progress, console.note, high)
    console.show({**found.report["metrics"], **found.report["network"]}, written)
    return 0


@app.command
def doctor() -> int:
    """Show versions, CPU features, torch device, ONNX providers, OpenGL renderer, and how to install what is missing.

    The command ends with 0 whatever it finds. What is missing is marked ✗ and followed by its remedy.
    """
    from .runtime.cli.doctor import Finding, cpu, onnx_providers, packages, probe
    from .runtime.kernel.choice import describe

    findings = [
        *packages(),
        Finding("CPU", cpu()),
        probe("kernel", describe, "install a C++ compiler, and flexpara again"),
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
