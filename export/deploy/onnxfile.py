"""Writes the self-describing ONNX file of the deployed networks, once it is proven equal to them.   No torch.

n points · k charts.  Input `points` (n, 3) float32, source units; outputs `uv` (n, 2) float32 in [0, 1]², v up, `chart`
(n) int64, `score` (n) float32.  Frame and packing are folded in; runtime/sessions/bundle.py's JSON is attached.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from ...runtime.errors import ShapeError
from ..graph.builder import GraphBuilder
from ..graph.frames import fold_frame, unit_ball
from ..graph.metadata import PlacedCharts, Provenance, bundle_metadata
from ..graph.parity import ParityReport, ParitySpec, Truth, probe_points, prove_parity
from ..graph.proven import POINT_MAP, FileKind, check_folder, write_proven
from .onnxgraph import write_gated

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from ...runtime.sessions.bundle import BundleMetadata
    from ...train.deploy.gated import GatedExperts


@dataclass(frozen=True)
class NetworkSpec:
    """How the deployed networks are written."""

    kind: FileKind = field(default_factory=FileKind)
    """Which onnxruntime can read the file."""
    parity: ParitySpec = field(default_factory=lambda: ParitySpec(uv_atol=1e-5, score_atol=1e-4, tie=1e-6))
    """Where and how closely they and onnxruntime must agree.  tie: distance from a gate or a cell's side (unit ball,
    cells) within which rounding decides."""


def export_networks(
    networks: GatedExperts,
    placed: PlacedCharts,
    path: Path,
    *,
    metadata: Provenance | None = None,
    spec: NetworkSpec | None = None,
) -> ParityReport:
    """Write an ONNX file and prove that it equals the networks, or raise and leave nothing behind.

    Same networks, placed charts and metadata → same bytes.  The file appears whole or not at all.

    Args:
        networks: unit ball (n, 3) → chart coordinates, chart, score.
        placed: charts, frame and atlas.
        path: of the file; its folder exists.
        metadata: source hash, settings, metrics.
        spec: None = NetworkSpec().

    Raises:
        ParityError: names the output, n, the largest difference and what was allowed.
        InputError: metadata or placement that can't be written, as ShapeError: networks and charts don't fit; as
            MissingFileError: the folder is absent.
    """
    spec = spec or NetworkSpec()
    check_folder(path)
    facts = bundle_metadata(placed, metadata or Provenance())
    networks = place(networks, facts)
    content = build_networks(networks, facts, spec.kind)
    owner, most = placed.charts.face_chart, max(spec.parity.sizes)
    points = probe_points(placed.atlas, placed.frame, owner, most, spec.parity.seed)
    model = NetworkTruth(networks, facts, spec.parity.tie)
    return write_proven(path, content, lambda content: prove_parity(model, content, points, spec.parity))


def place(networks: GatedExperts, metadata: BundleMetadata) -> GatedExperts:
    """The networks with the placement of each expert's chart in its weights: they then answer in atlas uv.

    Raises: ShapeError for a network of other outputs, or of charts that the placement does not know.
    """
    if networks.weights.shape[1:] != (2, 4) or networks.label.max() >= metadata.chart_count:
        found = f"weights of shape {networks.weights.shape}, charts up to {networks.label.max()}"
        expected = f"expected (e, 2, 4) and charts below {metadata.chart_count}"
        raise ShapeError(f"{found}, {expected}; pass the charts that the networks were fitted to")
    placement = metadata.placement_array()[networks.label]
    weights = placement[:, :, :2] @ networks.weights.astype(np.float64)
    weights[:, :, 3] += placement[:, :, 2]
    return replace(networks, weights=weights.astype(np.float32))


def build_networks(placed: GatedExperts, metadata: BundleMetadata, kind: FileKind) -> bytes:
    """The ONNX model in memory, checked by onnx, not yet proven equal to the networks."""
    builder = GraphBuilder()
    names = write_gated(builder, unit_ball(builder, metadata), placed)
    zero, one = (builder.constant(np.asarray(bound, dtype=np.float32)) for bound in (0.0, 1.0))
    uv = builder.op("Transpose", builder.op("Concat", *names.value, axis=0), perm=[1, 0])
    builder.op("Clip", uv, zero, one, name="uv")
    builder.op("Identity", names.label, name="chart")
    builder.op("Identity", names.score, name="score")
    return kind.serialize(builder, *POINT_MAP, metadata, metadata.to_json(), "unwrap")


@dataclass(frozen=True, eq=False)
class NetworkTruth:
    """What the file has to say at points (n, 3) float32 in source units, as parity.py asks for it."""

    placed: GatedExperts
    metadata: BundleMetadata
    tie: float

    def __call__(self, points: NDArray[np.float32]) -> Truth:
        """See the class."""
        folded = fold_frame(self.metadata)
        xyz = ((points - folded.centre) - folded.centre_rest) / folded.scale
        expert, margin = self.placed.route(xyz)
        uv, chart, score = self.placed.answer(xyz, expert)
        clear = np.minimum(margin, self.placed.grid.margin(xyz)) > self.tie
        return Truth(uv.clip(0.0, 1.0), chart, score, expert, clear)
