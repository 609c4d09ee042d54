"""Adam with a one-cycle learning rate, on lists of tensors.

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
    """Learning rate of a step: from peak / 25 up to peak over the first ``rise`` of the steps, then to peak / 10⁴ ∙ 4.

    Cosine both ways (Smith & Topin 2018).
    """
    top = rise * steps
    if step < top:
        start, end, share = peak / 25.0, peak, step / top
    else:
        start, end, share = peak, peak / 2500.0, (step - top) / max(steps - top, 1.0)
    return end + (start - end) * 0.5 * (1.0 + math.cos(math.pi * min(share, 1.0)))


class OneCycleAdam:
    """Adam (Kingma & Ba 2015) over ``steps`` steps; call ``step(loss)`` once for each."""

    def __init__(self, module: nn.Module, steps: int, peak: float) -> None:
        self._parameters = list(module.parameters())
        self._mean = [torch.zeros_like(p) for p in self._parameters]
        self._square = [torch.zeros_like(p) for p in self._parameters]
        self._count, self._steps, self._peak = 0, steps, peak

    def step(self, loss: Tensor) -> None:
        """One step down the gradient of a scalar loss."""
        gradients = torch.autograd.grad(loss, self._parameters, materialize_grads=True)
        rate = one_cycle_rate(self._count, self._steps, self._peak)
        self._count += 1
        first, second = (1.0 - beta**self._count for beta in BETAS)
        with torch.no_grad():
            torch._foreach_lerp_(self._mean, gradients, 1.0 - BETAS[0])
            torch._foreach_mul_(self._square, BETAS[1])
            torch._foreach_addcmul_(self._square, gradients, gradients, 1.0 - BETAS[1])
            scale = torch._foreach_sqrt(self._square)
            torch._foreach_div_(scale, math.sqrt(second))
            torch._foreach_add_(scale, EPSILON)
            torch._foreach_addcdiv_(self._parameters, self._mean, scale, -rate / first)
