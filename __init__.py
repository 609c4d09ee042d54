"""The public API.  This repository's root folder is the package `flexpara`; this file only wires its folders together.

Nothing heavy is imported until it is used: `import flexpara` loads neither numpy, torch nor OpenGL.
uv are v up in [0, 1]² of the atlas; positions are in the units of the source file; sizes and paddings are in texels.
"""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

from .runtime.errors import FlexparaError, InputError, MissingDependencyError

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import trimesh
    from numpy.typing import ArrayLike

    from . import bake as bake
    from . import export as export
    from . import runtime as runtime
    from . import train as train
    from .runtime.files import OutputFolder
    from .runtime.mesh import Asset, Atlas, Charts, Frame
    from .runtime.options import Options, Outputs
    from .runtime.progress import Progress
    from .runtime.session import UnwrapSession
    from .train.networks import AtlasNetworks
    from .train.pipeline import Trained

    MeshLike = str | Path | trimesh.Trimesh | tuple[ArrayLike, ArrayLike]

__version__ = "0.1.0"
__all__ = ["Asset", "Atlas", "FlexparaError", "Options", "Outputs", "UnwrapResult", "UnwrapSession", "unwrap"]

REPORT_VERSION = 1
_HOME = {"Asset": "mesh", "Atlas": "mesh", "Options": "options", "Outputs": "options", "UnwrapSession": "session"}
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
    progress: Progress | None = None,
) -> UnwrapResult:
    """Unwrap a mesh.

    Args:
        mesh: a path, a trimesh.Trimesh, or (vertices (n, 3), faces (f, 3)).
        charts: the most charts a connected surface may get.
        size: atlas side, texels.
        padding: texels kept free around each chart; None is size / 256, at least 2.
        seed: same seed, same machine, same atlas and network.
        preset: how much work training does: "fast".
        progress: called as progress(stage, step, steps, loss); loss is None outside training.

    Raises:
        InputError: the mesh or an option is wrong.
        MissingDependencyError: the packages of flexpara[train] are absent.
        FinishError, ParityError: no valid atlas could be made, or its network could not be exported faithfully.
    """
    from .runtime.options import Options

    options = Options(charts=charts, size=size, padding=padding, seed=seed, preset=preset)
    return unwrap_asset(load(mesh), options, progress)


def load(mesh: MeshLike) -> Asset:
    """The mesh as an Asset, cleaned.  Raises: InputError when it is no mesh, or one with nothing to unwrap."""
    from .runtime.meshfile import asset_from_arrays, load_asset

    if isinstance(mesh, str | Path):
        return load_asset(Path(mesh))
    if isinstance(mesh, tuple):
        return asset_from_arrays(*mesh)
    visual: Any = mesh.visual
    colors = visual.vertex_colors if visual.kind == "vertex" else None
    return asset_from_arrays(mesh.vertices, mesh.faces, colors=colors, uv=getattr(visual, "uv", None))


def unwrap_asset(asset: Asset, options: Options, progress: Progress | None = None) -> UnwrapResult:
    """Train, finish, pack, measure, export.  Raises as `unwrap`."""
    with requires("train"):
        from .train.config import TrainConfig
        from .train.pipeline import train
    from .runtime.metrics import measure
    from .runtime.packing import pack
    from .runtime.progress import Clock

    clock = Clock(progress)
    settings = TrainConfig(charts=options.charts, seed=options.seed)
    trained = train(asset.surface, settings, clock)
    with clock.stage("pack"):
        atlas = pack(asset, trained.charts, size=options.size, padding=options.margin, seed=options.seed)
    with clock.stage("measure"):
        metrics = measure(asset.surface, atlas.corner_uv, atlas.face_chart, size=options.size)
    report: dict[str, Any] = {
        "format_version": REPORT_VERSION,
        "version": __version__,
        "source": {"stem": asset.stem, "sha256": asset.sha256, "faces": len(asset.faces)},
        "changes": asset.changes,
        "settings": {**asdict(settings), "size": options.size, "padding": options.margin, "preset": options.preset},
        "methods": list(trained.charts.method),
        "metrics": metrics.to_dict(),
        "train": trained.report,
    }
    with clock.stage("export"):
        onnx, found = _export(trained, atlas, report)
    report |= {**found, "seconds": {stage: round(seconds, 3) for stage, seconds in clock.seconds.items()}}
    return UnwrapResult(asset, trained.charts, trained.frame, atlas, trained.networks, onnx, report)


def _export(trained: Trained, atlas: Atlas, report: dict[str, Any]) -> tuple[bytes, dict[str, Any]]:
    """The ONNX file's bytes, and what was found about it: parity with torch, agreement with the atlas."""
    from tempfile import TemporaryDirectory

    with requires("train"):
        from .export.metadata import Provenance
        from .export.onnx import export_onnx
    from .runtime.agreement import agreement
    from .runtime.session import UnwrapSession

    facts = Provenance(report["source"]["sha256"], report["settings"], report["metrics"])
    with TemporaryDirectory() as folder:
        path = Path(folder) / "atlas.onnx"
        parity = export_onnx(trained.networks, trained.frame, atlas, trained.charts, path, metadata=facts)
        network = agreement(UnwrapSession(path), atlas, seed=report["settings"]["seed"])
        return path.read_bytes(), {"parity": asdict(parity), "network": network.to_dict()}


