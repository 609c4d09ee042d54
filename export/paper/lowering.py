"""From a torch model to ONNX nodes: traced once by torch.fx, then each operation is written down as its ONNX twin.

torch.onnx.export(dynamo=True) does this for any model, in about 4 s and with warnings of its own; the few operations of
the deployed networks take 0.1 s this way.  What `_OPERATIONS` lacks is refused by name; parity.py proves the result.
n points · p patches.  What does not depend on the points is computed by torch and becomes a float32 initializer.
"""

from __future__ import annotations

import inspect
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np
from torch import Tensor, fx, nn
from torch.fx.proxy import TraceError

from ...runtime.errors import FlexparaError

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from ..graph.builder import GraphBuilder


class Value(NamedTuple):
    """A tensor that depends on the points: its ONNX name and its number of axes."""

    name: str
    rank: int


class Pieces(NamedTuple):
    """A tensor cut into pieces of ``size`` along axis ``dim``; piece i is written when it is asked for."""

    whole: Value
    size: int
    dim: int


class _Flat(fx.Tracer):
    """Looks inside every module, so that only functions are left."""

    def is_leaf_module(self, m: nn.Module, module_qualified_name: str) -> bool:
        return False


def trace(model: nn.Module) -> fx.GraphModule:
    """The model's forward as a list of operations.

    Raises:
        FlexparaError: forward branches on the values or the number of points, which an ONNX graph can't follow.
    """
    try:
        return fx.GraphModule(model, _Flat().trace(model))
    except (TraceError, TypeError, RuntimeError) as error:
        reason = str(error).splitlines()[0]
        message = f"{type(model).__name__}.forward can't be traced ({reason}), expected plain tensor operations"
        raise FlexparaError(f"{message}; remove branches and loops over points") from error


class Lowering:
    """Writes results of a traced model into a builder, each operation once.

    cut is applied to every parameter first: cut_to_patch() leaves the networks of one patch.
    """

    def __init__(
        self,
        traced: fx.GraphModule,
        builder: GraphBuilder,
        xyz: Value,
        *,
        cut: Callable[[Tensor], Tensor] | None = None,
    ) -> None:
        self._traced, self._builder, self._cut = traced, builder, cut
        self._known: dict[fx.Node, Any] = {node: xyz for node in traced.graph.nodes if node.op == "placeholder"}

    def result(self, index: int) -> Value:
        """Result number ``index`` of the model's forward.

        Raises:
            FlexparaError: an operation without an ONNX twin here, or a result that does not depend on the points.
        """
        (output,) = (node for node in self._traced.graph.nodes if node.op == "output")
        results = cast("tuple[fx.Node, ...]", output.args[0])
        if not isinstance(results, tuple) or len(results) != 2:
            raise FlexparaError(f"the model returns {results!r}, expected the tuple (logits, uv); change its forward")
        value = self._value(results[index])
        if not isinstance(value, Value):
            raise FlexparaError(
                f"result {index} of the model is constant, expected it to depend on the points; train it"
            )
        return value

    def _value(self, node: fx.Node) -> Any:
        if node not in self._known:
            self._known[node] = self._parameter(node) if node.op == "get_attr" else self._operation(node)
        return self._known[node]

    def _parameter(self, node: fx.Node) -> Tensor:
        owner: Any = self._traced
        for part in str(node.target).split("."):
            owner = getattr(owner, part)
        tensor = cast("Tensor", owner).detach()
        return tensor if self._cut is None else self._cut(tensor)

    def _operation(self, node: fx.Node) -> Any:
        arguments: Any = fx.map_arg((node.args, node.kwargs), self._value)
        if any(isinstance(self._known[parent], Value | Pieces) for parent in node.all_input_nodes):
            return _write(self._builder, node, *arguments)
        return _call(node, *arguments)


def cut_to_patch(patch: int, patches: int) -> Callable[[Tensor], Tensor]:
    """Parameters of shape (p, ·, ·) → (1, ·, ·), all others as they are; the model's uv come out as (n, 1, 2)."""
    return lambda weight: weight[patch : patch + 1] if is_per_patch(weight, patches) else weight


def is_per_patch(weight: Tensor, patches: int) -> bool:
    """True for a parameter of shape (p, ·, ·), which holds one matrix a patch."""
    return weight.ndim == 3 and weight.shape[0] == patches


