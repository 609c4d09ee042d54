"""From what was trained to everything that is written about a mesh: pack, measure, export.

The other half of an unwrap is train/presets.py; what is trained may be kept on disk between them (train/saved.py).
Positions in source units, uv in [0, 1]² of the atlas, sizes in texels.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..runtime.errors import FinishError
from ..runtime.geometry.metrics import measure
from ..runtime.mesh import Surface
from ..runtime.pack.asked import pack_asked
from ..runtime.pack.config import PackConfig
from ..runtime.pack.packing import Packed
from ..runtime.sessions.agreement import agreement
from ..runtime.sessions.session import UnwrapSession
from ..train.charts.recut import drawn_again
from ..train.deploy.fit import fit_networks
from ..train.fromjson import fit_in_force, wrap_in_force
from ..train.polygons import whole_polygons
from ..train.workers import Beside
from .deploy.onnxfile import export_networks
from .graph.metadata import PlacedCharts, Provenance

if TYPE_CHECKING:
    from torch import nn

    from ..runtime.files import OutputFolder
    from ..runtime.mesh import Asset, Atlas, Charts, Frame
    from ..runtime.pack.square import Square
    from ..runtime.pagesize import Size
    from ..runtime.process.progress import Clock
    from ..train.deploy.gated import GatedExperts
    from ..train.pipeline import Trained

REPORT_VERSION = 1


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """An unwrapped mesh.

    charts: flat, not packed.  frame: source units → unit ball.  atlas: packed charts.
    model: the networks behind the ONNX file, in numpy.  onnx: the bytes of that file.
    paper: those of the networks of preset paper as they were trained, else None.
    report: changes, settings, metrics, agreement of network and atlas, seconds; ready for JSON.
    """

    charts: Charts
    frame: Frame
    atlas: Atlas
    model: GatedExperts
    onnx: bytes = field(repr=False)
    report: dict[str, Any] = field(repr=False)
    paper: bytes | None = field(default=None, repr=False)


def assemble(asset: Asset, trained: Trained, clock: Clock, square: Square) -> Unwrapped:
    """Pack, measure, export.   square: the atlas that is asked for.

    Raises: ParityError when the exported file and its networks disagree.
    """
    with clock.stage("pack"):
        trained, packed = _valid_atlas(asset, trained, square)
    atlas = packed.atlas
    with clock.stage("measure"):
        metrics = measure(asset.surface, atlas.corner_uv, atlas.face_chart, size=atlas.size, stack=atlas.face_stack)
    with clock.stage("fit"):  # what is left of it
        networks = trained.networks
    report: dict[str, Any] = {
        "format_version": REPORT_VERSION,
        "version": __version__,
        "source": {"stem": asset.stem, "sha256": asset.sha256, "faces": len(asset.faces)},
        "changes": asset.changes,
        "settings": {**trained.settings, **square.facts(atlas.padding)},
        "pack": packed.report,
        "methods": list(trained.charts.method),
        "metrics": metrics.to_dict(),
        "train": {**trained.report, "experts": len(networks.label)},
    }
    with clock.stage("export"), TemporaryDirectory() as folder:
        path, placed = Path(folder) / "atlas.onnx", PlacedCharts(trained.frame, atlas, trained.charts)
        facts = Provenance(asset.sha256, report["settings"], report["metrics"])
        parity = export_networks(networks, placed, path, metadata=facts)
        network = agreement(UnwrapSession(path), atlas, seed=trained.settings["seed"])
        onnx = path.read_bytes()
        paper = None if trained.paper is None else _paper_file(trained.paper, asset, trained.frame, atlas.size, facts)
    report |= {"parity": asdict(parity), "network": network.to_dict()}
    report["seconds"] = clock.rounded
    return Unwrapped(trained.charts, trained.frame, atlas, networks, onnx, report, paper)


def _with_whole_polygons(asset: Asset, trained: Trained) -> Trained:
    """Seams off the diagonals of polygons, where there is room, and the networks of these charts."""
    if asset.polygons is None or trained.paper is not None:
        return trained
    charts = whole_polygons(asset.surface, trained.charts, asset.polygons)
    if charts is trained.charts:
        return trained
    return _with_charts(asset, trained, charts)


def _with_charts(asset: Asset, trained: Trained, charts: Charts) -> Trained:
    """The same with other charts, and networks that are fitted to these."""
    trained.fitted.end()
    ball = Surface(trained.frame.apply(asset.surface.vertices), asset.surface.faces)
    fit, seed = fit_in_force(trained.settings), trained.settings["seed"]
    return replace(trained, charts=charts, fitted=Beside(partial(fit_networks, ball, charts, fit, seed)))


def _valid_atlas(asset: Asset, trained: Trained, square: Square) -> tuple[Trained, Packed]:
    """Packed charts that are valid as written; those that float32 could not hold are drawn again, and all fitted anew.

    Raises: FinishError where charts stay invalid (a defect).
    """
    seed, config = trained.settings["seed"], PackConfig()
    trained = _with_whole_polygons(asset, trained)
    packed = pack_asked(asset, trained.charts, square, seed, config)
    for _ in range(config.recuts):
        if len(packed.invalid) == 0:
            return trained, packed
        written = packed.atlas.corner_uv
        charts, note = drawn_again(asset.surface, trained.charts, packed.invalid, written, config.least_edge)
        report = {**trained.report, "notes": [*trained.report.get("notes", []), note]}
        trained = _with_charts(asset, replace(trained, report=report), charts)
        packed = pack_asked(asset, charts, square, seed, config)
    if len(packed.invalid):
        raise FinishError(
            f"{len(packed.invalid)} charts are not valid as written after {config.recuts} attempts, expected none; "
            "please report the mesh"
        )
    return trained, packed


def invert(asset: Asset, found: Unwrapped, clock: Clock) -> tuple[bytes, dict[str, Any]]:
    """The inverse map uv, chart → point, normal as an ONNX file's bytes, and how well it agrees with the surface.

    Raises: ParityError when the exported file and its networks disagree.
    """
    from ..runtime.sessions.wrapagreement import inverse_agreement
    from ..runtime.sessions.wrapsession import WrapSession
    from ..train.deploy.fit_wrap import fit_wrap
    from .deploy.wrapfile import export_wrap

    ball = Surface(found.frame.apply(asset.surface.vertices), asset.surface.faces)
    settings = found.report["settings"]
    config, seed = wrap_in_force(settings), settings["seed"]
    model = fit_wrap(ball, found.charts, found.atlas.corner_uv, config, seed=seed, progress=clock)
    with clock.stage("export inverse"), TemporaryDirectory() as folder:
        path = Path(folder) / "atlas.wrap.onnx"
        facts = Provenance(asset.sha256, found.report["settings"], found.report["metrics"])
        export_wrap(model, PlacedCharts(found.frame, found.atlas, found.charts), path, metadata=facts)
        agreed = inverse_agreement(WrapSession(path), asset.surface, found.atlas)
        return path.read_bytes(), agreed.to_dict()


def write_networks(
    output: OutputFolder, asset: Asset, found: Unwrapped, clock: Clock, *, inverse: bool
) -> dict[str, Any]:
    """Write the ONNX files of an unwrapped mesh; what the report says of them beyond that of `found`.

    inverse: whether its inverse is one of them.  Raises: as `invert`.
    """
    files, facts = {"onnx": found.onnx}, dict[str, Any]()
    if found.paper is not None:
        files["paper.onnx"] = found.paper
    if inverse:
        files["wrap.onnx"], facts["inverse"] = invert(asset, found, clock)
    for ending, content in files.items():
        output.write(f"{asset.stem}.{ending}", lambda path, content=content: path.write_bytes(content))
    return facts


def _paper_file(model: nn.Module, asset: Asset, frame: Frame, size: Size, facts: Provenance) -> bytes:
    """The networks of preset paper as they were trained; torch is loaded for them alone."""
    from .paper.raw import raw_onnx

    return raw_onnx(model, asset.surface, frame, size, facts)