@dataclass(frozen=True, eq=False)
class UnwrapResult:
    """An unwrapped mesh.

    asset: the mesh as read and cleaned.  charts: flat, not packed.  frame: source units → unit ball.
    atlas: packed charts.  model: the torch module behind the ONNX file.  onnx: the bytes of that file.
    report: changes, settings, metrics, agreement of network and atlas, seconds; ready for JSON.
    """

    asset: Asset
    charts: Charts
    frame: Frame
    atlas: Atlas
    model: AtlasNetworks
    onnx: bytes = field(repr=False)
    report: dict[str, Any] = field(repr=False)

    def save(
        self,
        folder: str | Path,
        *,
        maps: Sequence[str] = ("auto",),
        formats: Sequence[str] = ("glb",),
        preview: bool = True,
        force: bool = False,
        progress: Progress | None = None,
    ) -> tuple[Path, ...]:
        """Write mesh, ONNX file, textures, preview and report, all or none; returns their paths.  See Outputs.

        Raises:
            InputError: an unknown map or format, or a size that this OpenGL device can't draw.
            ForeignFileError: a file is in the way that flexpara did not write, and force is off.
            MissingDependencyError: the packages of flexpara[bake], or OpenGL, are absent.
        """
        from .runtime.files import OutputFolder
        from .runtime.options import Outputs

        outputs = Outputs(tuple(maps), tuple(formats), preview)
        with OutputFolder(Path(folder), self.asset.stem, force=force) as output:
            check_outputs(output, outputs.for_asset(self.asset), self.atlas.size)
            return self.write(output, outputs.for_asset(self.asset), progress)

    def write(self, output: OutputFolder, outputs: Outputs, progress: Progress | None = None) -> tuple[Path, ...]:
        """As `save`, into an open OutputFolder; outputs without "auto"."""
        from .runtime.progress import Clock

        clock, stem = Clock(progress), output.stem
        output.write(f"{stem}.onnx", lambda path: path.write_bytes(self.onnx))
        textures = write_textures(output, self.atlas, self.asset, outputs, self.atlas.padding, clock)
        with clock.stage("write"):
            _write_meshes(output, self.atlas, self.asset, outputs, textures)
        if outputs.preview:
            from .bake.preview import render_preview
            from .runtime.metrics import face_distortion

            with clock.stage("preview"):
                stretch = face_distortion(self.asset.surface, self.atlas.corner_uv)
                output.write(f"{stem}.preview.png", lambda path: render_preview(self.atlas, stretch, path))
        seconds = {**self.report["seconds"], **{name: round(value, 3) for name, value in clock.seconds.items()}}
        output.write_report({**self.report, "seconds": seconds})
        return output.commit()


def check_outputs(output: OutputFolder, outputs: Outputs, size: int, *, meshes: bool = True) -> None:
    """Refuse early what writing would refuse after the work: unknown maps, foreign files, OpenGL absent or too small.

    Raises: InputError, ForeignFileError, MissingDependencyError.
    """
    names = list(texture_files(output.stem, outputs).values())
    if meshes:
        names += [f"{output.stem}.{name}" for name in (*outputs.formats, "onnx")]
        names += [f"{output.stem}.preview.png"] if outputs.preview else []
    output.check([*names, output.report_name])
    wanted = {"baker": bool(outputs.maps), "gltf": meshes and "glb" in outputs.formats, "preview": outputs.preview}
    with requires("bake"):
        for module in (name for name, needed in wanted.items() if needed):
            import_module(f".bake.{module}", __name__)
    if outputs.maps or outputs.preview:
        from .bake.context import describe

        limit = describe().max_size
        if outputs.maps and size > limit:
            raise InputError(f"size is {size}, this OpenGL device draws up to {limit} texels; pass --size {limit}")


def check_maps(names: Sequence[str]) -> None:
    """Raises: InputError for an unknown map, MissingDependencyError when maps are wanted and can't be made."""
    if names:
        with requires("bake"):
            from .bake.maps import find_map
        for name in names:
            if name != "auto":
                find_map(name)


def texture_files(stem: str, outputs: Outputs) -> dict[str, str]:
    """Map → file name.  Raises: InputError for an unknown map."""
    if not outputs.maps:
        return {}
    with requires("bake"):
        from .bake.baker import texture_names
        from .bake.maps import find_map
    entries = {name: find_map(name, normal_format=outputs.normal_format) for name in outputs.maps}
    return texture_names(cast("Any", entries), stem, file_type=outputs.texture_format)


def write_textures(
    output: OutputFolder, atlas: Atlas, asset: Asset, outputs: Outputs, padding: int, progress: Progress
) -> dict[str, Any]:
    """Bake the maps and write them; map → Texture."""
    if not outputs.maps:
        return {}
    from .bake import baker

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


def _write_meshes(output: OutputFolder, atlas: Atlas, asset: Asset, outputs: Outputs, textures: dict[str, Any]) -> None:
    """The mesh in each format asked for."""
    from .runtime.meshwrite import write_obj, write_ply

    pictures = texture_files(output.stem, outputs)
    shown = next((pictures[name] for name in ("base-color", "uv-checker", "chart") if name in pictures), None)
    if "glb" in outputs.formats:
        with requires("bake"):
            from .bake.gltf import write_glb
        output.write(f"{output.stem}.glb", lambda path: write_glb(atlas, asset, textures, path))
    if "obj" in outputs.formats:
        output.write(f"{output.stem}.obj", lambda path: write_obj(atlas, path, texture=shown))
    if "ply" in outputs.formats:
        output.write(f"{output.stem}.ply", lambda path: write_ply(atlas, path, colors=asset.colors))


@contextmanager
def requires(extra: str) -> Iterator[None]:
    """Around imports: a package of that extra which is absent becomes a MissingDependencyError that says what to do."""
    try:
        yield
    except FlexparaError:
        raise
    except ImportError as error:
        if (error.name or "").partition(".")[0] == __name__:
            raise
        found = f"{error.name or 'a package'} can't be imported ({error}), expected what flexpara[{extra}] brings"
        raise MissingDependencyError(f'{found}; pip install "flexpara[{extra}]"') from error
