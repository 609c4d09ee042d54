"""From what was trained to everything that is written about a mesh: pack, measure, export.

The other half of an unwrap is train/presets.py; what is trained may be kept on disk between them (train/saved.py).
Positions in source units, uv in [0, 1]² of the atlas, sizes in texels.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from .. import __version__
from ..runtime.geometry.metrics import measure
from ..runtime.mesh import Surface
from ..runtime.pack.packing import pack
from ..runtime.sessions.agreement import agreement
from ..runtime.sessions.session import UnwrapSession
from .metadata import Provenance
from .onnx import export_onnx
from .raw import raw_onnx

if TYPE_CHECKING:
    from ..runtime.mesh import Asset, Atlas, Charts, Frame
    from ..runtime.progress import Clock
    from ..train.learn.networks import AtlasNetworks
    from ..train.pipeline import Trained

REPORT_VERSION = 1


@dataclass(frozen=True, eq=False)
class Unwrapped:
    """An unwrapped mesh.

    charts: flat, not packed.  frame: source units → unit ball.  atlas: packed charts.
    model: the torch module behind the ONNX file.  onnx: the bytes of that file.
    paper: those of the networks of preset paper as they were trained, else None.
    report: changes, settings, metrics, agreement of network and atlas, seconds; ready for JSON.
    """

    charts: Charts
    frame: Frame
    atlas: Atlas
    model: AtlasNetworks
    onnx: bytes = field(repr=False)
    report: dict[str, Any] = field(repr=False)
    paper: bytes | None = field(default=None, repr=False)


def assemble(asset: Asset, trained: Trained, clock: Clock, *, size: int, padding: int) -> Unwrapped:
    """Pack, measure, export.

    Raises: ParityError when the exported network and torch disagree.
    """
    with clock.stage("pack"):
        packed = pack(asset, trained.charts, size=size, padding=padding, seed=trained.settings["seed"])
    atlas = packed.atlas
    with clock.stage("measure"):
        metrics = measure(asset.surface, atlas.corner_uv, atlas.face_chart, size=size)
    report: dict[str, Any] = {
        "format_version": REPORT_VERSION,
        "version": __version__,
        "source": {"stem": asset.stem, "sha256": asset.sha256, "faces": len(asset.faces)},
        "changes": asset.changes,
        "settings": {**trained.settings, "size": size, "padding": padding},
        "pack": packed.report,
        "methods": list(trained.charts.method),
        "metrics": metrics.to_dict(),
        "train": trained.report,
    }
    with clock.stage("export"), TemporaryDirectory() as folder:
        path = Path(folder) / "atlas.onnx"
        facts = Provenance(asset.sha256, report["settings"], report["metrics"])
        parity = export_onnx(trained.networks, trained.frame, atlas, trained.charts, path, metadata=facts)
        network = agreement(UnwrapSession(path), atlas, seed=trained.settings["seed"])
        onnx = path.read_bytes()
        paper = None if trained.paper is None else raw_onnx(trained.paper, asset.surface, trained.frame, size, facts)
    report |= {"parity": asdict(parity), "network": network.to_dict()}
    report["seconds"] = {stage: round(seconds, 3) for stage, seconds in clock.seconds.items()}
    return Unwrapped(trained.charts, trained.frame, atlas, trained.networks, onnx, report, paper)


def invert(asset: Asset, found: Unwrapped, clock: Clock) -> tuple[bytes, dict[str, Any]]:
    """The inverse map uv, chart → point, normal as an ONNX file's bytes, and how well it agrees with the surface.

    Raises: ParityError when the exported network and torch disagree.
    """
    from ..runtime.sessions.wrapagreement import inverse_agreement
    from ..runtime.sessions.wrapsession import WrapSession
    from ..train.deploy.fit_wrap import fit_wrap
    from .wrap import export_wrap

    ball = Surface(found.frame.apply(asset.surface.vertices), asset.surface.faces)
    model = fit_wrap(ball, found.charts, seed=found.report["settings"]["seed"], progress=clock)
    with clock.stage("export inverse"), TemporaryDirectory() as folder:
        path = Path(folder) / "atlas.wrap.onnx"
        facts = Provenance(asset.sha256, found.report["settings"], found.report["metrics"])
        export_wrap(model, found.frame, found.atlas, found.charts, path, metadata=facts)
        agreed = inverse_agreement(WrapSession(path), asset.surface, found.atlas)
        return path.read_bytes(), agreed.to_dict()
