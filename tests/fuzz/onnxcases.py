"""ONNX files with other nodes, values and metadata: what a session must refuse before or while it runs."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import Any

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper

from .mutate import NUMBERS, by_bytes, json_text, pick

OPERATORS = (
    "Add",
    "Gather",
    "Loop",
    "If",
    "Scan",
    "Tile",
    "Expand",
    "ConstantOfShape",
    "Range",
    "Resize",
    "Pad",
    "Where",
)
OPERATORS += (
    "Shape",
    "NonZero",
    "TopK",
    "Cast",
    "Reshape",
    "Concat",
    "MatMul",
    "Einsum",
    "StringSplit",
    "RandomNormal",
)
DOMAINS = ("com.microsoft", "ai.onnx.ml", "evil.domain", "ai.onnx.training", "")
KEY = "flexpara"


def by_onnx(rng: np.random.Generator, seeds: Sequence[bytes]) -> bytes:
    """A model with one to four changes; most stay readable as protobuf."""
    if rng.random() < 0.2:
        return by_bytes(rng, seeds)
    model = onnx.ModelProto.FromString(pick(rng, seeds))
    for _ in range(1 << int(rng.integers(3))):
        pick(rng, CHANGES)(rng, model)
    return model.SerializeToString()


def _other_node(rng: np.random.Generator, model: Any) -> None:
    if model.graph.node:
        node = pick(rng, model.graph.node)
        node.op_type = pick(rng, OPERATORS)


def _other_domain(rng: np.random.Generator, model: Any) -> None:
    domain = pick(rng, DOMAINS)
    pick(rng, model.graph.node).domain = domain
    model.opset_import.append(helper.make_opsetid(domain, int(pick(rng, (1, 18, 2**31)))))


def _other_wire(rng: np.random.Generator, model: Any) -> None:
    node = pick(rng, model.graph.node)
    if node.input:
        source = pick(rng, model.graph.node)
        node.input[int(rng.integers(len(node.input)))] = pick(rng, (*source.output, "", "points"))


def _other_attribute(rng: np.random.Generator, model: Any) -> None:
    known = [attribute for node in model.graph.node for attribute in node.attribute]
    if known:
        attribute = pick(rng, known)
        attribute.i = int(pick(rng, NUMBERS)) % 2**63
        attribute.ints.extend([int(rng.integers(-9, 9))])


def _other_numbers(rng: np.random.Generator, model: Any) -> None:
    known = [tensor for tensor in model.graph.initializer if tensor.raw_data]
    if known:
        tensor = pick(rng, known)
        tensor.raw_data = by_bytes(rng, [tensor.raw_data])


def _other_shape(rng: np.random.Generator, model: Any) -> None:
    if model.graph.initializer:
        tensor = pick(rng, model.graph.initializer)
        tensor.dims.append(int(pick(rng, NUMBERS)) % 2**63)


def _external(rng: np.random.Generator, model: Any) -> None:
    """Its numbers lie in another file."""
    if not model.graph.initializer:
        return
    tensor = pick(rng, model.graph.initializer)
    tensor.ClearField("raw_data")
    tensor.data_location = TensorProto.EXTERNAL
    place = pick(rng, ("../outside/secret.bin", "/etc/passwd", "/dev/zero", "beside.bin", "link.bin"))
    for key, value in (("location", place), ("offset", "0"), ("length", "12")):
        tensor.external_data.add(key=key, value=value)


def _large(rng: np.random.Generator, model: Any) -> None:
    """A node whose output has many numbers."""
    shape = numpy_helper.from_array(np.array([int(pick(rng, (2**20, 2**31, 2**40))), 3], np.int64), "large_shape")
    model.graph.initializer.append(shape)
    node = helper.make_node("ConstantOfShape", ["large_shape"], ["large"])
    model.graph.node.insert(0, node)
    model.graph.node.append(helper.make_node("ReduceSum", ["large"], ["less"]))


def _metadata(rng: np.random.Generator, model: Any) -> None:
    for entry in model.metadata_props:
        if entry.key == KEY:
            entry.value = json_text(rng, json.loads(entry.value)).decode()
            return


def _many(rng: np.random.Generator, model: Any) -> None:
    """Nodes in a row, none of which is needed."""
    name = "points"
    for number in range(int(rng.integers(1, 3000))):
        model.graph.node.insert(0, helper.make_node("Identity", [name], [f"same_{number}"]))


CHANGES = (_other_node, _other_domain, _other_wire, _other_attribute, _other_numbers, _other_shape, _external, _large)
CHANGES += (_metadata, _many)
