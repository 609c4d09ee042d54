"""The public API.  This repository's root folder is the package `flexpara`; this file only wires its folders together.

Nothing heavy is imported until it is used: `import flexpara` loads neither numpy, torch nor OpenGL.
uv are v up in [0, 1]² of the atlas; positions are in the units of the source file; sizes and paddings are in texels.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .runtime import aliases as _aliases  # noqa: F401  # `import flexpara.xatlas` is found through it
from .runtime.errors import FlexparaError
from .runtime.process import forks as _forks  # noqa: F401  # it has to be there before a process is forked
from .runtime.saving import Unwrapping

if TYPE_CHECKING:
    from collections.abc import Callable

    import numpy as np
    import trimesh
    from numpy.typing import NDArray

    from . import bake as bake
    from . import export as export
    from . import runtime as runtime
    from . import train as train
    from .bake.highpoly.highmaps import HighSource
    from .bake.repack.repacked import pack as pack
    from .export.assemble import Unwrapped
    from .export.dropin import xatlas as xatlas
    from .export.tensors import Tensors
    from .runtime.files import OutputFolder
    from .runtime.io.meshfile import MeshLike
    from .runtime.io.meshfile import load as load
    from .runtime.io.points.cloud import CloudMesh, PointCloud
    from .runtime.mesh import Asset, Atlas, Charts, Frame
    from .runtime.options.pack import PackOptions as PackOptions
    from .runtime.options.unwrap import Options, Outputs
    from .runtime.process.progress import Progress
    from .runtime.sessions.session import UnwrapSession
    from .train.deploy.gated import GatedExperts

__version__ = "0.1.0"
__all__ = ["Asset", "Atlas", "FlexparaError", "Options", "Outputs", "PackOptions", "UnwrapPages", "UnwrapResult"]
__all__ += ["UnwrapSession", "load", "pack", "unwrap", "unwrap_pages"]

_HOME = {
    "Asset": "runtime.mesh",
    "Atlas": "runtime.mesh",
    "load": "runtime.io.meshfile",
    "Options": "runtime.options.unwrap",
    "Outputs": "runtime.options.unwrap",
    "PackOptions": "runtime.options.pack",
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
    from .runtime.io.anyfile import load_any
    from .runtime.io.points.cloud import PointCloud
    from .runtime.options.keywords import from_keywords
    from .runtime.options.unwrap import Options, demand
    from .runtime.process.deadline import Deadline
    from .runtime.process.progress import Clock

    options = from_keywords(Options, options, keywords)
    demand(not options.several, "several atlases in unwrap, expected one; call unwrap_pages")
    clock = Clock(progress, Deadline(options.time_budget))
    source = load_any(mesh, options.select)
    if isinstance(source, PointCloud):
        return unwrap_cloud(source, options, clock)
    return unwrap_asset(source, options, clock)


def unwrap_pages(
    mesh: MeshLike, options: Options | None = None, *, progress: Progress | None = None, **keywords: Any
) -> UnwrapPages:
    """Unwrap a mesh onto several atlases: of meshes or materials (options.atlas), or options.pages, as tiles by udim.

    Args and raises: as `unwrap`; MissingDependencyError where flexpara[bake] is absent.
    """
    from .runtime.io.meshfile import load
    from .runtime.options.keywords import from_keywords
    from .runtime.options.unwrap import Options

    options = from_keywords(Options, options, keywords)
    return unwrap_asset_pages(load(mesh, options.select), options, progress)


def unwrap_asset(
    asset: Asset, options: Options, progress: Progress | None = None, keep: tuple[Path, int] | None = None
) -> UnwrapResult:
    """Train, finish, pack, measure, export.  keep: folder and interval of checkpoints.  Raises as `unwrap`."""
    from .runtime.extras import requires
    from .runtime.process.progress import Clock

    with requires("unwrap"):
        from .export.whole import unwrapped
        from .runtime.io.asset.shading import shaded

    clock, asset = Clock.of(progress), shaded(asset, options.crease_angle)
    return UnwrapResult(asset, unwrapped(asset, options, clock, keep))


def unwrap_asset_pages(asset: Asset, options: Options, progress: Progress | None = None) -> UnwrapPages:
    """The asset's pages, shaded as one mesh, each as `unwrap_asset`.  Raises: as that."""
    from .runtime.extras import requires
    from .runtime.io.asset.shading import shaded
    from .runtime.process.progress import Clock

    with requires("bake"):
        from .bake.files.gltfmade import with_document
    with requires("unwrap"):
        from .export.pages import unwrapped_pages
    whole = shaded(asset, options.crease_angle)
    whole = whole if options.udim else with_document(whole)
    results, page = unwrapped_pages(whole, options, Clock.of(progress))
    return UnwrapPages(whole, tuple(UnwrapResult(*one) for one in results), page if options.udim else None)


def unwrap_cloud(
    cloud: PointCloud, options: Options, progress: Progress | None = None, keep: tuple[Path, int] | None = None
) -> UnwrapResult:
    """Lay triangles over the points, then as `unwrap_asset`.

    Raises: as `unwrap`; MeshError where the points show no surface.
    """
    from .runtime.extras import requires
    from .runtime.process.progress import Clock

    with requires("unwrap"):
        from .export.whole import unwrapped_cloud

    mesh, found = unwrapped_cloud(cloud, options, Clock.of(progress), keep)
    return UnwrapResult(mesh.asset, found, cloud, mesh)


