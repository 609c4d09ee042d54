"""Warm worker processes on this machine, each with cores of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..process.cores import own_cores
from .pool import Limits, Worker, wait_for

if TYPE_CHECKING:
    from .driver import Facts
    from .jobs import Job


class LocalCrew:
    """As driver.Crew.  work: MODULE:FUNCTION of a run.  cores: of each worker."""

    def __init__(self, work: str, cores: list[list[int]], limits: Limits) -> None:
        self.limits = limits
        self.workers = [Worker(work, group) for group in cores]
        self.died: dict[str, int] = {}

    def free(self) -> bool:
        """Whether a worker has nothing to do."""
        return any(worker.job is None for worker in self.workers)

    def start(self, job: Job) -> None:
        """Give a job to a worker that has none."""
        next(worker for worker in self.workers if worker.job is None).begin(job)

    def running(self) -> int:
        """Workers that have something to do."""
        return sum(worker.job is not None for worker in self.workers)

    def ended(self) -> list[tuple[Job, Facts]]:
        """What became of jobs since; one whose worker died is tried again before it counts as failed."""
        found = []
        for worker in wait_for(self.workers, self.limits.look):
            job, facts = worker.job, worker.outcome()
            if job is None:
                continue
            if facts is not None:
                found.append((job, facts))
                continue
            self.died[job.name] = self.died.get(job.name, 0) + 1
            if self.died[job.name] < self.limits.tries:
                worker.begin(job)
            else:
                found.append((job, died_of(f"died {self.died[job.name]} times ({worker.cause})")))
        for worker in self.workers:
            if worker.job is not None:
                worker.watch(self.limits)
        return found

    def dismiss(self) -> None:
        """End all workers."""
        for worker in self.workers:
            worker.end()


def died_of(how: str) -> Facts:
    """A job whose worker died as often as it may."""
    error = f"its worker process {how}, expected it to end; run the batch again"
    return {"status": "failed", "error": error, "again": True}


def shares_of_cores(workers: str) -> list[list[int]]:
    """The cores of each worker: as many workers as cores for auto; a core is shared where there are more workers."""
    cores = own_cores()
    count = len(cores) if workers == "auto" else int(workers)
    each = max(len(cores) // count, 1)
    return [[cores[(number * each + more) % len(cores)] for more in range(each)] for number in range(count)]
