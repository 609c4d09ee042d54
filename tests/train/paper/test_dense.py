"""The affine layer: by hand, its initial weights, several side by side."""

from __future__ import annotations

import math

import pytest
import torch

from flexpara.train.paper.dense import Dense


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def test_one_dense_layer_is_an_affine_map() -> None:
    layer = Dense(2, 1, generator=seeded())
    with torch.no_grad():
        layer.weight.copy_(torch.tensor([[2.0], [-3.0]]))
        layer.bias.fill_(0.5)
    assert layer(torch.tensor([[1.0, 1.0], [0.0, 2.0]])).tolist() == [[-0.5], [-5.5]]


def test_initial_weights_fill_their_bounds_and_biases_are_zero() -> None:
    layer = Dense(50, 400, gain=2.0, generator=seeded())
    bound = math.sqrt(3.0 * 2.0 / 50)
    assert 0.999 * bound < float(layer.weight.detach().abs().max()) <= bound
    assert float(layer.weight.detach().var()) == pytest.approx(2.0 / 50, rel=0.03)
    assert not layer.bias.any()


def test_copies_start_from_different_weights() -> None:
    layer = Dense(3, 4, copies=2, generator=seeded())
    assert not torch.equal(layer.weight[0], layer.weight[1])


def test_copies_take_one_input_for_all_or_one_each() -> None:
    layer = Dense(3, 2, copies=4, generator=seeded()).double()
    x = torch.randn(9, 3, generator=seeded(1), dtype=torch.float64)
    torch.testing.assert_close(layer(x), layer(x.expand(4, 9, 3)))
    own = torch.stack([x * i for i in range(4)])
    torch.testing.assert_close(layer(own)[2], layer(own[2])[2])
