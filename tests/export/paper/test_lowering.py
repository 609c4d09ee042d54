"""Each operation that may be exported, against torch; and what is refused."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import onnxruntime
import pytest
import torch
from torch import Tensor, nn
from torch.nn import functional

from flexpara.export.graph.builder import GraphBuilder, Header
from flexpara.export.paper.lowering import Lowering, Value, cut_to_patch, trace
from flexpara.runtime.errors import FlexparaError

MATRIX = torch.linspace(-1.0, 1.0, 12).reshape(3, 4)
STACK = torch.linspace(-1.0, 1.0, 24).reshape(2, 3, 4)
ROW = torch.linspace(0.5, 1.5, 4)


class Function(nn.Module):
    """A function of xyz as a model: its result is both outputs."""

    def __init__(self, function: Callable[[Tensor], Tensor]) -> None:
        super().__init__()
        self.function = function

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        result = self.function(xyz)
        return result, result


def lowered(model: nn.Module, points: np.ndarray, *, cut: Callable[[Tensor], Tensor] | None = None) -> np.ndarray:
    """What onnxruntime makes of result 1."""
    builder = GraphBuilder()
    with torch.no_grad():
        value = Lowering(trace(model), builder, Value("points", 2), cut=cut).result(1)
    builder.op("Identity", value.name, name="out")
    content = builder.serialize(
        {"points": ("float32", ["n", 3])},
        {"out": ("float32", [f"axis_{axis}" for axis in range(value.rank)])},
        Header(18, 8, ("test", "0"), {}),
    )
    session = onnxruntime.InferenceSession(content, providers=["CPUExecutionProvider"])
    return np.asarray(session.run(["out"], {"points": points})[0])


OPERATIONS: dict[str, Callable[[Tensor], Tensor]] = {
    "sum of two": lambda x: x + torch.cos(x),
    "constant on the left": lambda x: 1.0 - x,
    "scalar on the right": lambda x: x / 3.0,
    "product": lambda x: torch.mul(x, x),
    "negative": lambda x: -x,
    "matmul": lambda x: x @ MATRIX,
    "matmul raises the rank": lambda x: (x @ STACK).transpose(0, 1),
    "transpose by negative axes": lambda x: (x @ STACK).transpose(-2, -1),
    "permute": lambda x: (x @ STACK).permute(1, 2, 0),
    "permute by a tuple": lambda x: torch.permute(x @ STACK, (1, 2, 0)),
    "permute by negative axes": lambda x: (x @ STACK).permute(-1, 0, 1),
    "linear": lambda x: functional.linear(x, MATRIX.T, ROW),
    "linear without bias": lambda x: functional.linear(x, MATRIX.T),
    "baddbmm": lambda x: torch.baddbmm(ROW[None, None], x.unsqueeze(0).expand(2, -1, -1), STACK),
    "bmm": lambda x: torch.bmm(x.unsqueeze(0).expand(2, -1, -1), STACK),
    "einsum": lambda x: torch.einsum("nc,pcw->npw", x, STACK),
    "silu": functional.silu,
    "relu": lambda x: functional.relu(x, inplace=False),
    "leaky relu": lambda x: functional.leaky_relu(x, 0.2),
    "leaky relu by default": functional.leaky_relu,
    "sigmoid": torch.sigmoid,
    "tanh": torch.tanh,
    "softplus": functional.softplus,
    "sin": lambda x: x.sin(),
    "exp": torch.exp,
    "concatenation with a constant factor": lambda x: torch.cat([x, torch.sin(x * 3.0), x * ROW[:3]], dim=-1),
    "stack": lambda x: torch.stack([x, x * x], dim=1),
    "stack on a new last axis": lambda x: torch.stack([x, x * x], dim=-1),
    "squeeze": lambda x: (x.unsqueeze(1) @ MATRIX).squeeze(1),
    "column": lambda x: x[:, 1],
    "range of columns": lambda x: x[:, :2],
    "last columns": lambda x: x[:, 1:],
    "columns behind an ellipsis": lambda x: (x @ STACK)[..., 1:3],
    "one of a stack": lambda x: (x @ STACK)[1, :, 2:],
    "first of a tuple of pieces": lambda x: torch.split(x @ MATRIX, 2, dim=-1)[0],
    "second of a tuple of pieces": lambda x: torch.split(x @ MATRIX, 3, dim=-1)[1],
    "one index along an axis": lambda x: torch.take_along_dim(x @ STACK, torch.ones((1, 1, 1), dtype=torch.int64), 0),
    "normalize": lambda x: functional.normalize(x, dim=-1),
    "normalize nothing": lambda x: functional.normalize(x * 0.0, dim=-1),
}


@pytest.mark.parametrize("name", OPERATIONS)
@pytest.mark.parametrize("n", [1, 7])
def test_an_operation_gives_what_torch_gives(name: str, n: int) -> None:
    points = np.random.default_rng(n).normal(size=(n, 3)).astype(np.float32)
    truth = OPERATIONS[name](torch.from_numpy(points)).numpy()
    found = lowered(Function(OPERATIONS[name]), points)
    assert found.shape == truth.shape
    assert np.abs(found - truth).max() < 2e-6


@pytest.mark.parametrize(
    "layer",
    [nn.ReLU(), nn.SiLU(), nn.LeakyReLU(0.3), nn.Tanh(), nn.Linear(3, 5)],
    ids=lambda layer: type(layer).__name__,
)
def test_a_layer_gives_what_torch_gives(layer: nn.Module) -> None:
    points = np.random.default_rng(0).normal(size=(7, 3)).astype(np.float32)
    truth = layer(torch.from_numpy(points)).detach().numpy()
    assert np.abs(lowered(Function(layer), points) - truth).max() < 1e-6


class Batched(nn.Module):
    """Two patches, one matrix each."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = nn.Parameter(STACK)

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        return xyz, (xyz @ self.weight).transpose(0, 1)


