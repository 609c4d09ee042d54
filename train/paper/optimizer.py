"""AdamW with a half-cosine rate, all parameters as one vector, and a state that can be saved.

torch.optim would do, but its first use imports torch's compiler, and its state is not plain tensors.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

if TYPE_CHECKING:
    from .config import PaperConfig

BETAS = (0.9, 0.999)
EPSILON = 1e-8


def cosine_rate(step: int, steps: int, first: float, last: float) -> float:
    """Learning rate of a step: from ``first`` at 0 along half a cosine towards ``last`` at ``steps``."""
    return last + (first - last) * 0.5 * (1.0 + math.cos(math.pi * step / steps))


class CosineAdamW:
    """AdamW (Loshchilov & Hutter 2019) over ``config.steps`` steps.

    mean, square: (parameters,) float32 moments.  taken: steps so far.  With these three and the parameters a run goes
    on as if it had never stopped.
    """

    def __init__(self, module: nn.Module, config: PaperConfig) -> None:
        self._parameters: list[Tensor] = list(module.parameters())
        self._sizes = [parameter.numel() for parameter in self._parameters]
        self._config = config
        device = self._parameters[0].device
        self.mean = torch.zeros(sum(self._sizes), device=device)
        self.square = torch.zeros(sum(self._sizes), device=device)
        self.taken = 0

    def step(self, loss: Tensor) -> None:
        """One step down the gradient of a scalar loss; parameters it doesn't depend on only decay."""
        gradients = torch.autograd.grad(loss, self._parameters, materialize_grads=True)
        config = self._config
        rate = cosine_rate(self.taken, config.steps, config.rate, config.final_rate) * config.rate_factor
        self.taken += 1
        first, second = (1.0 - beta**self.taken for beta in BETAS)
        with torch.no_grad():
            gradient = torch.cat([part.reshape(-1) for part in gradients])
            self.mean.lerp_(gradient, 1.0 - BETAS[0])
            self.square.mul_(BETAS[1]).addcmul_(gradient, gradient, value=1.0 - BETAS[1])
            root = self.square.sqrt().div_(math.sqrt(second)).add_(EPSILON)
            change = (self.mean / root).mul_(-rate / first)
            parts = [part.view_as(own) for part, own in zip(change.split(self._sizes), self._parameters, strict=True)]
            torch._foreach_mul_(self._parameters, 1.0 - rate * config.decay)  # pyright: ignore[reportPrivateImportUsage]
            torch._foreach_add_(self._parameters, parts)  # pyright: ignore[reportPrivateImportUsage]
