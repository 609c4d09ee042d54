"""What no session is made of: other operators and domains, graphs in nodes, functions, numbers in other files."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest

from flexpara.runtime.errors import BundleError
from flexpara.runtime.sessions.modelcheck import MOST_NODES, check_model, fields
from flexpara.runtime.sessions.session import UnwrapSession


def model() -> onnx.ModelProto:
    """Y = x + 1."""
    one = onnx.numpy_helper.from_array(np.ones(1, np.float32), "one")
    ends = [onnx.helper.make_tensor_value_info(name, 1, ["n"]) for name in "xy"]
    graph = onnx.helper.make_graph([onnx.helper.make_node("Add", ["x", "one"], ["y"])], "g", ends[:1], ends[1:], [one])
    return onnx.helper.make_model(graph)


def other_operator(made: onnx.ModelProto) -> None:
    made.graph.node[0].op_type = "Loop"


def other_domain(made: onnx.ModelProto) -> None:
    made.graph.node[0].domain = "com.evil"


def imported_domain(made: onnx.ModelProto) -> None:
    made.opset_import.append(onnx.helper.make_opsetid("com.microsoft", 1))


def inner_graph(made: onnx.ModelProto) -> None:
    made.graph.node[0].attribute.append(onnx.helper.make_attribute("body", model().graph))


def function(made: onnx.ModelProto) -> None:
    made.functions.append(onnx.FunctionProto(name="f"))


def external(made: onnx.ModelProto) -> None:
    tensor = made.graph.initializer[0]
    tensor.data_location = onnx.TensorProto.EXTERNAL
    tensor.external_data.add(key="location", value="../secret.bin")


def external_in_a_node(made: onnx.ModelProto) -> None:
    tensor = onnx.TensorProto(data_location=onnx.TensorProto.EXTERNAL)
    made.graph.node[0].attribute.append(onnx.helper.make_attribute("value", tensor))


def nameless_input(made: onnx.ModelProto) -> None:
    made.graph.node.append(onnx.helper.make_node("Min", ["x", ""], ["least"]))


REFUSED = {
    nameless_input: "input of a node Min has no name",
    other_operator: "operator 'Loop'",
    other_domain: "domain 'com.evil'",
    imported_domain: "domain 'com.microsoft'",
    inner_graph: "holds a graph",
    function: "functions",
    external: "another file",
    external_in_a_node: "another file",
}


def test_a_plain_model_passes() -> None:
    check_model(model().SerializeToString(), "a.onnx")


@pytest.mark.parametrize(("change", "message"), REFUSED.items())
def test_what_is_foreign_is_refused_by_name(change: Callable[[onnx.ModelProto], None], message: str) -> None:
    made = model()
    change(made)
    with pytest.raises(BundleError, match=f"a.onnx: .*{message}"):
        check_model(made.SerializeToString(), "a.onnx")


def test_a_field_of_another_tool_may_use_any_operator_but_no_other_file() -> None:
    made = model()
    other_operator(made)
    inner_graph(made)
    check_model(made.SerializeToString(), "a.onnx", operators=None)
    external(made)
    with pytest.raises(BundleError, match="another file"):
        check_model(made.SerializeToString(), "a.onnx", operators=None)


def test_a_graph_deep_in_graphs_is_refused() -> None:
    made = model()
    for _ in range(9):
        outer = model()
        outer.graph.node[0].attribute.append(onnx.helper.make_attribute("body", made.graph))
        made = outer
    with pytest.raises(BundleError, match="deep"):
        check_model(made.SerializeToString(), "a.onnx", operators=None)


def test_a_second_graph_is_looked_at_too() -> None:
    """Protobuf joins fields that stand twice."""
    made = model()
    external(made)
    with pytest.raises(BundleError, match="another file"):
        check_model(model().SerializeToString() + made.SerializeToString(), "a.onnx")


def test_too_many_nodes_are_refused() -> None:
    node = b"\x0a\x05\x22\x03Add"
    graph = node * (MOST_NODES + 1)
    size, coded = len(graph), bytearray()
    while size:
        coded.append((size & 127) | (128 if size > 127 else 0))
        size >>= 7
    with pytest.raises(BundleError, match="nodes, expected at most"):
        check_model(b"\x3a" + bytes(coded) + graph, "a.onnx")


@pytest.mark.parametrize("data", [b"", b"\x00", b"\x3a", b"\x3a\xff\x01a", b"\x3b\x00", b"\xff" * 11, b"\x38\x01"])
def test_what_is_no_model_is_refused(data: bytes) -> None:
    with pytest.raises(BundleError, match="no usable ONNX model"):
        check_model(data, "a.onnx")


def test_fields_are_read_as_protobuf_writes_them() -> None:
    assert [(number, bytes(value)) for number, value in fields(memoryview(b"\x0a\x01a\x15\0\0\0\0")) if value] == [  # type: ignore[arg-type]
        (1, b"a")
    ]


def test_a_session_refuses_before_it_reads_the_other_file(tmp_path: Path) -> None:
    made = model()
    external(made)
    (tmp_path / "a.onnx").write_bytes(made.SerializeToString())
    with pytest.raises(BundleError, match="another file"):
        UnwrapSession(tmp_path / "a.onnx")
