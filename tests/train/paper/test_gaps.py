"""Losses: closed forms of 2 × 2 maps, gradcheck in float64, finite gradients where roots vanish, the one reduction."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
import torch

from flexpara.train.paper.gaps import cosine_gap, position_gap, weighted_mean

if TYPE_CHECKING:
    from torch import Tensor


def noise(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def test_position_gap_is_the_sum_of_coordinate_gaps() -> None:
    target = torch.tensor([[1.0, 2.0, 3.0]])
    assert position_gap(torch.tensor([[1.5, 2.0, 1.0]]), target).tolist() == [2.5]
    assert position_gap(target, target).tolist() == [0.0]


def test_position_gap_compares_every_patch_with_the_same_points() -> None:
    xyz, target = noise(4, 7, 3), noise(7, 3, seed=1)
    gap = position_gap(xyz, target)
    assert gap.shape == (4, 7)
    torch.testing.assert_close(gap[2], position_gap(xyz[2], target))


@pytest.mark.parametrize(("angle", "gap"), [(0.0, 0.0), (math.pi / 3.0, 0.5), (math.pi / 2.0, 1.0), (math.pi, 2.0)])
def test_cosine_gap_is_one_minus_the_cosine_whatever_the_length(angle: float, gap: float) -> None:
    unit = torch.tensor([[1.0, 0.0, 0.0]], dtype=torch.float64)
    for length in (0.5, 3.0):
        vector = length * torch.tensor([[math.cos(angle), math.sin(angle), 0.0]], dtype=torch.float64)
        assert cosine_gap(vector, unit).item() == pytest.approx(gap, abs=1e-7)


def test_cosine_gap_stays_within_its_range() -> None:
    unit = torch.nn.functional.normalize(noise(200, 3, seed=1), dim=-1)
    gap = cosine_gap(noise(5, 200, 3), unit)
    assert gap.shape == (5, 200)
    assert gap.min().item() >= 0.0
    assert gap.max().item() <= 2.0


def test_gaps_have_the_gradients_of_their_definitions() -> None:
    unit = torch.nn.functional.normalize(noise(4, 3, seed=1), dim=-1)
    vector = noise(2, 4, 3).requires_grad_()
    assert torch.autograd.gradcheck(lambda v: cosine_gap(v, unit), vector)
    assert torch.autograd.gradcheck(lambda v: position_gap(v, unit), vector)


def test_cosine_gap_of_no_vector_is_one_with_a_finite_gradient() -> None:
    vector = torch.zeros(1, 3, requires_grad=True)
    gap = cosine_gap(vector, torch.tensor([[0.0, 0.0, 1.0]]))
    gap.sum().backward()
    assert gap.tolist() == [1.0]
    assert vector.grad is not None
    assert vector.grad.isfinite().all()


def test_weights_of_one_give_the_sum_over_patches_of_means() -> None:
    value = noise(3, 10)
    torch.testing.assert_close(weighted_mean(value, torch.ones(3, 10).double()), value.mean(dim=1).sum())


def test_one_hot_weights_equal_the_subset() -> None:
    value, label = noise(3, 10), torch.arange(10) % 3
    weight = torch.nn.functional.one_hot(label, 3).T.double()
    expected = torch.stack([value[k, i] for i, k in enumerate(label.tolist())]).mean()
    torch.testing.assert_close(weighted_mean(value, weight), expected)


def test_the_weighted_mean_does_not_depend_on_the_number_of_samples() -> None:
    value, weight = noise(3, 10), noise(3, 10, seed=1).abs()
    twice = weighted_mean(torch.cat([value, value], dim=1), torch.cat([weight, weight], dim=1))
    torch.testing.assert_close(twice, weighted_mean(value, weight))