def _call(node: fx.Node, positional: tuple[Any, ...], named: dict[str, Any]) -> Any:
    """The operation itself, on constants."""
    if isinstance(node.target, str):
        return getattr(positional[0], node.target)(*positional[1:], **named)
    return node.target(*positional, **named)


def _write(builder: GraphBuilder, node: fx.Node, positional: tuple[Any, ...], named: dict[str, Any]) -> Value | Pieces:
    """Append the ONNX twin of one operation."""
    kind = node.target if isinstance(node.target, str) else getattr(node.target, "__name__", str(node.target))
    known = ", ".join(sorted(_OPERATIONS))
    if kind not in _OPERATIONS:
        raise FlexparaError(f"the model uses {kind}, expected one of {known}; add it to export/paper/lowering.py")
    operation = _OPERATIONS[kind]
    try:
        bound = inspect.signature(operation).bind(builder, *positional, **named)
    except TypeError as error:
        raise FlexparaError(f"the model's {kind}: {error}, expected {inspect.signature(operation)}") from error
    return operation(*bound.args, **bound.kwargs)


Operand = Value | Tensor | float


def _name(builder: GraphBuilder, operand: Operand) -> str:
    """The ONNX name of an operand; constants become float32 initializers."""
    if isinstance(operand, Value):
        return operand.name
    array = operand.numpy() if isinstance(operand, Tensor) else np.asarray(operand)
    return builder.constant(array.astype(np.float32))


def _rank(operand: Operand) -> int:
    if isinstance(operand, Value):
        return operand.rank
    return operand.ndim if isinstance(operand, Tensor) else 0


def _unary(kind: str) -> Callable[..., Value]:
    def write(builder: GraphBuilder, x: Value, *, inplace: bool = False) -> Value:
        return Value(builder.op(kind, x.name), x.rank)

    return write


def _binary(kind: str) -> Callable[..., Value]:
    def write(builder: GraphBuilder, x: Operand, y: Operand) -> Value:
        return Value(builder.op(kind, _name(builder, x), _name(builder, y)), max(_rank(x), _rank(y)))

    return write


_add, _matmul = _binary("Add"), _binary("MatMul")


def _silu(builder: GraphBuilder, x: Value, *, inplace: bool = False) -> Value:
    return Value(builder.op("Mul", x.name, builder.op("Sigmoid", x.name)), x.rank)


def _leaky_relu(builder: GraphBuilder, x: Value, negative_slope: float = 0.01, inplace: bool = False) -> Value:
    return Value(builder.op("LeakyRelu", x.name, alpha=negative_slope), x.rank)


def _linear(builder: GraphBuilder, x: Value, weight: Tensor, bias: Tensor | None = None) -> Value:
    product = _matmul(builder, x, weight.T)
    return product if bias is None else _add(builder, product, bias)


def _baddbmm(builder: GraphBuilder, bias: Tensor, x: Value, weight: Tensor) -> Value:
    return _add(builder, _matmul(builder, x, weight), bias)


def _concatenate(builder: GraphBuilder, tensors: Sequence[Operand], dim: int = 0) -> Value:
    joined = builder.op("Concat", *(_name(builder, tensor) for tensor in tensors), axis=dim)
    return Value(joined, _rank(tensors[0]))


def _stack(builder: GraphBuilder, tensors: Sequence[Value], dim: int = 0) -> Value:
    return _concatenate(builder, [_unsqueeze(builder, tensor, dim) for tensor in tensors], dim)


def _transpose(builder: GraphBuilder, x: Value, dim0: int, dim1: int) -> Value:
    order = list(range(x.rank))
    order[dim0], order[dim1] = order[dim1], order[dim0]
    return _permute(builder, x, *order)


def _permute(builder: GraphBuilder, x: Value, *dims: int | Sequence[int]) -> Value:
    return Value(builder.op("Transpose", x.name, perm=[axis % x.rank for axis in _flat(dims)]), x.rank)


def _flat(sizes: Sequence[int | Sequence[int]]) -> list[int]:
    """Sizes or axes as torch takes them: (1, 2, 3) or ((1, 2, 3),)."""
    return [axis for part in sizes for axis in ([part] if isinstance(part, int) else part)]


def _unsqueeze(builder: GraphBuilder, x: Value, dim: int) -> Value:
    return Value(builder.op("Unsqueeze", x.name, builder.axes(dim)), x.rank + 1)


