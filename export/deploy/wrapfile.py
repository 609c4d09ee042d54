"""Writes `<stem>.wrap.onnx`, the inverse of an atlas, once it is proven equal to its networks.   No torch.

n rows · k charts.  Inputs `uv` (n, 2) float32 in [0, 1]², v up, and `chart` (n) int64; outputs `points` (n, 3) float32
in source units and `normals` (n, 3) float32 of unit length.  The frame is folded in; runtime/sessions/bundle.py's JSON
is attached, with kind "wrap".  Rows of a chart that does not exist are NaN.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from onnx import TensorProto

from ...runtime.errors import ParityError, ShapeError
from ...runtime.sessions.wrapsession import wrap_json
from ...train.deploy.fit_wrap import HEIGHT, on_layers
from ..graph.builder import Ends, GraphBuilder
from ..graph.frames import fold_frame
from ..graph.metadata import PlacedCharts, Provenance, bundle_metadata
from ..graph.parity import largest_difference, load_model, run_model
from ..graph.proven import FileKind, check_folder, write_proven
from .onnxgraph import write_gated

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.mesh import Atlas
    from ...runtime.sessions.bundle import BundleMetadata
    from ...train.deploy.gated import GatedExperts

INPUTS: Ends = {"uv": ("float32", ["n", 2]), "chart": ("int64", ["n"])}
OUTPUTS: Ends = {"points": ("float32", ["n", 3]), "normals": ("float32", ["n", 3])}
SHORTEST = 1e-12
"""Normals shorter than this are not made longer."""


@dataclass(frozen=True)
class WrapParitySpec:
    """Where networks and onnxruntime are compared, and how closely they must agree."""

    sizes: tuple[int, ...] = (1, 2, 1000)
    """Numbers of rows n; 1 finds a frozen axis, 2 a squeezed one."""
    points_atol: float = 1e-5
    """Largest |Δpoints| as a share of the frame's scale.

    What float32 loses at the frame's centre comes on top: WrapSession does not."""
    normals_atol: float = 1e-3
    """Largest |Δnormals|."""
    tie: float = 1e-6
    """Distance from a gate or a cell's side (atlas, cells) within which rounding decides."""
    least: float = 0.25
    """Least share of the rows that has to be no tie: fewer prove nothing."""
    seed: int = 0
    """Seed of the probes."""


@dataclass(frozen=True)
class WrapSpec:
    """How an inverse is written."""

    kind: FileKind = field(default_factory=FileKind)
    """Which onnxruntime can read it."""
    parity: WrapParitySpec = field(default_factory=WrapParitySpec)
    """Where and how closely networks and onnxruntime must agree."""


@dataclass(frozen=True)
class WrapParityReport:
    """What the proof found.

    compared, ties: rows of all sizes together, and those left out.  points_error: max |Δ| as a share of the frame's
    scale.  normals_error: max |Δ|.
    """

    sizes: tuple[int, ...]
    compared: int
    ties: int
    points_error: float
    normals_error: float