@dataclass(frozen=True, eq=False, repr=False)
class UnwrapResult(Unwrapping):
    """An unwrapped mesh or point cloud.

    asset: the mesh as read and cleaned, with normals, or the triangles laid over the points.  found: what came of it.
    cloud, cloud_mesh: of a point cloud, the points and where each lies on those triangles; else None.
    """

    asset: Asset
    found: Unwrapped
    cloud: PointCloud | None = None
    cloud_mesh: CloudMesh | None = None

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
        from .runtime.io.asset.shading import with_file_vertices

        return with_file_vertices(self.found.atlas, self.asset)

    def point_uv(self) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
        """Of a point cloud: uv (n, 2) float32 in [0, 1], v up, and chart (n,) int64 of each of its points.

        Raises: InputError for a mesh, whose uv are those of the atlas.
        """
        from .runtime.io.points.cloud import point_uv

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
    def reports(self) -> list[dict[str, Any]]:
        """The report, as `UnwrapPages` has one for each page."""
        return [self.report]

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

    def write(
        self,
        output: OutputFolder,
        outputs: Outputs,
        progress: Progress | None = None,
        note: Callable[[str], None] | None = None,
        high: HighSource | None = None,
    ) -> tuple[Path, ...]:
        """As `save`, into an open OutputFolder.  note: told what a user should know.  high: of the outputs, if read."""
        from .bake.checks import check_outputs, chosen_maps
        from .bake.highsource import high_source, mesh_maps
        from .bake.results.output import BakeJob, packing_notes, result_notes, with_cut, write_outputs, write_reports
        from .export.assemble import write_networks
        from .runtime.io.asset.changes import lost
        from .runtime.io.points.written import point_files, write_points
        from .runtime.options.atlas import SourceOptions
        from .runtime.process.progress import Clock

        high = high or high_source(outputs, SourceOptions.crease_angle)
        outputs = mesh_maps(outputs, self.asset, high)
        outputs = outputs if self.cloud is None else outputs.for_points()
        maps = chosen_maps(outputs, high=high, seed=self.report["settings"]["seed"])
        check_outputs(output, outputs, maps, more=() if self.cloud is None else point_files(output.stem))
        clock, report = Clock(progress), {**self.report, "outputs": outputs.facts()}
        report["changes"] = {**report["changes"], **lost(self.asset, outputs)}
        report |= write_networks(output, self.asset, self.found, clock, inverse=outputs.inverse)
        if self.cloud is not None:
            write_points(output, self.cloud, *self.point_uv())
        apart = report["metrics"]["overlap_fraction"] == 0.0
        job = BakeJob.of(self.found.atlas, self.asset, outputs, maps)
        report |= write_outputs(output, job, clock, apart=apart) | ({} if high is None else {"high": high.report()})
        if note is not None:
            for fact in (*packing_notes(report["pack"]), *result_notes(report)):
                note(f"{self.asset.stem}: {fact}")
        write_reports(output, job, {**with_cut(report), "seconds": {**report["seconds"], **clock.rounded}})
        return output.commit()


@dataclass(frozen=True, eq=False, repr=False)
class UnwrapPages(Unwrapping):
    """A mesh unwrapped onto several atlases.

    asset: all of it, with its scene.  pages: one result for each atlas; the stem of its asset tells which.
    tile: (f,) of UDIM tiles, the page of each face of the asset, page a + 10 b for uv at (a, b); else None.
    """

    asset: Asset
    pages: tuple[UnwrapResult, ...]
    tile: NDArray[np.int64] | None = None

    @property
    def reports(self) -> list[dict[str, Any]]:
        """The report of each page."""
        return [page.report for page in self.pages]

    @property
    def report(self) -> dict[str, Any]:
        """Changes, and for each page what an `UnwrapResult` reports; ready for JSON."""
        return {"changes": self.asset.changes, "pages": {page.asset.stem: page.report for page in self.pages}}

    def write(
        self,
        output: OutputFolder,
        outputs: Outputs,
        progress: Progress | None = None,
        note: Callable[[str], None] | None = None,
    ) -> tuple[Path, ...]:
        """As `save`, into an open OutputFolder."""
        from .bake.results.output import with_cut
        from .bake.results.several import Several
        from .export.assemble import write_networks
        from .runtime.io.asset.changes import lost
        from .runtime.process.progress import Clock

        clock, report = Clock(progress), {**self.report, "outputs": outputs.facts()}
        report["changes"] = {**report["changes"], **lost(self.asset, outputs.for_asset(self.asset))}
        pairs, seed = [(page.asset, page.found.atlas) for page in self.pages], self.reports[0]["settings"]["seed"]
        jobs = (several := Several(self.asset, self.tile, pairs, outputs, seed)).jobs(output)
        for page in self.pages:
            networks = write_networks(output, page.asset, page.found, clock, inverse=outputs.inverse)
            report["pages"][page.asset.stem] = {**page.report, **networks}
        apart = all(entry["metrics"]["overlap_fraction"] == 0.0 for entry in self.reports)
        report |= several.write(output, jobs, clock, note or (lambda _: None), apart=apart)
        output.write_report({**with_cut(report), "seconds": clock.rounded})
        return output.commit()
