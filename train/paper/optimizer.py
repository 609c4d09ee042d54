"""AdamW with a half-cosine rate, each moment of all parameters as one vector, and a state that can be saved.

torch.optim would do, but its first use imports torch's compiler, and its state is not plain tensors.  Like torch.optim
it is written with torch's _foreach functions, which take all parameters at once and are not declared public.
"""

# pyright: reportPrivateImportUsage=false

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor, nn

if TYPE_CHECKING:
    from .config import PaperConfig


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
        self._config = config
        device, sizes = self._parameters[0].device, [own.numel() for own in self._parameters]
        self.mean = torch.zeros(sum(sizes), device=device)
        self.square = torch.zeros(sum(sizes), device=device)
        self._means = _views(self.mean, self._parameters)
        self._squares = _views(self.square, self._parameters)
        self.taken = 0

    def step(self, loss: Tensor) -> None:
        """One step down the gradient of a scalar loss; parameters it doesn't depend on only decay.

        Parameter by parameter: passes over whole vectors of the paper's nine million would each ask the system for
        fresh memory.
        """
        gradients = torch.autograd.grad(loss, self._parameters, materialize_grads=True)
        config = self._config
        rate = cosine_rate(self.taken, config.steps, config.rate, config.final_rate) * config.rate_factor
        self.taken += 1
        mean, square = config.mean_kept, config.square_kept
        first, second = 1.0 - mean**self.taken, 1.0 - square**self.taken
        with torch.no_grad():
            torch._foreach_lerp_(self._means, gradients, 1.0 - mean)
            torch._foreach_mul_(self._squares, square)
            torch._foreach_addcmul_(self._squares, gradients, gradients, value=1.0 - square)
            roots = torch._foreach_sqrt(self._squares)
            torch._foreach_div_(roots, math.sqrt(second))
            torch._foreach_add_(roots, config.least_root)
            torch._foreach_mul_(self._parameters, 1.0 - rate * config.decay)
            torch._foreach_addcdiv_(self._parameters, self._means, roots, value=-rate / first)


def _views(moment: Tensor, parameters: list[Tensor]) -> list[Tensor]:
    """The parts of a flat moment that belong to each parameter, in its shape and on the same memory."""
    parts = moment.split([own.numel() for own in parameters])
    return [part.view_as(own) for part, own in zip(parts, parameters, strict=True)]
