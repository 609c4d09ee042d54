"""Training of preset ``paper``: input and config in, networks out; killed and resumed as if unbroken.

Every step: draw a batch, one mode's loss, AdamW.  All chance comes from one generator on the CPU, so on a CPU a run
repeats bit for bit on the same machine and number of threads.  On CUDA gradients of gathered points are summed in any
order, so there it repeats to rounding only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, cast

import torch

from ...runtime.errors import FlexparaError, InputError
from .batches import BatchSource
from .checkpoint import State
from .global_step import global_loss
from .multichart_step import chart_loss
from .networks import GlobalNetworks, MultiChartPaperNetworks
from .optimizer import CosineAdamW

if TYPE_CHECKING:
    from collections.abc import Callable

    from .batches import PaperInput
    from .checkpoint import Checkpoints
    from .config import PaperConfig
    from .networks import PaperNetworks

REPORT_EVERY = 20
"""Steps between two calls of progress."""


def make_networks(config: PaperConfig, generator: torch.Generator) -> PaperNetworks:
    """Networks of the mode with their initial weights, on the CPU."""
    if config.mode == "global":
        return GlobalNetworks(config.nets, generator=generator)
    return MultiChartPaperNetworks(
        config.charts, config.nets, generator=generator, bidirectional=config.ablation.chart_bidirectional
    )


def choose_device(config: PaperConfig) -> torch.device:
    """The device that the config asks for.

    Raises:
        InputError: cuda is asked for and absent.
    """
    if config.device == "cuda" and not torch.cuda.is_available():
        raise InputError("device is cuda, but torch finds none; choose device auto or cpu, or install a CUDA build")
    return torch.device("cuda" if config.device != "cpu" and torch.cuda.is_available() else "cpu")


@dataclass(eq=False)
class Training:
    """What a training step changes: networks, optimizer, and the generator of the batches."""

    networks: PaperNetworks
    optimizer: CosineAdamW
    generator: torch.Generator

    @classmethod
    def begin(cls, config: PaperConfig, samples: PaperInput, device: torch.device) -> Training:
        """A fresh run."""
        generator = torch.Generator().manual_seed(config.seed)
        networks = make_networks(config, generator)
        if isinstance(networks, MultiChartPaperNetworks):
            networks.spread_scores(torch.from_numpy(samples.points).float(), config.score_spread)
        networks = networks.to(device)
        return cls(networks, CosineAdamW(networks, config), generator)

    def state(self) -> State:
        """Everything the next step depends on, as CPU tensors of its own."""
        tensors = {f"networks.{name}": value for name, value in self.networks.state_dict().items()}
        tensors |= {"optimizer.mean": self.optimizer.mean, "optimizer.square": self.optimizer.square}
        tensors["generator"] = self.generator.get_state()
        return State(self.optimizer.taken, {name: value.detach().cpu().clone() for name, value in tensors.items()})

    def restore(self, state: State) -> None:
        """Go on from a state.

        Raises:
            InputError: its tensors are not those of this run.
        """
        _check_same({name: value.shape for name, value in self.state().tensors.items()}, state)
        prefix = "networks."
        own = {name.removeprefix(prefix): value for name, value in state.tensors.items() if name.startswith(prefix)}
        self.networks.load_state_dict(own)
        self.optimizer.mean.copy_(state.tensors["optimizer.mean"])
        self.optimizer.square.copy_(state.tensors["optimizer.square"])
        self.optimizer.taken = state.step
        self.generator.set_state(state.tensors["generator"])


def train_paper(
    samples: PaperInput,
    config: PaperConfig,
    progress: Callable[[int, float], None],
    checkpoints: Checkpoints | None = None,
) -> PaperNetworks:
    """Train the paper's networks on one surface.

    Args:
        samples: in the unit ball.
        config: the mode and every number.
        progress: called with (steps done, loss) every 20 steps and after the last.
        checkpoints: where the run is saved every so often and from where it goes on when a checkpoint of the same
            input and config is there; None: nowhere.

    Returns:
        Networks on the CPU, in evaluation mode.

    Raises:
        InputError: the device is absent, or the checkpoint is of another run.
        FlexparaError: training diverged.
    """
    device = choose_device(config)
    source, run = BatchSource(samples, config, device), Training.begin(config, samples, device)
    sha = samples.sha256() if checkpoints is not None else ""
    if checkpoints is not None and (state := checkpoints.latest(config, sha)) is not None:
        run.restore(state)
    loss_of = global_loss if config.mode == "global" else chart_loss
    if config.compile and device.type == "cuda":
        compile_parts(run.networks)
    while run.optimizer.taken < config.steps:
        loss = loss_of(cast("Any", run.networks), source.draw(run.generator), config)
        run.optimizer.step(loss)
        done = run.optimizer.taken
        if done % REPORT_EVERY == 0 or done == config.steps:
            progress(done, _finite(loss.item(), done))
        if checkpoints is not None and checkpoints.due(done, config.steps):
            checkpoints.save(run.state(), config, sha)
    plain_parts(run.networks)
    return run.networks.cpu().eval()


def compile_parts(networks: PaperNetworks) -> None:
    """Replace the maps that training calls by compiled ones, in place; for CUDA."""
    for name in ("flatten", "deform", "fold", "fold_jet"):
        setattr(networks, name, torch.compile(getattr(networks, name), dynamic=False))


def plain_parts(networks: PaperNetworks) -> None:
    """Undo compile_parts."""
    for name in ("flatten", "deform", "fold", "fold_jet"):
        networks.__dict__.pop(name, None)


def _check_same(expected: dict[str, torch.Size], state: State) -> None:
    found = {name: value.shape for name, value in state.tensors.items()}
    if found != expected:
        names = sorted(set(found.items()) ^ set(expected.items()))[:3]
        raise InputError(f"the checkpoint's tensors differ from the networks' ({names}); start anew without --resume")


def _finite(loss: float, step: int) -> float:
    if loss != loss or loss in (float("inf"), float("-inf")):
        raise FlexparaError(f"the loss is {loss} at step {step}, expected a finite number; choose a lower rate")
    return loss
