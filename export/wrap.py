"""Writes `<stem>.wrap.onnx`, the inverse of an atlas, once it is proven equal to the torch model.

n rows · p patches · k charts.  Inputs `uv` (n, 2) float32 in [0, 1]², v up, and `chart` (n) int64; outputs `points`
(n, 3) float32 in source units and `normals` (n, 3) float32 of unit length.  Frame and packing are folded in;
runtime/bundle.py's JSON is attached, with kind "wrap".

Each row visits its chart's Assign-Net, where the chart has several patches, and then one patch's Wrap-Net: rows are
gathered by chart and patch, answered, and scattered back into NaN, which is what rows of no known chart stay.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import torch
from torch import Tensor, nn

from ..runtime.sessions.wrapsession import wrap_json
from ..train.deploy.fit_wrap import patch_table
from .builder import GraphBuilder
from .graph import fold_frame
from .lowering import Lowering, Value, cut_to_patch, trace
from .metadata import Provenance, bundle_metadata
from .proven import FileKind, check_folder, frozen_copy, write_proven
from .wrapgraph import (
    WrapGraph,
    WrapParityReport,
    WrapParitySpec,
    check_shapes,
    fold_placement,
    probe_uv,
    prove_inverse,
)

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray
    from torch import fx

    from ..runtime.mesh import Atlas, Charts, Frame
    from ..runtime.sessions.bundle import BundleMetadata
    from .builder import Ends


INPUTS: Ends = {"uv": ("float32", ["n", 2]), "chart": ("int64", ["n"])}
OUTPUTS: Ends = {"points": ("float32", ["n", 3]), "normals": ("float32", ["n", 3])}


@dataclass(frozen=True)
class WrapSpec:
    """How an inverse is written."""

    kind: FileKind = field(default_factory=FileKind)
    """Which onnxruntime can read it."""
    parity: WrapParitySpec = field(default_factory=WrapParitySpec)
    """Where and how closely torch and onnxruntime must agree."""


def export_wrap(
    model: nn.Module,
    frame: Frame,
    atlas: Atlas,
    charts: Charts,
    path: Path,
    *,
    metadata: Provenance | None = None,
    spec: WrapSpec | None = None,
) -> WrapParityReport:
    """Write the inverse and prove that it equals the torch model, or raise and leave nothing behind.

    Same model, frame, atlas, charts and metadata → same bytes.  The file appears whole or not at all.

    Args:
        model: see wrapgraph.WrapNetworks, and PatchChooser where a chart has several patches; p = len(patch_chart).
            Neither moved nor changed.
        frame: source units → unit ball.
        atlas: of pack(); its placement must be set, its uv serve as probes.
        charts: patch_chart and face_patch are used.
        path: of the file; its folder exists.
        metadata: source hash, settings, metrics.
        spec: None = WrapSpec().

    Raises:
        ParityError: names the output, n, the largest difference and what was allowed.
        InputError: metadata or placement that can't be written, as ShapeError: the model and the charts don't fit;
            as MissingFileError: the folder is absent.
        FlexparaError: the model uses an operation that lowering.py does not know.
    """
    spec = spec or WrapSpec()
    check_folder(path)
    facts = bundle_metadata(frame, atlas, charts, metadata or Provenance())
    content = build_inverse(model, facts, spec)
    probes = probe_uv(atlas, charts.face_patch, max(spec.parity.sizes), spec.parity.seed)
    graph = WrapGraph(frozen_copy(model), facts)
    return write_proven(path, content, lambda content: prove_inverse(graph, content, probes, spec.parity))


def build_inverse(model: nn.Module, metadata: BundleMetadata, spec: WrapSpec) -> bytes:
    """The ONNX model in memory, checked by onnx, not yet proven equal to the torch model."""
    builder, frozen = GraphBuilder(), frozen_copy(model)
    with torch.no_grad():
        check_shapes(frozen, metadata)
        _write_graph(builder, frozen, metadata)
    return spec.kind.serialize(builder, INPUTS, OUTPUTS, metadata, wrap_json(metadata), "wrap")


class _Wrap(nn.Module):
    """The model's wrap as a forward of uv alone, for whichever patch its parameters are cut to."""

    first: Tensor

    def __init__(self, model: nn.Module) -> None:
        super().__init__()
        self.model = model
        self.register_buffer("first", torch.zeros(1, dtype=torch.int64))

    def forward(self, uv: Tensor) -> tuple[Tensor, Tensor]:
        return self.model.wrap(uv, self.first)  # type: ignore[operator]


class _Scores(_Wrap):
    """Likewise its patch_scores, for whichever chart; lowering.py wants two results."""

    def forward(self, uv: Tensor) -> tuple[Tensor, Tensor]:
        return self.model.patch_scores(uv, self.first), uv  # type: ignore[operator]


