"""The command line: `flexpara …` and `python -m flexpara …`.  Wiring only: options in, one call, files and summary out.

Results and summaries go to stdout, progress and errors to stderr.  Exit codes: 0 done · 1 a defect (traceback) ·
2 bad input or options · 3 a dependency is missing · 130 interrupted.  Sizes and paddings are in texels.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cyclopts import App
from cyclopts.exceptions import CycloptsError

from . import __version__, load, unwrap_asset
from .bake.commands import bake
from .bake.output import check_maps, check_outputs
from .runtime.commands import evaluate, query, sample
from .runtime.console import Flag, Output, complain, names, show
from .runtime.errors import FlexparaError
from .runtime.options import Options, Outputs
from .runtime.progress import progress_bars

if TYPE_CHECKING:
    from collections.abc import Sequence

INTERRUPTED = 130
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
    outputs = Outputs(names(maps), names(format), preview, texture_format, normal_format)
    check_maps(outputs.maps)
    from .runtime.files import OutputFolder

    asset = load(mesh)
    with OutputFolder(output, asset.stem, force=force, source=mesh) as folder:
        check_outputs(folder, outputs.for_asset(asset), size)
        with progress_bars(quiet=quiet) as progress:
            result = unwrap_asset(asset, options, progress)
            written = result.write(folder, outputs.for_asset(asset), progress)
    if not quiet:
        show({**result.report["metrics"], **result.report["network"]}, written)
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


if __name__ == "__main__":
    sys.exit(main())
