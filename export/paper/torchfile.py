"""Writes torch networks as a self-describing ONNX file, once it is proven equal to them: those of preset paper.

n points · p patches · k charts.  Input `points` (n, 3) float32, source units; outputs `uv` (n, 2) float32 in [0, 1]²,
v up, `chart` (n) int64, `score` (n) float32.  Frame and packing are folded in; the JSON of
runtime/sessions/bundle.py is attached.

Each point visits the Assign-Net and then its own patch's Unwrap-Net only: rows are gathered by patch, unwrapped, and
scattered back.  With eight patches that is four times as fast in onnxruntime as computing all patches and choosing one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
import torch

from ...runtime.errors import ShapeError
from ..graph.builder import GraphBuilder
from ..graph.frames import unit_ball
from ..graph.metadata import PlacedCharts, Provenance, bundle_metadata
from ..graph.parity import ParityReport, ParitySpec, probe_points, prove_parity
from ..graph.proven import POINT_MAP, FileKind, check_folder, write_proven
from .lowering import Lowering, Value, cut_to_patch, is_per_patch, trace
from .torchmodel import UnwrapGraph, chart_membership, frozen_copy, truth_of

if TYPE_CHECKING:
    from pathlib import Path

    from torch import fx, nn

    from ...runtime.sessions.bundle import BundleMetadata


@dataclass(frozen=True)
class ExportSpec:
    """How a map is written."""

    kind: FileKind = field(default_factory=FileKind)
    """Which onnxruntime can read it."""
    routed: bool = True
    """Run each point through its own patch's network only; False: all patches, then the choice (fixed shapes)."""
    parity: ParitySpec = field(default_factory=ParitySpec)
    """Where and how closely torch and onnxruntime must agree."""


def export_onnx(
    model: nn.Module,
    placed: PlacedCharts,
    path: Path,
    *,
    metadata: Provenance | None = None,
    spec: ExportSpec | None = None,
) -> ParityReport:
    """Write an ONNX file and prove it equals the torch model, or raise and leave nothing behind.

    Same model, placed charts and metadata → same bytes.  The file appears whole or not at all.

    Args:
        model: see torchmodel.PatchNetworks; p = len(patch_chart) of the charts.  Neither moved nor changed.
        placed: charts, frame and atlas.
        path: of the file; its folder exists.
        metadata: source hash, settings, metrics.
        spec: None = ExportSpec().

    Raises:
        ParityError: names the output, n, the largest difference and what was allowed.
        InputError: metadata or placement that can't be written, as ShapeError: the model and the charts don't fit;
            as MissingFileError: the folder is absent.
        FlexparaError: the model uses an operation that lowering.py does not know.
    """
    spec = spec or ExportSpec()
    check_folder(path)
    facts = bundle_metadata(placed, metadata or Provenance())
    content = build_model(model, facts, spec)
    owner, most = placed.charts.face_patch, max(spec.parity.sizes)
    points = probe_points(placed.atlas, placed.frame, owner, most, spec.parity.seed)
    truth = truth_of(UnwrapGraph(frozen_copy(model), facts), spec.parity.tie)
    return write_proven(path, content, lambda content: prove_parity(truth, content, points, spec.parity))


def build_model(model: nn.Module, metadata: BundleMetadata, spec: ExportSpec) -> bytes:
    """The ONNX model in memory, checked by onnx, not yet proven equal to the torch model."""
    builder = GraphBuilder()
    frozen = frozen_copy(model)
    _check_shapes(frozen, metadata.patch_count)
    with torch.no_grad():
        _write_graph(builder, trace(frozen), metadata, spec)
    return spec.kind.serialize(builder, *POINT_MAP, metadata, metadata.to_json(), "unwrap")


def _check_shapes(model: nn.Module, patches: int) -> None:
    """The model keeps to torchmodel.PatchNetworks, for as many patches as the charts have."""
    logits, uv = model(torch.zeros((3, 3)))
    if logits.shape != (3, patches) or uv.shape != (3, patches, 2):
        found = f"logits {tuple(logits.shape)} and uv {tuple(uv.shape)} for 3 points"
        raise ShapeError(f"the model gives {found}, expected p = {patches} patches; pass the charts it was fitted to")


