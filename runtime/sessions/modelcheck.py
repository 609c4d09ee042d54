"""An ONNX file is looked through before a session is made of it: operators, domains, where its numbers lie.

A file may come from anyone, and a session runs what it says.  The protobuf is read here, as far as needed, without the
package onnx, which those who only ask a file do not have.  Where a field stands twice, each is looked at.  Numbers of
fields are those of onnx.proto.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import BundleError

if TYPE_CHECKING:
    from collections.abc import Iterator

ARITHMETIC = (
    "Abs",
    "Add",
    "Clip",
    "Cos",
    "Div",
    "Exp",
    "Floor",
    "LeakyRelu",
    "Max",
    "Min",
    "Mul",
    "Neg",
    "Pow",
    "Relu",
)
ARITHMETIC += ("Sigmoid", "Sin", "Softmax", "Softplus", "Sqrt", "Sub", "Tanh", "Einsum", "Gemm", "MatMul")
CHOICE = ("And", "ArgMax", "ArgMin", "Equal", "Greater", "GreaterOrEqual", "Less", "LessOrEqual", "Not", "Or", "Where")
REDUCTION = ("NonZero", "ReduceL2", "ReduceMax", "ReduceMean", "ReduceMin", "ReduceSum")
MOVEMENT = ("Cast", "Concat", "Constant", "Expand", "Gather", "GatherElements", "GatherND", "Identity", "Reshape")
MOVEMENT += ("ScatterElements", "ScatterND", "Shape", "Slice", "Split", "Squeeze", "Transpose", "Unsqueeze")
OWN_OPERATORS = frozenset((*ARITHMETIC, *CHOICE, *REDUCTION, *MOVEMENT))
"""Operators of the files that flexpara writes or has written."""
VARIADIC = frozenset((b"Concat", b"Einsum", b"Max", b"Mean", b"Min", b"Sum"))
"""Operators of any number of inputs: ONNX Runtime 1.31 falls over where one of them has no name."""
DOMAINS = (b"", b"ai.onnx")
MOST_NODES = 200_000
DEEPEST = 8
"""Graphs inside of nodes inside of graphs."""
GRAPH, OPSETS, TRAINING, FUNCTIONS = 7, 8, 20, 25
NODE, INITIALIZER, SPARSE = 1, 5, 15
INPUT, OPERATOR, ATTRIBUTE, DOMAIN = 1, 4, 5, 7
TENSOR, SUBGRAPH, TENSORS, SUBGRAPHS, SPARSE_ATTRIBUTE, SPARSE_ATTRIBUTES = 5, 6, 10, 11, 22, 23
EXTERNAL, LOCATION = 13, 14
VARINT, FIXED64, BYTES, FIXED32 = 0, 1, 2, 5
_REMEDY = "pass a file that a tool you trust wrote"

Message = memoryview


def check_model(data: bytes, name: str, operators: frozenset[str] | None = OWN_OPERATORS) -> None:
    """Refuse a model that a session should not be made of.

    Args:
        data: the file's bytes.
        name: what messages call it.
        operators: those that it may use, and then no graphs inside of nodes; None: all of ONNX's own.

    Raises:
        BundleError: no protobuf of a model, another operator or domain, functions, numbers in another file, too many
            nodes or graphs too deep in each other.
    """
    try:
        _check(memoryview(data), name, operators)
    except BundleError:
        raise
    except (ValueError, IndexError) as error:
        raise BundleError(f"{name}: no usable ONNX model ({error}), expected an exported file; {_REMEDY}") from error


def _check(model: Message, name: str, operators: frozenset[str] | None) -> None:
    nodes, graphs = 0, 0
    for field, value in fields(model):
        if field in (TRAINING, FUNCTIONS):
            raise BundleError(f"{name}: the model has functions or training steps, expected a plain graph; {_REMEDY}")
        if field == OPSETS:
            _check_domain(value, 1, name)
        if field == GRAPH:
            graphs += 1
            nodes += _check_graph(_message(value), name, operators, 1)
    if graphs == 0:
        raise ValueError("it has no graph")
    if nodes > MOST_NODES:
        raise BundleError(f"{name}: {nodes} nodes, expected at most {MOST_NODES}; {_REMEDY}")


def _check_graph(graph: Message, name: str, operators: frozenset[str] | None, depth: int) -> int:
    """How many nodes it has."""
    if depth > DEEPEST:
        raise BundleError(f"{name}: graphs lie over {DEEPEST} deep in each other, expected fewer; {_REMEDY}")
    nodes = 0
    for field, value in fields(graph):
        if field == INITIALIZER:
            _check_tensor(_message(value), name)
        elif field == SPARSE:
            _check_sparse(_message(value), name)
        elif field == NODE:
            nodes += 1 + _check_node(_message(value), name, operators, depth)
    return nodes


def _check_node(node: Message, name: str, operators: frozenset[str] | None, depth: int) -> int:
    """How many nodes lie in its graphs."""
    _check_domain(node, DOMAIN, name)
    _check_inputs(node, name)
    inside = 0
    for field, value in fields(node):
        if field == OPERATOR and operators is not None and bytes(_message(value)).decode("latin-1") not in operators:
            found = bytes(_message(value))[:40].decode("latin-1")
            raise BundleError(f"{name}: the model uses the operator {found!r}, which flexpara never writes; {_REMEDY}")
        if field != ATTRIBUTE:
            continue
        for kind, part in fields(_message(value)):
            if kind in (TENSOR, TENSORS):
                _check_tensor(_message(part), name)
            elif kind in (SPARSE_ATTRIBUTE, SPARSE_ATTRIBUTES):
                _check_sparse(_message(part), name)
            elif kind in (SUBGRAPH, SUBGRAPHS):
                if operators is not None:
                    raise BundleError(f"{name}: a node holds a graph, which flexpara never writes; {_REMEDY}")
                inside += _check_graph(_message(part), name, operators, depth + 1)
    return inside


def _check_inputs(node: Message, name: str) -> None:
    """Refuse a node of any number of inputs of which one is left out."""
    parts = [(field, bytes(_message(value))) for field, value in fields(node) if field in (INPUT, OPERATOR)]
    operator = next((value for field, value in parts if field == OPERATOR), b"")
    if operator in VARIADIC and (INPUT, b"") in parts:
        found = operator.decode("ascii")
        raise BundleError(f"{name}: an input of a node {found} has no name, expected all of them; {_REMEDY}")


def _check_domain(holder: Message | int, field: int, name: str) -> None:
    found = [bytes(_message(value)) for number, value in fields(_message(holder)) if number == field]
    foreign = next((domain for domain in found if domain not in DOMAINS), None)
    if foreign is not None:
        domain = foreign[:40].decode("latin-1")
        raise BundleError(f"{name}: the model uses the domain {domain!r}, expected ONNX's own alone; {_REMEDY}")


def _check_sparse(sparse: Message, name: str) -> None:
    for field, value in fields(sparse):
        if field in (1, 2):
            _check_tensor(_message(value), name)


def _check_tensor(tensor: Message, name: str) -> None:
    for field, value in fields(tensor):
        if field == EXTERNAL or (field == LOCATION and value != 0):
            raise BundleError(
                f"{name}: the model keeps numbers in another file, expected all of them in its own; save it as one file"
            )


def _message(value: Message | int) -> Message:
    if isinstance(value, int):
        raise ValueError("a message is a number")
    return value


def fields(message: Message) -> Iterator[tuple[int, Message | int]]:
    """(number, value) of each field of a protobuf message: numbers as int, all else as bytes; fixed ones are left out.

    Raises: ValueError, IndexError where the bytes are no message.
    """
    place = 0
    while place < len(message):
        tag, place = _varint(message, place)
        field, wire = tag >> 3, tag & 7
        if not 0 < field < 1 << 29:
            raise ValueError("a field has no number")
        if wire == VARINT:
            value, place = _varint(message, place)
            yield field, value
        elif wire == BYTES:
            size, place = _varint(message, place)
            if size > len(message) - place:
                raise ValueError("a field ends behind its message")
            yield field, message[place : place + size]
            place += size
        elif wire in (FIXED32, FIXED64):
            place += 4 if wire == FIXED32 else 8
        else:
            raise ValueError(f"a field is of kind {wire}")


def _varint(message: Message, place: int) -> tuple[int, int]:
    """A number of up to ten bytes, and where it ends."""
    value = 0
    for step in range(10):
        byte = message[place + step]
        value |= (byte & 127) << 7 * step
        if byte < 128:
            return value, place + step + 1
    raise ValueError("a number has over ten bytes")