def _expand(builder: GraphBuilder, x: Value, *sizes: int | Sequence[int]) -> Value:
    """An axis is kept by −1 in torch, by 1 in ONNX."""
    kept = [1 if size == -1 else size for size in _flat(sizes)]
    return Value(builder.op("Expand", x.name, builder.axes(*kept)), len(kept))


def _einsum(builder: GraphBuilder, equation: str, *operands: Operand) -> Value:
    names = [_name(builder, operand) for operand in operands]
    return Value(builder.op("Einsum", *names, equation=equation), len(equation.rpartition("->")[2].strip()))


def _squeeze(builder: GraphBuilder, x: Value, dim: int) -> Value:
    return Value(builder.op("Squeeze", x.name, builder.axes(dim)), x.rank - 1)


def _slice(builder: GraphBuilder, x: Value, start: int, stop: int, axis: int) -> Value:
    return Value(builder.op("Slice", x.name, *(builder.axes(i) for i in (start, stop, axis))), x.rank)


def _getitem(builder: GraphBuilder, x: Value | Pieces, key: Any) -> Value:
    """Indexing by integers, slices of step 1 and an ellipsis; piece ``key`` of a split."""
    if isinstance(x, Pieces):
        return _slice(builder, x.whole, key * x.size, (key + 1) * x.size, x.dim)
    parts: tuple[Any, ...] = key if isinstance(key, tuple) else (key,)
    if Ellipsis in parts:
        at, missing = parts.index(Ellipsis), x.rank - len(parts) + 1
        parts = (*parts[:at], *[slice(None)] * missing, *parts[at + 1 :])
    axis = 0
    for part in parts:
        if isinstance(part, int):
            index = builder.constant(np.asarray(part, dtype=np.int64))
            x = Value(builder.op("Gather", x.name, index, axis=axis), x.rank - 1)
        elif isinstance(part, slice) and part.step in (None, 1):
            if part != slice(None):
                stop = np.iinfo(np.int64).max if part.stop is None else part.stop
                x = _slice(builder, x, part.start or 0, int(stop), axis)
            axis += 1
        else:
            raise FlexparaError(f"the model indexes by {part!r}, expected integers and slices of step 1; rewrite it")
    return x


def _split(builder: GraphBuilder, x: Value, split_size_or_sections: int, dim: int = 0) -> Pieces:
    return Pieces(x, split_size_or_sections, dim)


def _take_along_dim(builder: GraphBuilder, x: Value, indices: Tensor, dim: int) -> Value:
    """One constant index for all: the axis stays, of length 1."""
    if indices.numel() != 1:
        found = f"indices of shape {tuple(indices.shape)}"
        raise FlexparaError(f"the model takes {found} along an axis, expected one constant index; gather outside")
    return Value(builder.op("Gather", x.name, builder.axes(int(indices)), axis=dim), x.rank)


def _normalize(
    builder: GraphBuilder, x: Value, p: float = 2.0, dim: int = 1, eps: float = 1e-12, out: None = None
) -> Value:
    if p != 2.0:
        raise FlexparaError(f"the model normalizes by a {p}-norm, expected p = 2; rewrite it")
    length = builder.op("ReduceL2", x.name, builder.axes(dim), keepdims=1)
    floor = builder.constant(np.asarray(eps, dtype=np.float32))
    return Value(builder.op("Div", x.name, builder.op("Max", length, floor)), x.rank)


_OPERATIONS: dict[str, Callable[..., Value | Pieces]] = {
    **{kind: _unary(kind.capitalize()) for kind in ("relu", "sigmoid", "tanh", "sin", "cos", "exp", "neg", "softplus")},
    **{kind: _binary(kind.capitalize()) for kind in ("add", "sub", "mul", "div")},
    **{"truediv": _binary("Div"), "matmul": _matmul, "bmm": _matmul, "linear": _linear, "baddbmm": _baddbmm},
    **{"silu": _silu, "leaky_relu": _leaky_relu, "einsum": _einsum},
    **{"cat": _concatenate, "concat": _concatenate, "stack": _stack, "unsqueeze": _unsqueeze, "expand": _expand},
    **{"transpose": _transpose, "permute": _permute, "squeeze": _squeeze},
    **{"getitem": _getitem, "split": _split, "take_along_dim": _take_along_dim, "normalize": _normalize},
}
"""Name of the torch function or method → its twin.  Signatures are torch's; what they leave out is refused."""