class _Traced(NamedTuple):
    """The two maps, traced; scores is None where each chart is one patch."""

    wrap: fx.GraphModule
    scores: fx.GraphModule | None


class _Rows(NamedTuple):
    """ONNX names of some rows: their numbers (r,) among all, and their chart coordinates (r, 2)."""

    numbers: str
    plane: str


def _write_graph(builder: GraphBuilder, model: nn.Module, metadata: BundleMetadata) -> None:
    table = patch_table(np.asarray(metadata.patch_chart, dtype=np.int64), metadata.chart_count)
    traced = _Traced(trace(_Wrap(model)), trace(_Scores(model)) if table.shape[1] > 1 else None)
    numbers: list[str] = []
    results: list[str] = []
    for chart, row in enumerate(table):
        of_chart = _rows_of_chart(builder, chart, metadata)
        for patch, rows in _rows_of_patches(builder, traced, of_chart, chart, row[row >= 0], len(table)):
            lowering = Lowering(
                traced.wrap, builder, Value(rows.plane, 2), cut=cut_to_patch(patch, metadata.patch_count)
            )
            results.append(builder.op("Concat", *(lowering.result(i).name for i in (0, 1)), axis=1))
            numbers.append(rows.numbers)
    answers = _in_source_units(builder, builder.op("Concat", *results, axis=0), metadata)
    order = builder.op("Unsqueeze", builder.op("Concat", *numbers, axis=0), builder.axes(1))
    shape = builder.op("Concat", builder.op("Shape", "chart"), builder.axes(6), axis=0)
    nothing = builder.op("Expand", builder.constant(np.full((1, 1), np.nan, dtype=np.float32)), shape)
    every = builder.op("ScatterND", nothing, order, answers)
    builder.op("Slice", every, *(builder.axes(i) for i in (0, 3, 1)), name="points")
    builder.op("Slice", every, *(builder.axes(i) for i in (3, 6, 1)), name="normals")


def _rows_equal(builder: GraphBuilder, labels: str, value: int) -> str:
    """Indices (r,) where the int64 labels (n,) have that value."""
    mine = builder.op("Equal", labels, builder.constant(np.asarray(value, dtype=np.int64)))
    return builder.op("Squeeze", builder.op("NonZero", mine), builder.axes(0))


def _rows_of_chart(builder: GraphBuilder, chart: int, metadata: BundleMetadata) -> _Rows:
    """The rows of a chart, in its own coordinates."""
    placement = fold_placement(metadata)
    rows = _rows_equal(builder, "chart", chart)
    shifted = builder.op("Sub", builder.op("Gather", "uv", rows, axis=0), builder.constant(placement.shift[chart]))
    return _Rows(rows, builder.op("MatMul", shifted, builder.constant(placement.turn[chart].T.copy())))


def _rows_of_patches(
    builder: GraphBuilder, traced: _Traced, rows: _Rows, chart: int, patches: NDArray[np.int64], charts: int
) -> list[tuple[int, _Rows]]:
    """The rows of a chart, parted by the patch of the largest score."""
    if len(patches) < 2 or traced.scores is None:
        return [(int(patch), rows) for patch in patches]
    scores = Lowering(traced.scores, builder, Value(rows.plane, 2), cut=cut_to_patch(chart, charts)).result(0)
    own = builder.op("Slice", scores.name, *(builder.axes(i) for i in (0, len(patches), 1)))
    winner = builder.op("ArgMax", own, axis=1, keepdims=0)
    parted: list[tuple[int, _Rows]] = []
    for column, patch in enumerate(patches):
        mine = _rows_equal(builder, winner, column)
        parted.append((int(patch), _Rows(*(builder.op("Gather", part, mine, axis=0) for part in rows))))
    return parted


def _in_source_units(builder: GraphBuilder, found: str, metadata: BundleMetadata) -> str:
    """Positions and normals (r, 6) → points in source units and unit normals; WrapSession zeroes both centres."""
    folded = fold_frame(metadata)
    low, high, tiny = (builder.constant(np.asarray(bound, dtype=np.float32)) for bound in (-1.0, 1.0, 1e-12))
    xyz = builder.op("Clip", builder.op("Slice", found, *(builder.axes(i) for i in (0, 3, 1))), low, high)
    away = builder.op("Mul", xyz, builder.named("scale", folded.scale))
    near = builder.op("Add", away, builder.named("centre_rest", folded.centre_rest))
    points = builder.op("Add", near, builder.named("centre", folded.centre))
    normal = builder.op("Slice", found, *(builder.axes(i) for i in (3, 6, 1)))
    length = builder.op("Max", builder.op("ReduceL2", normal, builder.axes(1), keepdims=1), tiny)
    return builder.op("Concat", points, builder.op("Div", normal, length), axis=1)
