"""A gated network of affine experts (train/deploy/gated.py) as ONNX nodes.

n points · d inputs · m outputs · e experts.
There are a few nodes for each level of gates, however many experts there are.

Points that have met all their gates leave the way: on each level only those still on it are gathered.  Numbers by point
are laid out as rows of length n, so that every operation runs along memory.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from onnx import TensorProto

if TYPE_CHECKING:
    from ...train.deploy.gated import GatedExperts
    from ..graph.builder import GraphBuilder


class GatedNames(NamedTuple):
    """ONNX names of the outputs: value, m rows (1, n) float32; label (n,) int64; score (n,) float32."""

    value: tuple[str, ...]
    label: str
    score: str


def write_gated(builder: GraphBuilder, x: str, network: GatedExperts) -> GatedNames:
    """Append the nodes; x: name of the points (n, d) float32."""
    dims, outputs = network.centre.shape[1], network.weights.shape[1]
    expert = _route(builder, x, network)
    weights = network.weights.transpose(1, 2, 0).reshape(outputs * (dims + 1), -1)
    rows = (weights, network.centre.T, network.radius[None] ** 2, network.share[None])
    table = np.concatenate(rows).astype(np.float32)
    found = builder.split(builder.op("Gather", builder.constant(table), expert, axis=1), [1] * len(table), axis=0)
    columns = builder.split(builder.op("Transpose", x, perm=[1, 0]), [1] * dims, axis=0)
    value = tuple(_affine(builder, columns, found[i * (dims + 1) : (i + 1) * (dims + 1)]) for i in range(outputs))
    label = builder.op("Gather", builder.constant(network.label), expert, axis=0)
    return GatedNames(value, label, _score(builder, columns, found[outputs * (dims + 1) :]))


def _affine(builder: GraphBuilder, columns: list[str], weights: list[str]) -> str:
    """(1, n): weights · (x, 1)."""
    products = [builder.op("Mul", weight, column) for weight, column in zip(weights, columns, strict=False)]
    total = products[0]
    for product in products[1:]:
        total = builder.op("Add", total, product)
    return builder.op("Add", total, weights[-1])


def _score(builder: GraphBuilder, columns: list[str], found: list[str]) -> str:
    """(n,): share · radius² / max(distance², radius²)."""
    *centre, reach, share = found
    away = None
    for column, middle in zip(columns, centre, strict=True):
        square = builder.op("Mul", *2 * (builder.op("Sub", column, middle),))
        away = square if away is None else builder.op("Add", away, square)
    far = builder.op("Max", away or reach, reach)
    score = builder.op("Mul", share, builder.op("Div", reach, far))
    return builder.op("Squeeze", score, builder.axes(0))


def _route(builder: GraphBuilder, x: str, network: GatedExperts) -> str:
    """The expert (n,) int32 of each point."""
    limit, two = (builder.constant(np.asarray(number, dtype=np.int32)) for number in (len(network.gates), 2))
    code = _first_code(builder, x, network)
    rows, here = "", code
    for _ in range(network.depth):
        on_way = builder.op("Squeeze", builder.op("NonZero", builder.op("Less", here, limit)), builder.axes(0))
        rows = builder.op("Gather", rows, on_way, axis=0) if rows else on_way
        here = builder.op("Gather", here, on_way, axis=0)
        second = builder.op("Cast", _second_side(builder, x, rows, here, network), to=TensorProto.INT32)
        choice = builder.op("Add", builder.op("Mul", here, two), second)
        here = builder.op("Gather", builder.constant(network.sides.reshape(-1)), choice, axis=0)
        code = builder.op("ScatterElements", code, rows, here, axis=0)
    return builder.op("Sub", code, limit)


def _first_code(builder: GraphBuilder, x: str, network: GatedExperts) -> str:
    """The code (n,) int32 of each point's cell."""
    grid = network.grid
    low, zero, cell = (builder.constant(np.asarray(part, dtype=np.float32)) for part in (grid.low, 0.0, grid.cell))
    place = builder.op("Floor", builder.op("Div", builder.op("Sub", x, low), cell))
    last = builder.constant((grid.shape - 1).astype(np.float32))
    inside = builder.op("Min", builder.op("Max", place, zero), last)
    steps = builder.op("Mul", inside, builder.constant(grid.strides))
    number = builder.op("ReduceSum", steps, builder.axes(1), keepdims=0)
    cell_number = builder.op("Cast", number, to=TensorProto.INT32)
    return builder.op("Gather", builder.constant(network.start), cell_number, axis=0)


def _second_side(builder: GraphBuilder, x: str, rows: str, gate: str, network: GatedExperts) -> str:
    """(r,) bool: whether the points ``rows`` are on the second side of their gates (r,)."""
    plane = builder.op("Gather", builder.constant(network.gates), gate, axis=0)
    normal, offset = builder.split(plane, [network.centre.shape[1], 1], axis=1)
    product = builder.op("Mul", builder.op("Gather", x, rows, axis=0), normal)
    along = builder.op("ReduceSum", product, builder.axes(1), keepdims=1)
    away = builder.op("Squeeze", builder.op("Add", along, offset), builder.axes(1))
    return builder.op("Greater", away, builder.constant(np.asarray(0.0, dtype=np.float32)))
