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
from contextlib import suppress
from pathlib import Path
from selectors import EVENT_READ, DefaultSelector
from typing import TYPE_CHECKING, Any

from ..runfile import facts_of

if TYPE_CHECKING:
    from .jobs import Job

LIBRARIES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Variables by which libraries of linear algebra are told how many threads to have."""


class Worker:
    """One process.  job: what it works on.  verdict: why it was killed, where it was.  cause: how it ended."""

    def __init__(self, work: str, cores: list[int]) -> None:
        self.work, self.cores = work, cores
        self.job: Job | None = None
        self.verdict = self.cause = ""
        self.begun, self.hurried = 0.0, False
        self.process = self._started()

    def _started(self) -> subprocess.Popen[bytes]:
        cores = ",".join(map(str, self.cores))
        words = [sys.executable, "-m", f"{__package__}.worker", str(os.getpid()), self.work, cores]
        threads = dict.fromkeys(LIBRARIES, str(len(self.cores)))
        return subprocess.Popen(
            words,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **threads},
            start_new_session=True,
        )

    def begin(self, job: Job) -> None:
        """Give it a job."""
        self.job, self.begun, self.hurried, self.verdict = job, time.monotonic(), False, ""
        with suppress(BrokenPipeError):  # it died; that is seen when its answer is read
            assert self.process.stdin is not None
            self.process.stdin.write(json.dumps(facts_of(job.run)).encode() + b"\n")
            self.process.stdin.flush()

    def answer(self) -> dict[str, Any] | None:
        """Its line on the job it has; None where it ended instead.

        One line a job: a second would wait in the buffer, where ``wait_for`` does not see it.
        """
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        return json.loads(line) if line.endswith(b"\n") else None

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
        self.process, self.job = self._started(), None

    def end(self) -> None:
        """End it, and what it started, if it has not ended."""
        with suppress(ProcessLookupError):
            os.killpg(self.process.pid, signal.SIGKILL)
        self.process.wait()
        for pipe in (self.process.stdin, self.process.stdout):
            with suppress(BrokenPipeError):
                if pipe is not None:
                    pipe.close()


def wait_for(workers: list[Worker], seconds: float) -> list[Worker]:
    """Those that have something to say, or ended, within so many seconds."""
    with DefaultSelector() as selector:
        for worker in workers:
            assert worker.process.stdout is not None
            selector.register(worker.process.stdout, EVENT_READ, worker)
        return [key.data for key, _ in selector.select(seconds)]
