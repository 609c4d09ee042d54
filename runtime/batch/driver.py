"""Jobs given out to a crew; the manifest grows by a line as each ends.

A crew is a pool of processes on this machine (crew.py) or a cluster of Ray (fleet.py): a worker that dies, or takes
more than it may, is replaced; the rest go on.  The first interrupt lets what is running end within two seconds, and
gives the rest back; the second ends at once.
"""

from __future__ import annotations

import os
import signal
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from .manifest import Entry, append

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path
    from types import FrameType

    from .jobs import Job
    from .pool import Limits

    Told = Callable[[Entry], object]
    Facts = dict[str, Any]


ENDING = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
"""Ways to be asked to end beside Ctrl-C, unless they are ignored, as under nohup."""


class Crew(Protocol):
    """Those who do the work."""

    def free(self) -> bool:
        """Whether another job can be given out."""
        ...

    def start(self, job: Job) -> None:
        """Give a job out."""
        ...

    def running(self) -> int:
        """Jobs that were given out and have not ended."""
        ...

    def ended(self) -> list[tuple[Job, Facts]]:
        """What became of those that ended since, within a moment's wait."""
        ...

    def dismiss(self) -> None:
        """End all of it, at once; nothing half-written is left of what was running."""
        ...


@dataclass
class Interrupts:
    """How often an interrupt came, and when the first did."""

    count: int = 0
    since: float = 0.0


class Driver:
    """One run of a batch.  told: called with each entry."""

    def __init__(self, manifest: Path, version: str, limits: Limits, told: Told) -> None:
        self.manifest, self.version, self.limits, self.told = manifest, version, limits, told
        self.begin = time.monotonic()
        self.content: dict[str, str] = {}

    def run(self, jobs: list[Job], crew: Crew) -> bool:
        """Work all jobs off; False where an interrupt ended it before."""
        for job in jobs:
            if job.problem:
                self.content[job.name] = job.content()
                self.note(job, {"status": "failed", "error": job.problem})
        # the largest first: one that is begun last would keep the others waiting
        queue = sorted((job for job in reversed(jobs) if not job.problem), key=lambda job: job.size)
        with interrupts() as stop:
            try:
                while (queue and not stop.count) or crew.running():
                    while queue and not stop.count and crew.free():
                        self.start(crew, queue.pop())
                    for job, facts in crew.ended():
                        self.note(job, facts)
                    if stop.count > 1 or (stop.count and time.monotonic() - stop.since > self.limits.grace):
                        break
                whole = not queue and not crew.running()
            finally:
                crew.dismiss()
        return whole

    def start(self, crew: Crew, job: Job) -> None:
        """Give a job out.  The fingerprint of its file is taken now: one that changes meanwhile is done again."""
        self.content[job.name] = job.content()
        crew.start(job)

    def note(self, job: Job, facts: Facts) -> None:
        """Write what became of a job down."""
        elapsed = round(time.monotonic() - self.begin, 3)
        folder = os.path.relpath(job.run.output, self.manifest.parent)
        content, asked = self.content[job.name], job.asked(self.version)
        entry = Entry(job.name, **facts, content=content, asked=asked, folder=folder, elapsed=elapsed)
        append(self.manifest, entry)
        self.told(entry)


@contextmanager
def interrupts() -> Iterator[Interrupts]:
    """Within this, interrupts are counted, and other ways to be asked to end, by a system or a closed terminal."""
    stop = Interrupts()

    def handle(_number: int, _frame: FrameType | None) -> None:
        stop.since = stop.since or time.monotonic()
        stop.count += 1

    heard = [number for number in ENDING if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, handle) for number in (signal.SIGINT, *heard)}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
