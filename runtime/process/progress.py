"""How far a long job is, and how long its stages took."""

from __future__ import annotations

import sys
import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from .deadline import Deadline

if TYPE_CHECKING:
    from collections.abc import Iterator


class Progress(Protocol):
    """What is called while a job runs."""

    def __call__(self, stage: str, step: int, steps: int, loss: float | None = None) -> None:
        """``step`` of ``steps`` of a stage are done; loss is None outside training."""
        ...


class Clock:
    """Passes progress on, and keeps the seconds of each stage: the time until a call belongs to the stage it names."""

    def __init__(self, progress: Progress | None = None, deadline: Deadline | None = None) -> None:
        """``deadline``: when whoever is told the time should come to an end; None: never."""
        self.deadline = deadline or Deadline()
        self._progress, self._last = progress, time.perf_counter()
        self.seconds: dict[str, float] = {}

    @classmethod
    def of(cls, progress: Progress | None) -> Clock:
        """The clock that progress is, or one that passes it on."""
        return progress if isinstance(progress, Clock) else cls(progress)

    def __call__(self, stage: str, step: int, steps: int, loss: float | None = None) -> None:
        """See Progress."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
        if self._progress is not None:
            self._progress(stage, step, steps, loss)

    @property
    def rounded(self) -> dict[str, float]:
        """Seconds of each stage to the millisecond, for reports."""
        return {stage: round(seconds, 3) for stage, seconds in self.seconds.items()}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Around a stage of one step."""
        self(name, 0, 1)
        yield
        self(name, 1, 1)


class Stages:
    """Stages of one step, told by their names: each ends the one before.  And whether it is time to end."""

    def __init__(self, progress: Progress | None = None, deadline: Deadline | None = None) -> None:
        self.deadline = deadline or Deadline()
        self._progress, self._running = progress, ""

    def __call__(self, name: str) -> None:
        """A stage begins."""
        self.end()
        self._running = name
        if self._progress is not None:
            self._progress(name, 0, 1)

    def end(self) -> None:
        """The stage that runs is done."""
        if self._progress is not None and self._running:
            self._progress(self._running, 1, 1)
        self._running = ""


def progress_lines(stage: str, step: int, steps: int, loss: float | None = None) -> None:
    """A Progress for programs: a line `flexpara: progress: STAGE STEP/STEPS` on stderr for each call."""
    del loss
    sys.stderr.write(f"flexpara: progress: {stage} {step}/{steps}\n")
    sys.stderr.flush()


@contextmanager
def progress_bars(*, quiet: bool = False) -> Iterator[Progress | None]:
    """Bars on stderr, one a stage, with loss and time left; None when quiet or when stderr is no terminal."""
    if quiet or not sys.stderr.isatty():
        yield None
        return
    from rich import progress
    from rich.console import Console

    columns = (
        progress.TextColumn("{task.description:<10}"),
        progress.BarColumn(),
        progress.MofNCompleteColumn(),
        progress.TimeElapsedColumn(),
        progress.TimeRemainingColumn(),
        progress.TextColumn("{task.fields[loss]}"),
    )
    with progress.Progress(*columns, console=Console(stderr=True)) as bars:
        tasks: dict[str, progress.TaskID] = {}

        def show(stage: str, step: int, steps: int, loss: float | None = None) -> None:
            if stage not in tasks:
                tasks[stage] = bars.add_task(stage, total=steps, loss="")
            bars.update(tasks[stage], completed=step, total=steps, loss="" if loss is None else f"loss {loss:.4g}")

        yield show
