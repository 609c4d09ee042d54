"""The public API.  This repository's root folder is the package `flexpara`; this file only wires its folders together.

Nothing heavy is imported until it is used: `import flexpara` loads neither numpy, torch nor OpenGL.
uv are v up in [0, 1]² of the atlas; positions are in the units of the source file; sizes and paddings are in texels.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .runtime.errors import FlexparaError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from . import bake as bake
    from . import export as export
    from . import runtime as runtime
    from . import train as train
    from .export.unwrapping import Unwrapped
    from .runtime.files import OutputFolder
    from .runtime.mesh import Asset, Atlas, Charts, Frame
    from .runtime.meshfile import MeshLike
    from .runtime.meshfile import load as load
    from .runtime.options import Options, Outputs
    from .runtime.progress import Progress
    from .runtime.session import UnwrapSession
    from .train.networks import AtlasNetworks

__version__ = "0.1.0"
__all__ = ["Asset", "Atlas", "FlexparaError", "Options", "Outputs", "UnwrapResult", "UnwrapSession", "load", "unwrap"]

_HOME = {
    "Asset": "mesh",
    "Atlas": "mesh",
    "load": "meshfile",
    "Options": "options",
    "Outputs": "options",
    "UnwrapSession": "session",
}
_FOLDERS = ("bake", "export", "runtime", "train")


def __getattr__(name: str) -> object:
    """Load a public name, or one of the four folders, the first time it is asked for."""
    if name in _HOME:
        return getattr(import_module(f".runtime.{_HOME[name]}", __name__), name)
    if name in _FOLDERS:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def unwrap(
    mesh: MeshLike,
    *,
    charts: int = 8,
    size: int = 2048,
    padding: int | None = None,
    seed: int = 0,
    preset: str = "fast",
    mode: str = "multi-chart",
    steps: int | None = None,
    width: int | None = None,
    precision: str = "float32",
    ablation: Sequence[str] = (),
    progress: Progress | None = None,
) -> UnwrapResult:
    """Unwrap a mesh.

    Args:
        mesh: a path, a trimesh.Trimesh, or (vertices (n, 3), faces (f, 3)).
        charts: the most charts a connected surface may get.
        size: atlas side, texels.
        padding: texels kept free around each chart; None is size / 256, at least 2.
        seed: same seed, same machine, same atlas and network.
        preset: "fast" is seconds on a CPU; "paper" trains as published (Zhao et al. 2025), best on a GPU.
        mode: of preset paper: "multi-chart" or "global", one chart.
        steps: of preset paper; None as published (10,000).
        width: channels of its hidden layers; None as published (512).
        precision: of its products: "float32" or "bfloat16".
        ablation: parts of its losses left out or added, see runtime.options.ABLATIONS.
        progress: called as progress(stage, step, steps, loss); loss is None outside training.

    Raises:
        InputError: the mesh or an option is wrong.
        MissingDependencyError: the packages of flexpara[train] are absent.
        FinishError, ParityError: no valid atlas could be made, or its network could not be exported faithfully.
    """
    from .runtime.meshfile import load
    from .runtime.options import Options

    options = Options(charts, size, padding, seed, preset, mode, steps, width, precision, tuple(ablation))
    return unwrap_asset(load(mesh), options, progress)


def unwrap_asset(
    asset: Asset, options: Options, progress: Progress | None = None, keep: tuple[Path, int] | None = None
) -> UnwrapResult:
    """Train, finish, pack, measure, export.  keep: folder and interval of checkpoints.  Raises as `unwrap`."""
    from .runtime.extras import requires
    from .runtime.progress import Clock

    with requires("train"):
        from .export.unwrapping import assemble, train_asset

    clock = Clock(progress)
    trained = train_asset(asset, options, clock, keep)
    return UnwrapResult(asset, assemble(asset, trained, clock, size=options.size, padding=options.margin))


@dataclass(frozen=True, eq=False)
class UnwrapResult:
    """An unwrapped mesh.  asset: the mesh as read and cleaned.  found: what came of it."""

    asset: Asset
    found: Unwrapped = field(repr=False)

    @property
    def charts(self) -> Charts:
        """Flat, not packed."""
        return self.found.charts

    @property
    def frame(self) -> Frame:
        """Source units → unit ball."""
        return self.found.frame

    @property
    def atlas(self) -> Atlas:
        """Packed charts."""
        return self.found.atlas

    @property
    def model(self) -> AtlasNetworks:
        """The torch module behind the ONNX file."""
        return self.found.model

    @property
    def onnx(self) -> bytes:
        """The bytes of the ONNX file."""
        return self.found.onnx

    @property
    def report(self) -> dict[str, Any]:
        """Changes, settings, metrics, agreement of network and atlas, seconds; ready for JSON."""
        return self.found.report

    def save(
        self,
        folder: str | Path,
        *,
        maps: Sequence[str] = ("auto",),
        formats: Sequence[str] = ("glb",),
        preview: bool = True,
        inverse: bool = False,
        force: bool = False,
        progress: Progress | None = None,
    ) -> tuple[Path, ...]:
        """Write mesh, ONNX file, textures, preview and report, all or none; returns their paths.  See Outputs.

        Raises:
            InputError: an unknown map or format, or a size that this OpenGL device can't draw.
            ForeignFileError: a file is in the way that flexpara did not write, and force is off.
            MissingDependencyError: the packages of flexpara[bake], or OpenGL, are absent.
        """
        from .bake.output import check_outputs
        from .runtime.files import OutputFolder
        from .runtime.options import Outputs

        outputs = Outputs(tuple(maps), tuple(formats), preview, inverse=inverse).for_asset(self.asset)
        with OutputFolder(Path(folder), self.asset.stem, force=force) as output:
            check_outputs(output, outputs, self.atlas.size)
            return self.write(output, outputs, progress)

    def write(self, output: OutputFolder, outputs: Outputs, progress: Progress | None = None) -> tuple[Path, ...]:
        """As `save`, into an open OutputFolder; outputs without "auto"."""
        from .bake.output import write_outputs
        from .export.unwrapping import invert
        from .runtime.progress import Clock

        clock, report = Clock(progress), dict(self.report)
        output.write(f"{output.stem}.onnx", lambda path: path.write_bytes(self.onnx))
        if outputs.inverse:
            content, report["inverse"] = invert(self.asset, self.found, clock)
            output.write(f"{output.stem}.wrap.onnx", lambda path: path.write_bytes(content))
        write_outputs(output, self.atlas, self.asset, outputs, clock)
        seconds = {name: round(value, 3) for name, value in clock.seconds.items()}
        output.write_report({**report, "seconds": {**report["seconds"], **seconds}})
        return output.commit()
