"""AdamW of preset paper against torch's own, and what a saved state has to hold."""

from __future__ import annotations

import torch

from flexpara.train.paper.config import PaperConfig
from flexpara.train.paper.optimizer import CosineAdamW, cosine_rate

CONFIG = PaperConfig(steps=20, rate=1e-2, final_rate=1e-3, decay=0.1)


def line() -> torch.nn.Linear:
    torch.manual_seed(0)
    return torch.nn.Linear(3, 2)


def test_the_steps_are_those_of_torch() -> None:
    ours, theirs = line(), line()
    reference = torch.optim.AdamW(theirs.parameters(), weight_decay=CONFIG.decay)
    optimizer = CosineAdamW(ours, CONFIG)
    x, y = torch.randn(16, 3), torch.randn(16, 2)
    for step in range(20):
        reference.param_groups[0]["lr"] = cosine_rate(step, 20, CONFIG.rate, CONFIG.final_rate) * CONFIG.rate_factor
        reference.zero_grad()
        ((theirs(x) - y) ** 2).mean().backward()
        reference.step()
        optimizer.step(((ours(x) - y) ** 2).mean())
    torch.testing.assert_close(ours.weight, theirs.weight, atol=1e-6, rtol=1e-5)
    torch.testing.assert_close(ours.bias, theirs.bias, atol=1e-6, rtol=1e-5)


def test_the_moments_lie_in_the_order_of_the_parameters() -> None:
    module = line()
    optimizer = CosineAdamW(module, CONFIG)
    optimizer.step((module.weight * 2.0).sum() + (module.bias * 3.0).sum())
    torch.testing.assert_close(optimizer.mean, torch.tensor([0.2] * 6 + [0.3] * 2))
    torch.testing.assert_close(optimizer.square, torch.tensor([0.004] * 6 + [0.009] * 2))