def _write_graph(builder: GraphBuilder, traced: fx.GraphModule, metadata: BundleMetadata, spec: ExportSpec) -> None:
    xyz = Value(unit_ball(builder, metadata), 2)
    every = Lowering(traced, builder, xyz)
    logits = every.result(0)
    patches = metadata.patch_count
    patch = builder.op("ArgMax", logits.name, axis=1, keepdims=0)
    patch_chart = np.asarray(metadata.patch_chart, dtype=np.int64)
    chart = builder.op("Gather", builder.constant(patch_chart), patch, name="chart", axis=0)
    _chart_score(builder, logits.name, chart, metadata)
    if spec.routed and any(is_per_patch(weight, patches) for weight in traced.parameters()):
        uv = _routed_uv(builder, traced, xyz, patch, metadata)
    else:
        uv = _chosen_uv(builder, every.result(1).name, patch, chart, metadata)
    zero, one = (builder.constant(np.asarray(bound, dtype=np.float32)) for bound in (0.0, 1.0))
    builder.op("Clip", uv, zero, one, name="uv")


def _chart_score(builder: GraphBuilder, logits: str, chart: str, metadata: BundleMetadata) -> str:
    """Softmax probability of the chart that answers: the sum over its patches."""
    probability = builder.op("Softmax", logits, axis=1)
    charts = builder.op("MatMul", probability, builder.constant(chart_membership(metadata)))
    axis = builder.axes(1)
    column = builder.op("GatherElements", charts, builder.op("Unsqueeze", chart, axis), axis=1)
    return builder.op("Squeeze", column, axis, name="score")


def _routed_uv(builder: GraphBuilder, traced: fx.GraphModule, xyz: Value, patch: str, metadata: BundleMetadata) -> str:
    """Atlas uv (n, 2): the rows of each patch through that patch's network and placement, then back in order."""
    placement = metadata.placement_array().astype(np.float32)
    zero, one = builder.axes(0), builder.axes(1)
    indices: list[str] = []
    results: list[str] = []
    for j, chart in enumerate(metadata.patch_chart):
        mine = builder.op("Equal", patch, builder.constant(np.asarray(j, dtype=np.int64)))
        rows = builder.op("Squeeze", builder.op("NonZero", mine), zero)
        gathered = Value(builder.op("Gather", xyz.name, rows, axis=0), xyz.rank)
        uv = Lowering(traced, builder, gathered, cut=cut_to_patch(j, metadata.patch_count)).result(1)
        turn, shift = (builder.constant(part) for part in (placement[chart, :, :2].T.copy(), placement[chart, :, 2]))
        results.append(builder.op("Gemm", builder.op("Squeeze", uv.name, one), turn, shift))
        indices.append(rows)
    together = builder.op("Concat", *results, axis=0)
    order = builder.op("Unsqueeze", builder.op("Concat", *indices, axis=0), one)
    return builder.op("ScatterND", together, order, together)


def _chosen_uv(builder: GraphBuilder, all_uv: str, patch: str, chart: str, metadata: BundleMetadata) -> str:
    """Atlas uv (n, 2): the winner among all patches' (n, p, 2), placed."""
    placement = metadata.placement_array().astype(np.float32)
    one, last = builder.axes(1), builder.axes(2)
    flat = builder.op("GatherND", all_uv, builder.op("Unsqueeze", patch, one), batch_dims=1)
    turn = builder.op("Gather", builder.constant(placement[:, :, :2].copy()), chart, axis=0)
    shift = builder.op("Gather", builder.constant(placement[:, :, 2].copy()), chart, axis=0)
    turned = builder.op("ReduceSum", builder.op("Mul", turn, builder.op("Unsqueeze", flat, one)), last, keepdims=0)
    return builder.op("Add", turned, shift)