@dataclass(frozen=True, eq=False)
class Inverse:
    """The map that a file holds.  networks: (u, v, height) (n, 3) → unit ball and normal (n, 6), chart, score."""

    networks: GatedExperts
    metadata: BundleMetadata

    def inputs(self, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> NDArray[np.float32]:
        """(n, 3) what the networks see: charts that don't exist are clamped to those that do."""
        charts = self.metadata.chart_count
        return on_layers(uv, chart.clip(0, charts - 1), charts)

    def __call__(
        self, uv: NDArray[np.float32], chart: NDArray[np.int64]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Points (n, 3), clamped to the frame's box, and normals (n, 3) at uv (n, 2) of charts (n,)."""
        value = self.networks(self.inputs(uv, chart)).value
        folded = fold_frame(self.metadata)
        points = value[:, :3].clip(-1.0, 1.0) * folded.scale + folded.centre_rest + folded.centre
        normals = value[:, 3:] / np.maximum(np.linalg.norm(value[:, 3:], axis=1, keepdims=True), SHORTEST)
        lost = (chart < 0) | (chart >= self.metadata.chart_count)
        points[lost], normals[lost] = np.nan, np.nan
        return points, normals.astype(np.float32)


def export_wrap(
    networks: GatedExperts,
    placed: PlacedCharts,
    path: Path,
    *,
    metadata: Provenance | None = None,
    spec: WrapSpec | None = None,
) -> WrapParityReport:
    """Write the inverse and prove that it equals the networks, or raise and leave nothing behind.

    Same networks, placed charts and metadata → same bytes.  The file appears whole or not at all.

    Args:
        networks: of fit_wrap().
        placed: charts, frame and atlas.
        path: of the file; its folder exists.
        metadata: source hash, settings, metrics.
        spec: None = WrapSpec().

    Raises:
        ParityError: names the output, n, the largest difference and what was allowed.
        InputError: metadata or placement that can't be written, as ShapeError: networks of other inputs or outputs;
            as MissingFileError: the folder is absent.
    """
    spec = spec or WrapSpec()
    check_folder(path)
    if networks.weights.shape[1:] != (6, 4):
        found = f"weights of shape {networks.weights.shape}"
        raise ShapeError(f"{found}, expected (e, 6, 4): uv to position and normal; pass what fit_wrap gave")
    facts = bundle_metadata(placed, metadata or Provenance())
    inverse = Inverse(networks, facts)
    content = build_inverse(inverse, spec.kind)
    probes = probe_uv(placed.atlas, max(spec.parity.sizes), spec.parity.seed)
    return write_proven(path, content, lambda content: prove_inverse(inverse, content, probes, spec.parity))


def build_inverse(inverse: Inverse, kind: FileKind) -> bytes:
    """The ONNX model in memory, checked by onnx, not yet proven equal to the networks."""
    builder, metadata = GraphBuilder(), inverse.metadata
    value = write_gated(builder, _layers(builder, metadata.chart_count), inverse.networks).value
    nothing = builder.constant(np.asarray(np.nan, dtype=np.float32))
    known = builder.op("Unsqueeze", _known(builder, metadata.chart_count), builder.axes(1))
    for name, found in (("points", _points(builder, value[:3], metadata)), ("normals", _normals(builder, value[3:]))):
        builder.op("Where", known, found, nothing, name=name)
    return kind.serialize(builder, INPUTS, OUTPUTS, metadata, wrap_json(metadata), "wrap")


def _layers(builder: GraphBuilder, charts: int) -> str:
    """(n, 3) the networks' inputs, see fit_wrap.on_layers."""
    first, last = (builder.constant(np.asarray(bound, dtype=np.int64)) for bound in (0, charts - 1))
    inside = builder.op("Min", builder.op("Max", "chart", first), last)
    step = builder.constant(np.asarray(HEIGHT / charts, dtype=np.float32))
    height = builder.op("Mul", builder.op("Cast", inside, to=TensorProto.FLOAT), step)
    return builder.op("Concat", "uv", builder.op("Unsqueeze", height, builder.axes(1)), axis=1)


def _known(builder: GraphBuilder, charts: int) -> str:
    """(n,) bool: the chart exists."""
    first, last = (builder.constant(np.asarray(bound, dtype=np.int64)) for bound in (-1, charts))
    return builder.op("And", builder.op("Greater", "chart", first), builder.op("Less", "chart", last))


def _points(builder: GraphBuilder, rows: tuple[str, ...], metadata: BundleMetadata) -> str:
    """(n, 3) in source units; WrapSession zeroes both centres."""
    folded = fold_frame(metadata)
    low, high = (builder.constant(np.asarray(bound, dtype=np.float32)) for bound in (-1.0, 1.0))
    xyz = builder.op("Clip", _columns(builder, rows), low, high)
    away = builder.op("Mul", xyz, builder.named("scale", folded.scale))
    near = builder.op("Add", away, builder.named("centre_rest", folded.centre_rest))
    return builder.op("Add", near, builder.named("centre", folded.centre))


def _normals(builder: GraphBuilder, rows: tuple[str, ...]) -> str:
    """(n, 3) unit."""
    normal = _columns(builder, rows)
    length = builder.op("ReduceL2", normal, builder.axes(1), keepdims=1)
    return builder.op("Div", normal, builder.op("Max", length, builder.constant(np.asarray(SHORTEST, np.float32))))


def _columns(builder: GraphBuilder, rows: tuple[str, ...]) -> str:
    """Rows (1, n) as columns (n, ·)."""
    return builder.op("Transpose", builder.op("Concat", *rows, axis=0), perm=[1, 0])


def probe_uv(atlas: Atlas, count: int, seed: int) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Atlas uv (count, 2) float32 and their charts (count,): three of four inside charts, the others a little beside.

    They visit the charts that have faces in turn, each face of a chart being as likely as the next.
    """
    rng = np.random.default_rng(seed)
    by_chart = np.argsort(atlas.face_chart, kind="stable")
    _, first, faces = np.unique(atlas.face_chart[by_chart], return_index=True, return_counts=True)
    turn = np.arange(count) % len(faces)
    face = by_chart[first[turn] + rng.integers(faces[turn])]
    uv = np.einsum("nc,ncx->nx", rng.dirichlet(np.ones(3), size=count), atlas.corner_uv[face])
    beside = rng.permutation(count) < count // 4
    uv[beside] += rng.normal(scale=0.01, size=uv.shape)[beside]
    return uv.clip(0.0, 1.0).astype(np.float32), atlas.face_chart[face]


def prove_inverse(
    inverse: Inverse, content: bytes, probes: tuple[NDArray[np.float32], NDArray[np.int64]], spec: WrapParitySpec
) -> WrapParityReport:
    """Compare the networks with the ONNX model ``content`` at the first n of the probes, n in spec.sizes.

    Raises:
        ParityError: names the output, n, max |Δ| and what was allowed; or most rows are ties and prove nothing.
    """
    session, folded, networks = load_model(content), fold_frame(inverse.metadata), inverse.networks
    scale = float(folded.scale)
    rounding = 4.0 * float(np.spacing(np.float32(float(np.abs(folded.centre).max()) + scale)))
    allowed = (spec.points_atol * scale + rounding, spec.normals_atol)
    compared = ties = 0
    errors = [0.0, 0.0]
    for n in spec.sizes:
        uv, chart = probes[0][:n], probes[1][:n]
        found = run_model(session, ("points", "normals"), {"uv": uv, "chart": chart})
        seen = inverse.inputs(uv, chart)
        clear = np.minimum(networks.route(seen)[1], networks.grid.margin(seen)) > spec.tie
        for i, (name, truth) in enumerate(zip(("points", "normals"), inverse(uv, chart), strict=True)):
            errors[i] = max(errors[i], largest_difference(name, found[i], truth, clear, n, allowed[i]))
        compared, ties = compared + int(clear.sum()), ties + int((~clear).sum())
    if compared < spec.least * (compared + ties):
        found_ties = f"{ties} of {compared + ties} probes are ties between gates"
        raise ParityError(
            f"{found_ties}, expected at most {1.0 - spec.least:.0%}; report these networks, nothing was written"
        )
    return WrapParityReport(tuple(spec.sizes), compared, ties, errors[0] / scale, errors[1])
