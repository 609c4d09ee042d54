"""Adam against torch's own, and on a bowl whose bottom is known."""

from __future__ import annotations

import torch

from flexpara.train.learn.optimizer import OneCycleAdam, one_cycle_rate


def line(seed: int) -> torch.nn.Linear:
    torch.manual_seed(seed)
    return torch.nn.Linear(3, 2)


def test_the_steps_are_those_of_torch() -> None:
    ours, theirs = line(0), line(0)
    reference = torch.optim.Adam(theirs.parameters(), lr=1.0)
    optimizer = OneCycleAdam(ours, 20, 1e-2)
    x, y = torch.randn(16, 3), torch.randn(16, 2)
    for step in range(20):
        reference.param_groups[0]["lr"] = one_cycle_rate(step, 20, 1e-2)
        reference.zero_grad()
        ((theirs(x) - y) ** 2).mean().backward()
        reference.step()
        optimizer.step(((ours(x) - y) ** 2).mean())
    torch.testing.assert_close(ours.weight, theirs.weight, atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(ours.bias, theirs.bias, atol=1e-6, rtol=1e-5)


def test_a_parameter_that_the_loss_does_not_see_stays() -> None:
    pair = torch.nn.ModuleList([line(0), line(1)])
    before = pair[1].weight.detach().clone()  # pyright: ignore[reportCallIssue]
    OneCycleAdam(pair, 5, 1e-2).step(pair[0](torch.ones(1, 3)).sum())
    assert torch.equal(pair[1].weight, before)  # pyright: ignore[reportArgumentType]
