"""Networks: one layer by hand, jets against finite differences and torch.func, p networks in one against p alone."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
import torch

from flexpara.train.config import NetConfig
from flexpara.train.learn.networks import (
    Dense,
    MultiChartNetworks,
    Perceptron,
    silu_jet,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

# torch.func.jvp scripts its decompositions, which torch itself calls deprecated.
pytestmark = pytest.mark.filterwarnings("ignore:`torch.jit:DeprecationWarning")

SMALL = NetConfig(width=8)


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def points(count: int, channels: int = 3, seed: int = 1) -> Tensor:
    return torch.randn(count, channels, generator=seeded(seed), dtype=torch.float64)


def derivatives(function: Callable[[Tensor], Tensor], x: Tensor, tangents: Tensor) -> Tensor:
    """(2, …): forward-mode derivatives of a pointwise function along tangents (2, n, c), by torch."""
    return torch.stack([torch.func.jvp(function, (x,), (tangent,))[1] for tangent in tangents])


def test_one_dense_layer_is_an_affine_map() -> None:
    layer = Dense(2, 1, generator=seeded())
    with torch.no_grad():
        layer.weight.copy_(torch.tensor([[2.0], [-3.0]]))
        layer.bias.fill_(0.5)
    assert layer(torch.tensor([[1.0, 1.0], [0.0, 2.0]])).tolist() == [[-0.5], [-5.5]]


def test_only_the_value_of_a_jet_gets_the_bias() -> None:
    layer = Dense(1, 1, generator=seeded())
    with torch.no_grad():
        layer.weight.fill_(2.0)
        layer.bias.fill_(10.0)
    jet = torch.tensor([3.0, 1.0, -1.0]).reshape(3, 1, 1)
    assert layer.jet(jet).flatten().tolist() == [16.0, 2.0, -2.0]


def test_initial_weights_fill_their_bounds_and_biases_are_zero() -> None:
    layer = Dense(50, 400, gain=2.0, generator=seeded())
    bound = math.sqrt(3.0 * 2.0 / 50)
    assert 0.999 * bound < float(layer.weight.detach().abs().max()) <= bound
    assert float(layer.weight.detach().var()) == pytest.approx(2.0 / 50, rel=0.03)
    assert not layer.bias.any()


def test_silu_of_a_jet_at_zero_has_slope_one_half() -> None:
    jet = silu_jet(torch.tensor([0.0, 1.0, -4.0]).reshape(3, 1, 1))
    assert jet.flatten().tolist() == [0.0, 0.5, -2.0]


@pytest.mark.parametrize("copies", [None, 3])
def test_a_jet_equals_forward_mode_derivatives(copies: int | None) -> None:
    net = Perceptron((3, 7, 5, 2), copies=copies, generator=seeded()).double()
    x, tangents = points(11), torch.stack([points(11, seed=2), points(11, seed=3)])
    jet = torch.cat([x[None], tangents])
    result = net.jet(jet if copies is None else jet[:, None])
    torch.testing.assert_close(result[0], net(x), rtol=0.0, atol=1e-13)
    torch.testing.assert_close(result[1:], derivatives(net, x, tangents), rtol=0.0, atol=1e-13)


def test_a_jet_equals_finite_differences() -> None:
    net = Perceptron((3, 6, 2), generator=seeded()).double()
    x, tangents, step = points(5), torch.stack([points(5, seed=2), points(5, seed=3)]), 1e-5
    central = torch.stack([(net(x + step * t) - net(x - step * t)) / (2.0 * step) for t in tangents])
    torch.testing.assert_close(net.jet(torch.cat([x[None], tangents]))[1:], central, rtol=0.0, atol=1e-8)


def test_the_jet_of_a_linear_network_ignores_where_it_is() -> None:
    net = Perceptron((3, 2), generator=seeded()).double()
    tangents = torch.stack([points(4, seed=2), points(4, seed=3)])
    here, there = (net.jet(torch.cat([x[None], tangents])) for x in (points(4), points(4, seed=9)))
    torch.testing.assert_close(here[1:], there[1:])
    assert not torch.allclose(here[0], there[0])


def test_p_copies_side_by_side_equal_p_networks_alone() -> None:
    many = Perceptron((3, 6, 6, 2), copies=4, generator=seeded()).double()
    x = points(9)
    for p in range(4):
        alone = Perceptron((3, 6, 6, 2), generator=seeded(7)).double()
        alone.load_state_dict({name: weight[p] for name, weight in many.state_dict().items()})
        torch.testing.assert_close(many(x)[p], alone(x), rtol=0.0, atol=1e-14)


def test_copies_start_from_different_weights() -> None:
    layer = Dense(3, 4, copies=2, generator=seeded())
    assert not torch.equal(layer.weight[0], layer.weight[1])


def test_copies_take_one_input_for_all_or_one_each() -> None:
    net = Perceptron((3, 5, 2), copies=4, generator=seeded()).double()
    x = points(9)
    torch.testing.assert_close(net(x), net(x.expand(4, 9, 3)))
    own = torch.stack([points(9, seed=i) for i in range(4)])
    torch.testing.assert_close(net(own)[2], net(own[2])[2])


def test_the_cycle_has_the_shapes_it_says() -> None:
    networks = MultiChartNetworks(5, SMALL, generator=seeded())
    cycle = networks(torch.zeros(7, 3), torch.zeros(2, 7, 3))
    assert cycle.logits.shape == (7, 5)
    assert cycle.uv.shape == (5, 7, 2)
    assert cycle.jacobian.shape == (2, 5, 7, 2)
    assert cycle.xyz.shape == cycle.normal.shape == (5, 7, 3)


def test_the_cycle_carries_the_derivatives_of_uv_along_the_tangents() -> None:
    networks = MultiChartNetworks(3, SMALL, generator=seeded()).double()
    x, tangents = points(6), torch.stack([points(6, seed=2), points(6, seed=3)])

    def unwrap(xyz: Tensor) -> Tensor:
        return networks.unwrap(torch.nn.functional.silu(networks.embedding(xyz)))

    cycle = networks(x, tangents)
    torch.testing.assert_close(cycle.uv, unwrap(x), rtol=0.0, atol=1e-13)
    torch.testing.assert_close(cycle.jacobian, derivatives(unwrap, x, tangents), rtol=0.0, atol=1e-13)
    torch.testing.assert_close(cycle.logits, networks.scores(x), rtol=0.0, atol=1e-13)
    wrapped = networks.wrap(unwrap(x))
    torch.testing.assert_close(torch.cat([cycle.xyz, cycle.normal], dim=-1), wrapped, rtol=0.0, atol=1e-13)


def test_the_generator_alone_decides_the_weights() -> None:
    first = MultiChartNetworks(3, SMALL, generator=seeded(4)).state_dict()
    torch.manual_seed(99)
    torch.rand(10)
    again, other = (MultiChartNetworks(3, SMALL, generator=seeded(seed)).state_dict() for seed in (4, 5))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not all(torch.equal(first[name], other[name]) for name in first)


def test_every_weight_gets_a_gradient() -> None:
    networks = MultiChartNetworks(2, SMALL, generator=seeded())
    cycle = networks(points(20).float(), torch.stack([points(20, seed=2), points(20, seed=3)]).float())
    torch.stack([(part**2).sum() for part in cycle]).sum().backward()
    assert all(weight.grad is not None and bool(weight.grad.any()) for weight in networks.parameters())
