"""The public API.  This repository's root folder is the package `flexpara`; this file only wires its folders together.

Nothing heavy is imported until it is used: `import flexpara` loads neither numpy, torch nor OpenGL.
uv are v up in [0, 1]² of the atlas; positions are in the units of the source file; sizes and paddings are in texels.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .runtime import aliases as _aliases  # noqa: F401  # `import flexpara.xatlas` is found through it
from .runtime import forks as _forks  # noqa: F401  # it has to be there before a process is forked
from .runtime.errors import FlexparaError

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    import trimesh
    from numpy.typing import NDArray

    from . import bake as bake
    from . import export as export
    from . import runtime as runtime
    from . import train as train
    from .bake.repack.repacked import pack as pack
    from .export import xatlas as xatlas
    from .export.assemble import Unwrapped
    from .export.tensors import Tensors
    from .runtime.files import OutputFolder
    from .runtime.io.meshfile import MeshLike
    from .runtime.io.meshfile import load as load
    from .runtime.io.points.cloud import CloudMesh, PointCloud
    from .runtime.mesh import Asset, Atlas, Charts, Frame
    from .runtime.options import Options, Outputs
    from .runtime.packoptions import PackOptions as PackOptions
    from .runtime.progress import Progress
    from .runtime.sessions.session import UnwrapSession
    from .train.deploy.gated import GatedExperts

__version__ = "0.1.0"
__all__ = [
    "Asset",
    "Atlas",
    "FlexparaError",
    "Options",
    "Outputs",
    "PackOptions",
    "UnwrapResult",
    "UnwrapSession",
    "load",
    "pack",
    "unwrap",
]

_HOME = {
    "Asset": "runtime.mesh",
    "Atlas": "runtime.mesh",
    "load": "runtime.io.meshfile",
    "Options": "runtime.options",
    "Outputs": "runtime.options",
    "PackOptions": "runtime.packoptions",
    "pack": "bake.repack.repacked",
    "UnwrapSession": "runtime.sessions.session",
}
_MODULES = ("bake", "export", "runtime", "train", "xatlas")


def __getattr__(name: str) -> object:
    """Load a public name, or one of the four folders or `xatlas`, the first time it is asked for."""
    if name in _HOME:
        return getattr(import_module(f".{_HOME[name]}", __name__), name)
    if name in _MODULES:
        return import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def unwrap(
    mesh: MeshLike | PointCloud, options: Options | None = None, *, progress: Progress | None = None, **keywords: Any
) -> UnwrapResult:
    """Unwrap a mesh, or a point cloud.

    Args:
        mesh: a path, a trimesh.Trimesh, (vertices (n, 3), faces (f, 3)), or a runtime.cloud.PointCloud.  A file
            without faces (.ply, .xyz, .npy, …) is a point cloud.
        options: what decides the result, see `flexpara.Options`; None: its defaults.
        progress: called as progress(stage, step, steps, loss); loss is None outside training.
        **keywords: fields of `flexpara.Options`, in place of those of options: charts=8, size=2048, seed=0, …

    Raises:
        InputError: the mesh or an option is wrong.
        MissingDependencyError: the packages of flexpara[unwrap] are absent.
        FinishError, ParityError: no valid atlas could be made, or its network could not be exported faithfully.
    """
    from .runtime.deadline import Deadline
    from .runtime.io.points.cloud import PointCloud
    from .runtime.options import Options, from_keywords
    from .runtime.progress import Clock

    options = from_keywords(Options, options, keywords)
    clock = Clock(progress, Deadline(options.time_budget))
    source = load_any(mesh, options.select)
    if isinstance(source, PointCloud):
        return unwrap_cloud(source, options, clock)
    return unwrap_asset(source, options, clock)


def load_any(source: MeshLike | PointCloud, select: tuple[str, ...] = ()) -> Asset | PointCloud:
    """A mesh as an Asset, a file without faces as a PointCloud.  select: as for `load`.

    Raises: InputError when it is neither.
    """
    from .runtime.io.meshfile import load
    from .runtime.io.points.cloud import PointCloud
    from .runtime.io.points.cloudfile import is_cloud, load_cloud

    if isinstance(source, PointCloud):
        return source
    if isinstance(source, str | Path) and is_cloud(Path(source)):
        return load_cloud(Path(source))
    return load(source, select)


def unwrap_asset(
    asset: Asset, options: Options, progress: Progress | None = None, keep: tuple[Path, int] | None = None
) -> UnwrapResult:
    """Train, finish, pack, measure, export.  keep: folder and interval of checkpoints.  Raises as `unwrap`."""
    from .runtime.extras import requires
    from .runtime.progress import Clock

    with requires("unwrap"):
        from .export.assemble import assemble
        from .runtime.io.shading import shaded
        from .runtime.pack.density import square_of
        from .train.presets import train_asset

    clock, asset = Clock.of(progress), shaded(asset, options.crease_angle)
    trained = train_asset(asset, options, clock, keep)
    return UnwrapResult(asset, assemble(asset, trained, clock, square_of(options)))


def unwrap_cloud(
    cloud: PointCloud, options: Options, progress: Progress | None = None, keep: tuple[Path, int] | None = None
) -> UnwrapResult:
    """Lay triangles over the points, then as `unwrap_asset`.

    Raises: as `unwrap`; MeshError where the points show no surface.
    """
    from .runtime.extras import requires
    from .runtime.progress import Clock

    with requires("unwrap"):
        from .export.assemble import assemble
        from .runtime.pack.density import square_of
        from .train.presets import train_cloud

    clock = Clock.of(progress)
    mesh, trained = train_cloud(cloud, options, clock, keep)
    found = assemble(mesh.asset, trained, clock, square_of(options))
    return UnwrapResult(mesh.asset, found, cloud, mesh)


@dataclass(frozen=True, eq=False)
class UnwrapResult:
    """An unwrapped mesh or point cloud.

    asset: the mesh as read and cleaned, with normals, or the triangles laid over the points.  found: what came of it.
    cloud, cloud_mesh: of a point cloud, the points and where each lies on those triangles; else None.
    """

    asset: Asset
    found: Unwrapped = field(repr=False)
    cloud: PointCloud | None = field(default=None, repr=False)
    cloud_mesh: CloudMesh | None = field(default=None, repr=False)

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
        """Packed charts; source_vertex counts the vertices of the file, not those that normals split."""
        from .runtime.io.shading import with_file_vertices

        return with_file_vertices(self.found.atlas, self.asset)

    def point_uv(self) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Of a point cloud: uv (n, 2) float32 in [0, 1], v up, and chart (n,) int64 of each of its points.

        Raises: InputError for a mesh, whose uv are those of the atlas.
        """
        from .runtime.errors import InputError
        from .runtime.io.points.cloud import point_uv

        if self.cloud_mesh is None:
            raise InputError("point_uv of a mesh, expected a point cloud; use result.atlas")
        return point_uv(self.cloud_mesh, self.atlas)

    @property
    def model(self) -> GatedExperts:
        """The networks behind the ONNX file, in numpy: unit ball (n, 3) float32 → chart coordinates, chart, score."""
        return self.found.model

    @property
    def onnx(self) -> bytes:
        """The bytes of the ONNX file."""
        return self.found.onnx

    @property
    def report(self) -> dict[str, Any]:
        """Changes, settings, metrics, agreement of network and atlas, seconds; ready for JSON."""
        return self.found.report

    def to_trimesh(self) -> trimesh.Trimesh:
        """The unwrapped mesh with its uv, v up, as texture visual; vertices are doubled along seams."""
        import trimesh
        from trimesh.visual import TextureVisuals

        visual = TextureVisuals(uv=self.atlas.uv)
        return trimesh.Trimesh(self.atlas.positions, self.atlas.faces, visual=visual, process=False)

    def to_torch(self, device: str = "cpu") -> Tensors:
        """The atlas as tensors on a device, as nvdiffrast takes them: float32, faces int32.

        Raises: MissingDependencyError: torch is absent.
        """
        from .runtime.extras import requires

        with requires("train"):
            from .export.tensors import as_tensors
        return as_tensors(self.atlas, device)

    def save(
        self,
        folder: str | Path,
        outputs: Outputs | None = None,
        *,
        force: bool = False,
        progress: Progress | None = None,
        **keywords: Any,
    ) -> tuple[Path, ...]:
        """Write mesh, ONNX file, textures, preview and report, all or none; returns their paths.

        Args:
            folder: made where it is absent.
            outputs: what is written, see `flexpara.Outputs`; None: its defaults.
            force: whether files are overwritten that flexpara did not write.
            progress: as for `unwrap`.
            **keywords: fields of `flexpara.Outputs`, in place of those of outputs: maps=("normal",), preview=False, …

        Raises:
            InputError: an unknown map, format, target or keyword.
            ForeignFileError: a file is in the way that flexpara did not write, and force is off.
            MissingDependencyError: the packages of flexpara[bake] are absent.
        """
        from .runtime.files import OutputFolder
        from .runtime.options import Outputs, from_keywords

        outputs = from_keywords(Outputs, outputs, keywords)
        with OutputFolder(Path(folder), self.asset.stem, force=force) as output:
            return self.write(output, outputs, progress)

    def write(
        self,
        output: OutputFolder,
        outputs: Outputs,
        progress: Progress | None = None,
        note: Callable[[str], None] | None = None,
    ) -> tuple[Path, ...]:
        """As `save`, into an open OutputFolder.  note: called with each fact of the result that a user should know."""
        from .bake.checks import check_outputs, chosen_maps
        from .bake.output import BakeJob, texture_notes, write_outputs, write_reports, written_notes
        from .export.assemble import invert
        from .runtime.io.changes import lost, told
        from .runtime.progress import Clock

        outputs = outputs.for_asset(self.asset)
        outputs = outputs if self.cloud is None else outputs.for_points()
        maps = chosen_maps(outputs, seed=self.report["settings"]["seed"])
        check_outputs(output, outputs, maps, more=() if self.cloud is None else point_files(output.stem))
        clock, report = Clock(progress), {**self.report, "outputs": asdict(outputs)}
        report["changes"] = {**report["changes"], **lost(self.asset, outputs)}
        networks = {"onnx": self.onnx}
        if self.found.paper is not None:
            networks["paper.onnx"] = self.found.paper
        if outputs.inverse:
            networks["wrap.onnx"], report["inverse"] = invert(self.asset, self.found, clock)
        for ending, content in networks.items():
            output.write(f"{output.stem}.{ending}", lambda path, content=content: path.write_bytes(content))
        if self.cloud is not None:
            self._write_points(output, self.cloud)
        apart = report["metrics"]["overlap_fraction"] == 0.0
        job = BakeJob.of(self.found.atlas, self.asset, outputs, maps)
        report |= write_outputs(output, job, clock, apart=apart)
        if cut := report.pop("polygons_cut"):
            report["changes"]["polygons_cut"] = cut
        if note is not None:
            for fact in told({"polygons_cut": cut}):
                note(f"{self.asset.stem}: {fact}")
            for fact in (*written_notes(report["written"]), *texture_notes(report["textures"])):
                note(fact)
        seconds = {name: round(value, 3) for name, value in clock.seconds.items()}
        write_reports(output, job, {**report, "seconds": {**report["seconds"], **seconds}})
        return output.commit()

    def _write_points(self, output: OutputFolder, cloud: PointCloud) -> None:
        """The user's points with their uv and chart, as .npz and, in place of the mesh, as .ply."""
        from .runtime.io.ply.write import write_cloud_ply
        from .runtime.io.points.cloudfile import write_cloud_npz

        uv, chart = self.point_uv()
        for name, write in zip(point_files(output.stem), (write_cloud_ply, write_cloud_npz), strict=True):
            output.write(name, lambda path, write=write: write(path, cloud, uv, chart))


def point_files(stem: str) -> tuple[str, str]:
    """The files that hold the points of a cloud."""
    return f"{stem}.ply", f"{stem}.npz"
