"""How far a long job is, and how long its stages took."""

from __future__ import annotations

import time
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from collections.abc import Iterator


class Progress(Protocol):
    """What is called while a job runs."""

    def __call__(self, stage: str, step: int, steps: int, loss: float | None = None) -> None:
        """``step`` of ``steps`` of a stage are done; loss is None outside training."""
        ...


class Clock:
    """Passes progress on, and keeps the seconds of each stage: the time until a call belongs to the stage it names."""

    def __init__(self, progress: Progress | None = None) -> None:
        self._progress, self._last = progress, time.perf_counter()
        self.seconds: dict[str, float] = {}

    def __call__(self, stage: str, step: int, steps: int, loss: float | None = None) -> None:
        """See Progress."""
        now = time.perf_counter()
        self.seconds[stage] = self.seconds.get(stage, 0.0) + now - self._last
        self._last = now
        if self._progress is not None:
            self._progress(stage, step, steps, loss)

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Around a stage of one step."""
        self(name, 0, 1)
        yield
        self(name, 1, 1)
