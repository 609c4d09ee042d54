"""A small ONNX graph, collected node by node, checked, and turned into bytes.

Names depend on the order of the calls alone; no time, path or stack trace is stored: equal calls give equal bytes.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from ...runtime.errors import FlexparaError, MissingDependencyError

try:
    from onnx import NodeProto, TensorProto, ValueInfoProto, checker, helper, numpy_helper, shape_inference
except ImportError as error:
    raise MissingDependencyError('onnx is missing, export needs it; pip install "flexpara[unwrap]"') from error

if TYPE_CHECKING:
    from numpy.typing import NDArray

Ends = dict[str, tuple[str, list[str | int]]]
"""Inputs or outputs: name → (dtype, shape), where a string is an axis of free length."""

ELEMENT_TYPES = {"float32": TensorProto.FLOAT, "int64": TensorProto.INT64}


@dataclass(frozen=True)
class Header:
    """What a file says besides its graph.

    opset: operator set of the default domain.  ir_version: of ONNX.  producer: name and version.  metadata: key → text,
    stored as metadata_props.  name: of the graph.
    """

    opset: int
    ir_version: int
    producer: tuple[str, str]
    metadata: dict[str, str]
    name: str = "unwrap"


@dataclass
class GraphBuilder:
    """Collects nodes and initializers; equal constants are stored once."""

    nodes: list[NodeProto] = field(default_factory=list[NodeProto])
    initializers: list[TensorProto] = field(default_factory=list[TensorProto])
    _known: dict[tuple[str, tuple[int, ...], bytes], str] = field(default_factory=dict[Any, str])

    def named(self, name: str, array: NDArray[Any]) -> str:
        """Add an initializer under this very name."""
        self.initializers.append(numpy_helper.from_array(np.asarray(array, order="C"), name))
        return name

    def constant(self, array: NDArray[Any]) -> str:
        """Name of an initializer with this content."""
        key = (array.dtype.str, array.shape, array.tobytes())
        if key not in self._known:
            self._known[key] = self.named(f"constant_{len(self._known)}", array)
        return self._known[key]

    def axes(self, *axes: int) -> str:
        """Name of an int64 (len,) initializer, as Squeeze, Unsqueeze, Expand and ReduceSum take their axes or sizes."""
        return self.constant(np.asarray(axes, dtype=np.int64))

    def op(self, kind: str, *inputs: str, name: str | None = None, **attributes: Any) -> str:
        """Append one node with one output; returns the output's name."""
        output = name or f"{kind.lower()}_{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, list(inputs), [output], name=f"node_{output}", **attributes))
        return output

    def split(self, whole: str, sizes: list[int], *, axis: int) -> list[str]:
        """Append the node that cuts ``whole`` along an axis; returns the names of the parts."""
        parts = [f"split_{len(self.nodes)}_{i}" for i in range(len(sizes))]
        node = helper.make_node("Split", [whole, self.axes(*sizes)], parts, name=f"node_{parts[0]}", axis=axis)
        self.nodes.append(node)
        return parts

    def serialize(self, inputs: Ends, outputs: Ends, header: Header) -> bytes:
        """The finished model, checked by onnx with full shape inference.

        Raises:
            FlexparaError: the nodes don't fit together.
        """

        def ends(side: Ends) -> list[ValueInfoProto]:
            return [helper.make_tensor_value_info(name, ELEMENT_TYPES[t], shape) for name, (t, shape) in side.items()]

        graph = helper.make_graph(self.nodes, header.name, ends(inputs), ends(outputs), self.initializers)
        opset = helper.make_opsetid("", header.opset)
        model = helper.make_model(graph, opset_imports=[opset], ir_version=header.ir_version)
        model.producer_name, model.producer_version = header.producer
        helper.set_model_props(model, header.metadata)
        try:
            checker.check_model(model, full_check=True)
        except (checker.ValidationError, shape_inference.InferenceError) as error:
            reason = " ".join(str(error).split())[:200]
            remedy = "try ExportSpec(routed=False), and report this model"
            raise FlexparaError(f"the graph is not valid ONNX ({reason}), expected it to be; {remedy}") from error
        return model.SerializeToString(deterministic=True)
