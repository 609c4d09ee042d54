"""Worker processes, as the driver sees them: begun, listened to, asked to hurry, ended.

Each is started anew (spawned, not forked), in a session of its own: an interrupt of the terminal does not reach it, and
what it starts ends with it.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from typing import TYPE_CHECKING, Any

from ..cli.runfile import facts_of
from ..files import sweep
from ..process.cores import LIMIT
from ..process.deadline import hold_back, let_in

if TYPE_CHECKING:
    from collections.abc import Iterator

    from .jobs import Job

    Facts = dict[str, Any]

LIBRARIES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENIMAGEIO_THREADS", "LP_NUM_THREADS")
"""Variables by which libraries of linear algebra, pictures and OpenGL are told how many threads to have."""


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
    tries_of_fleet: int = 6
    """Times on several machines, each of which may be lost."""
    grace: float = 2.0
    """Seconds that running jobs get at the first interrupt."""
    look: float = 0.1
    """Seconds between two looks at the workers."""


class Worker:
    """One process.  job: what it works on.  verdict: why it was killed, where it was.  cause: how it ended.

    cores: those that it has to itself; none for one core, whichever is free.
    """

    def __init__(self, work: str, cores: list[int]) -> None:
        self.work, self.cores = work, cores
        self.job: Job | None = None
        self.verdict = self.cause = ""
        self.begun, self.hurried = 0.0, False
        self.process = self._started()

    def _started(self) -> subprocess.Popen[bytes]:
        cores = ",".join(map(str, self.cores))
        words = [sys.executable, "-m", f"{__package__}.worker", str(os.getpid()), self.work, cores]
        threads = dict.fromkeys((*LIBRARIES, LIMIT), str(max(len(self.cores), 1)))
        with no_interrupts():
            return subprocess.Popen(
                words,
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env={**os.environ, **threads},
                start_new_session=True,
            )

    def begin(self, job: Job) -> None:
        """Give it a job; what a killed one left in its folder goes first."""
        sweep(job.run.output)
        self.job, self.begun, self.hurried, self.verdict = job, time.monotonic(), False, ""
        with suppress(BrokenPipeError):  # it died; that is seen when its answer is read
            assert self.process.stdin is not None
            self.process.stdin.write(json.dumps(facts_of(job.run)).encode() + b"\n")
            self.process.stdin.flush()

    def answer(self) -> Facts | None:
        """Its line on the job it has; None where it ended instead.

        One line a job: a second would wait in the buffer, where ``wait_for`` does not see it.
        """
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        return json.loads(line) if line.endswith(b"\n") else None

    def outcome(self) -> Facts | None:
        """What became of its job; None where it died of it, and nobody killed it.  One that died is replaced."""
        facts = self.answer()
        if facts is None:
            self.restart()
            if self.verdict:
                facts = {"status": "failed", "error": self.verdict}
        self.job = None
        return facts

    def watch(self, limits: Limits) -> None:
        """Ask it for what it has as a limit comes near, and end it beyond."""
        seconds, memory = self.seconds(), self.memory() if limits.memory else 0
        if limits.seconds and seconds > limits.seconds:
            self.kill(f"took more than {limits.seconds:g} s, expected less as asked; raise --per-asset-seconds")
        elif limits.memory and memory > limits.memory:
            asked = f"{limits.memory / 1e9:g} GB"
            self.kill(f"took more than {asked} of memory, expected less as asked; raise --per-asset-memory")
        elif (limits.seconds and seconds > limits.hint_seconds * limits.seconds) or (
            limits.memory and memory > limits.hint_memory * limits.memory
        ):
            self.hurry()

    def seconds(self) -> float:
        """How long it has worked on its job."""
        return time.monotonic() - self.begun

    def memory(self) -> int:
        """Bytes that it holds; 0 where the system does not say."""
        try:
            pages = Path(f"/proc/{self.process.pid}/statm").read_text(encoding="ascii").split()[1]
        except (OSError, IndexError):
            return 0
        return int(pages) * os.sysconf("SC_PAGE_SIZE")

    def hurry(self) -> None:
        """Ask once for what its search has so far."""
        if not self.hurried:
            self.hurried = True
            self.process.send_signal(signal.SIGINT)

    def kill(self, verdict: str) -> None:
        """End it for a reason."""
        self.verdict = self.verdict or verdict
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)

    def restart(self) -> None:
        """Another process in the place of one that ended."""
        self.end()
        code = self.process.returncode
        self.cause = signal.Signals(-code).name if code < 0 else f"exit code {code}"
        self.process = self._started()

    def end(self) -> None:
        """End it, and what it started, if it has not ended."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            with suppress(BrokenPipeError):
                if pipe is not None:
                    pipe.close()
        if self.job is not None:
            sweep(self.job.run.output)


@contextmanager
def no_interrupts() -> Iterator[None]:
    """Processes started within this take no interrupt until they let one in: it would end them as they begin."""
    before = hold_back()
    try:
        yield
    finally:
        if not before:
            let_in()


def wait_for(workers: list[Worker], seconds: float) -> list[Worker]:
    """Those that have something to say, or ended, within so many seconds."""
    with DefaultSelector() as selector:
        for worker in workers:
            assert worker.process.stdout is not None
            selector.register(worker.process.stdout, EVENT_READ, worker)
        return [key.data for key, _ in selector.select(seconds)]
