"""Jobs given out to worker processes, and what each may take; the manifest grows by a line as each ends.

A worker that dies, or takes more than it may, is replaced; the rest go on.  The first interrupt lets what is running
end within two seconds, and gives the rest back; the second ends at once.
"""

from __future__ import annotations

import os
import signal
import time
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..files import sweep
from .manifest import Entry, append
from .pool import Worker, wait_for

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path
    from types import FrameType

    from .jobs import Job

    Told = Callable[[Entry], object]


@dataclass(frozen=True)
class Limits:
    """What an asset may take.  seconds, memory (bytes): None for no limit."""

    seconds: float | None = None
    memory: int | None = None
    hint_seconds: float = 0.6
    """Share of the seconds after which the search is asked for what it has."""
    hint_memory: float = 0.8
    """Share of the memory."""
    tries: int = 2
    """Times a job is given to a worker, where workers die of it."""
    grace: float = 2.0
    """Seconds that running jobs get at the first interrupt."""
    look: float = 0.1
    """Seconds between two looks at the workers."""


@dataclass
class Interrupts:
    """How often an interrupt came, and when the first did."""

    count: int = 0
    since: float = 0.0


class Driver:
    """One run of a batch.  work: MODULE:FUNCTION of a run.  told: called with each entry."""

    def __init__(self, manifest: Path, version: str, work: str, limits: Limits, told: Told) -> None:
        self.manifest, self.version, self.work, self.limits, self.told = manifest, version, work, limits, told
        self.begin = time.monotonic()
        self.died: dict[str, int] = {}
        self.content: dict[str, str] = {}

    def run(self, jobs: list[Job], cores: list[list[int]]) -> bool:
        """Work all jobs off with a worker for each group of cores; False where an interrupt ended it before."""
        queue = list(reversed(jobs))
        with interrupts() as stop:
            workers = [Worker(self.work, group) for group in cores[: len(jobs)]]
            try:
                while (queue and not stop.count) or any(worker.job for worker in workers):
                    for worker in workers:
                        if queue and not stop.count and worker.job is None:
                            self.start(worker, queue.pop())
                    for worker in wait_for(workers, self.limits.look):
                        self.collect(worker, queue)
                    for worker in workers:
                        self.watch(worker)
                    if stop.count > 1 or (stop.count and time.monotonic() - stop.since > self.limits.grace):
                        break
            finally:
                for worker in workers:
                    worker.end()
                    if worker.job is not None:
                        sweep(worker.job.run.output)
        return not queue and not any(worker.job for worker in workers)

    def start(self, worker: Worker, job: Job) -> None:
        """Give a job to a worker that has none; what a killed one left in its folder goes first.

        The fingerprint of its file is taken now: one that changes meanwhile is done again.
        """
        sweep(job.run.output)
        self.content[job.name] = job.content()
        worker.begin(job)

    def collect(self, worker: Worker, queue: list[Job]) -> None:
        """Take a worker's answer; where it died instead, another takes its place and the job is tried again."""
        facts, job = worker.answer(), worker.job
        if facts is None:
            worker.restart()
            if job is None:
                return
            self.died[job.name] = self.died.get(job.name, 0) + 1
            if worker.verdict:
                facts = {"status": "failed", "error": worker.verdict}
            elif self.died[job.name] < self.limits.tries:
                queue.append(job)
                return
            else:
                times = self.died[job.name]
                cause = f"its worker process died {times} times ({worker.cause})"
                facts = {
                    "status": "failed",
                    "error": f"{cause}, expected it to end; run the batch again",
                    "again": True,
                }
        if job is None:
            return
        worker.job = None
        self.note(job, facts)

    def note(self, job: Job, facts: dict[str, Any]) -> None:
        """Write what became of a job down."""
        elapsed = round(time.monotonic() - self.begin, 3)
        folder = os.path.relpath(job.run.output, self.manifest.parent)
        content, asked = self.content[job.name], job.asked(self.version)
        entry = Entry(job.name, **facts, content=content, asked=asked, folder=folder, elapsed=elapsed)
        append(self.manifest, entry)
        self.told(entry)

    def watch(self, worker: Worker) -> None:
        """Ask a worker for what it has as a limit comes near, and end it beyond."""
        if worker.job is None:
            return
        seconds, limits = worker.seconds(), self.limits
        memory = worker.memory() if limits.memory else 0
        if limits.seconds and seconds > limits.seconds:
            worker.kill(f"took more than {limits.seconds:g} s, expected less as asked; raise --per-asset-seconds")
        elif limits.memory and memory > limits.memory:
            asked = f"{limits.memory / 1e9:g} GB"
            worker.kill(f"took more than {asked} of memory, expected less as asked; raise --per-asset-memory")
        elif (limits.seconds and seconds > limits.hint_seconds * limits.seconds) or (
            limits.memory and memory > limits.hint_memory * limits.memory
        ):
            worker.hurry()


@contextmanager
def interrupts() -> Iterator[Interrupts]:
    """Within this, interrupts are counted."""
    stop = Interrupts()

    def handle(_number: int, _frame: FrameType | None) -> None:
        stop.since = stop.since or time.monotonic()
        stop.count += 1

    before = signal.signal(signal.SIGINT, handle)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


def shares_of_cores(workers: str) -> list[list[int]]:
    """The cores of each worker: as many workers as cores for auto; a core is shared where there are more workers."""
    cores = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))
    count = len(cores) if workers == "auto" else int(workers)
    each = max(len(cores) // count, 1)
    return [[cores[(number * each + more) % len(cores)] for more in range(each)] for number in range(count)]
