"""The machines of a Ray cluster: the same jobs, limits and answers as on one machine, given out by Ray.

Ray chooses the machine, keeps its processes warm, and tries again what a lost one had; each of its processes has a
worker (pool.py) of its own, which is watched, and ended, as a local one is.  Files are read and written where they lie:
all machines see the same folders.
"""

from __future__ import annotations

import logging
import os
import secrets
import socket
from importlib import import_module
from typing import TYPE_CHECKING, Any

from ..cli.runfile import facts_of, run_of
from ..errors import FlexparaError, InputError
from ..extras import requires
from ..files import sweep
from .crew import died_of
from .jobs import Job
from .pool import Limits, Worker, wait_for

if TYPE_CHECKING:
    from .driver import Facts

AHEAD = 2
"""Jobs given to Ray for each core of the cluster: no core waits for the driver, and an interrupt takes few back."""
KNOCK = 5.0
"""Seconds that the head of a cluster gets to take a call."""
PATIENCE = 5.0
"""Seconds that the machines get to end what is called back."""
SETTINGS = {"RAY_USAGE_STATS_ENABLED": "0", "RAY_ACCEL_ENV_VAR_OVERRIDE_ON_ZERO": "0"}
"""Nothing is sent to Ray's makers; jobs without a GPU may still draw with one."""


def knock(address: str) -> None:
    """Raises: InputError where nothing listens at HOST:PORT; Ray itself would ask again for minutes."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    try:
        socket.create_connection((host, int(port)), KNOCK).close()
    except (OSError, OverflowError) as error:
        raise InputError(
            f"nothing listens at {address} ({error}), expected a Ray cluster's head; ray start --head, or pass local"
        ) from error


def own_token() -> dict[str, str]:
    """Variables without which nobody else gives jobs to the cluster that is begun here."""
    return {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}


class JobDiedError(FlexparaError):
    """The worker died of a job: Ray tries it again, as it does where a whole machine is lost."""


class Fleet:
    """As driver.Crew.  work: MODULE:FUNCTION of a run.  address: of the head, or "local".  cores: of a local one."""

    def __init__(self, work: str, limits: Limits, address: str, cores: int | None = None) -> None:
        """Join the cluster, or begin one.  Raises: MissingDependencyError; InputError where none answers."""
        for name, value in (SETTINGS | (own_token() if address == "local" else {})).items():
            os.environ.setdefault(name, value)
        with requires("fleet"):
            ray: Any = import_module("ray")
        self.ray, self.work, self.limits = ray, work, limits
        if address != "local":
            knock(address)
        where: dict[str, Any] = {"num_cpus": cores, "include_dashboard": False} if address == "local" else {}
        try:
            ray.init(None if address == "local" else address, **where, log_to_driver=False, logging_level=logging.ERROR)
        except (ray.exceptions.RayError, ConnectionError, RuntimeError, ValueError, TimeoutError) as error:
            found = f"no Ray cluster answers at {address} ({' '.join(str(error).split())[:200]})"
            raise InputError(
                f"{found}, expected its head; ray start --head --port PORT, or pass --ray local"
            ) from error
        self.jobs: dict[Any, Job] = {}
        self.gpus = ray.cluster_resources().get("GPU", 0)

    def free(self) -> bool:
        """Whether Ray has less than it needs to keep all cores at work, those of machines that joined meanwhile too."""
        return len(self.jobs) < AHEAD * max(int(self.ray.cluster_resources().get("CPU", 0)), 1)

    def start(self, job: Job) -> None:
        """Give a job to Ray: it takes a core, the memory it is allowed, and for training a GPU where there are any."""
        task = self.ray.remote(attempt).options(
            name=job.name,
            num_cpus=1,
            num_gpus=1 if self.gpus and job.run.options.preset == "paper" else 0,
            memory=self.limits.memory,
            max_retries=self.limits.tries_of_fleet - 1,
            retry_exceptions=[JobDiedError],
        )
        self.jobs[task.remote(self.work, job.name, facts_of(job.run), self.limits)] = job

    def running(self) -> int:
        """Jobs that Ray has."""
        return len(self.jobs)

    def ended(self) -> list[tuple[Job, Facts]]:
        """What became of jobs since."""
        done, _ = self.ray.wait(list(self.jobs), num_returns=len(self.jobs), timeout=self.limits.look)
        return [(self.jobs.pop(promise), self.facts(promise)) for promise in done]

    def facts(self, promise: Any) -> Facts:
        """What a job came to; one that no machine brought to its end may be tried again."""
        try:
            return self.ray.get(promise)
        except self.ray.exceptions.RayError as error:
            return died_of(f"or its machine died {self.limits.tries_of_fleet} times ({type(error).__name__})")

    def dismiss(self) -> None:
        """Call back what is given out, and leave the cluster."""
        for promise in self.jobs:
            self.ray.cancel(promise, force=True)
        if self.jobs:
            self.ray.wait(list(self.jobs), num_returns=len(self.jobs), timeout=PATIENCE)
        self.ray.shutdown()
        for job in self.jobs.values():
            sweep(job.run.output)


WARM: dict[str | None, Worker] = {}
"""The worker of this process, on a machine of the cluster, by the GPU that it sees; it ends with the process."""


def attempt(work: str, name: str, facts: dict[str, Any], limits: Limits) -> Facts:
    """One job on a machine of the cluster.  Raises: JobDiedError where its worker died of it."""
    seen = os.environ.get("CUDA_VISIBLE_DEVICES")
    if seen not in WARM:
        for other in WARM.values():
            other.end()
        WARM.clear()
        WARM[seen] = Worker(work, [])
    worker = WARM[seen]
    worker.begin(Job(name, run_of(facts)))
    while not wait_for([worker], limits.look):
        worker.watch(limits)
    found = worker.outcome()
    if found is None:
        raise JobDiedError(f"the worker of {name} died ({worker.cause}), expected it to end; run the batch again")
    return found
