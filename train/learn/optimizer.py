"""Adam with a one-cycle learning rate.

torch.optim would do, but its first use imports torch's compiler, which takes longer (1 s) than fitting the Unwrap-Nets.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch

if TYPE_CHECKING:
    from torch import Tensor, nn

BETAS = (0.9, 0.999)
EPSILON = 1e-8


def one_cycle_rate(step: int, steps: int, peak: float, *, rise: float = 0.15) -> float:
    """Learning rate of a step: from peak / 25 to peak over the first ``rise`` of the steps, then to peak / 2500.

    Cosine both ways (Smith & Topin 2018).
    """
    top = rise * steps
    if step < top:
        start, end, share = peak / 25.0, peak, step / top
    else:
        start, end, share = peak, peak / 2500.0, (step - top) / max(steps - top, 1.0)
    return end + (start - end) * 0.5 * (1.0 + math.cos(math.pi * min(share, 1.0)))


class OneCycleAdam:
    """Adam (Kingma & Ba 2015) over ``steps`` steps, all parameters as one vector; call ``step(loss)`` once for each."""

    def __init__(self, module: nn.Module, steps: int, peak: float) -> None:
        self._parameters = list(module.parameters())
        self._sizes = [parameter.numel() for parameter in self._parameters]
        self._mean, self._square = torch.zeros(sum(self._sizes)), torch.zeros(sum(self._sizes))
        self._count, self._steps, self._peak = 0, steps, peak

    def step(self, loss: Tensor) -> None:
        """One step down the gradient of a scalar loss."""
        gradients = torch.autograd.grad(loss, self._parameters, materialize_grads=True)
        rate = one_cycle_rate(self._count, self._steps, self._peak)
        self._count += 1
        first, second = (1.0 - beta**self._count for beta in BETAS)
        with torch.no_grad():
            gradient = torch.cat([part.reshape(-1) for part in gradients])
            self._mean.lerp_(gradient, 1.0 - BETAS[0])
            self._square.mul_(BETAS[1]).addcmul_(gradient, gradient, value=1.0 - BETAS[1])
            change = self._mean / (self._square.sqrt() / math.sqrt(second) + EPSILON) * (-rate / first)
            for parameter, part in zip(self._parameters, change.split(self._sizes), strict=True):
                parameter.add_(part.view_as(parameter))