@pytest.mark.parametrize("patch", [0, 1])
def test_cutting_to_a_patch_leaves_that_patch(patch: int) -> None:
    points = np.random.default_rng(0).normal(size=(7, 3)).astype(np.float32)
    truth = Batched()(torch.from_numpy(points))[1].detach().numpy()[:, patch : patch + 1]
    assert np.abs(lowered(Batched(), points, cut=cut_to_patch(patch, 2)) - truth).max() < 1e-6


def test_equal_constants_are_stored_once() -> None:
    builder = GraphBuilder()
    with torch.no_grad():
        Lowering(trace(Function(lambda x: x * 3.0 + x * 3.0)), builder, Value("points", 2)).result(0)
    assert len(builder.initializers) == 1


def test_what_a_result_does_not_need_is_not_written() -> None:
    builder = GraphBuilder()
    with torch.no_grad():
        Lowering(trace(Batched()), builder, Value("points", 2)).result(0)
    assert builder.nodes == []


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda x: torch.cumsum(x, dim=0), "uses cumsum, expected one of"),
        (lambda x: torch.add(x, x, alpha=2), "add: got an unexpected keyword argument 'alpha'"),
        (lambda x: x if x.sum() > 0 else -x, "can't be traced"),
        (lambda _: MATRIX, "result 1 of the model is constant"),
        (lambda x: x[:, ::2], "indexes by slice"),
        (lambda x: functional.normalize(x, p=1.0), "normalizes by a 1.0-norm"),
        (lambda x: torch.take_along_dim(x, torch.zeros((2, 3), dtype=torch.int64), 1), "takes indices of shape"),
    ],
    ids=["unknown operation", "unknown option", "branch on values", "constant", "stride", "norm", "indices"],
)
def test_what_has_no_twin_is_refused_by_name(function: Callable[[Tensor], Tensor], message: str) -> None:
    with pytest.raises(FlexparaError, match=message) as caught:
        lowered(Function(function), np.zeros((2, 3), np.float32))
    assert "\n" not in str(caught.value)


def test_a_model_with_one_result_is_refused() -> None:
    with pytest.raises(FlexparaError, match="expected the tuple"):
        lowered(nn.ReLU(), np.zeros((2, 3), np.float32))


def test_nodes_that_do_not_fit_are_refused() -> None:
    with pytest.raises(FlexparaError, match="not valid ONNX"):
        lowered(Function(lambda x: torch.cat([x, x @ STACK])), np.zeros((2, 3), np.float32))
