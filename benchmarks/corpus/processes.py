"""One command in a process group of its own: exit code, wall and CPU seconds, peak memory, the last line of stderr.

It ends with the process that runs it, where that is interrupted, or ended from outside as by `timeout`.

Memory is the larger of two, sampled five times a second: the greatest resident size that one process of the group has
had, and the sum over the group, each shared page counted once.  `ru_maxrss` serves only where there is no /proc: a
process begins with the peak of the one that started it.  MB are 2²⁰ bytes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import threading
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Iterator
    from types import FrameType

ROOT = Path(__file__).resolve().parent.parent.parent
SAMPLE_SECONDS = 0.2
RUNNING: set[int] = set()
"""Process groups that were started and have not ended."""


@dataclass(frozen=True)
class Ended:
    """How a command ended.

    code: exit code, negative for a signal, None where the time limit ended it.  seconds: wall time.
    cpu_seconds: of all its processes; unlike the wall time, it hardly depends on what else the machine does.
    peak_mb: see the module.  said: last line of stderr that holds anything.  lines: number of lines on stderr.
    """

    code: int | None
    seconds: float
    cpu_seconds: float
    peak_mb: float
    said: str
    lines: int


def run(command: list[str], limit: float) -> Ended:
    """Run a command from the repository's root; after `limit` seconds it is killed with all that it started."""
    with tempfile.TemporaryFile() as errors, ended_too():
        start = perf_counter()
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=errors, start_new_session=True)
        RUNNING.add(process.pid)
        over, late, peak = threading.Event(), threading.Event(), [0.0]
        watcher = threading.Thread(target=_watch, args=(process.pid, start + limit, over, late, peak))
        watcher.start()
        try:
            _, status, used = os.wait4(process.pid, 0)
        except BaseException:
            _kill(process.pid)
            raise
        finally:
            over.set()
            watcher.join()
        _kill(process.pid)  # what it left behind
        RUNNING.discard(process.pid)
        seconds = perf_counter() - start
        process.returncode = os.waitstatus_to_exitcode(status)
        errors.seek(0)
        said = [line.strip() for line in errors.read().decode(errors="replace").splitlines() if line.strip()]
    code = None if late.is_set() else process.returncode
    return Ended(
        code,
        seconds,
        used.ru_utime + used.ru_stime,
        peak[0] or used.ru_maxrss / 1024,
        said[-1] if said else "",
        len(said),
    )


@contextmanager
def ended_too(*more: signal.Signals) -> Iterator[None]:
    """Within this, being asked to end ends all that runs too; a thread leaves that to the main one.

    more: signals beside those that raise nothing by themselves.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    heard = [number for number in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(number) is not signal.SIG_IGN]
    before = {number: signal.signal(number, interrupted) for number in (*heard, *more)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def interrupted(number: int, _frame: FrameType | None) -> None:
    """End at once, with all that runs: each is a session of its own, which no signal to this one reaches."""
    for group in list(RUNNING):
        _kill(group)
    os._exit(128 + number)


def _watch(group: int, deadline: float, over: threading.Event, late: threading.Event, peak: list[float]) -> None:
    """Until `over`: note the group's peak memory in `peak`; kill it at the deadline and set `late`."""
    while not over.wait(SAMPLE_SECONDS):
        peak[0] = max(peak[0], group_memory(group))
        if perf_counter() > deadline:
            late.set()
            _kill(group)
            return


def _kill(group: int) -> None:
    try:
        os.killpg(group, signal.SIGKILL)
    except ProcessLookupError:  # nothing of it is left
        return


def group_memory(group: int) -> float:
    """MB: the sum over a group's processes now, or the peak of one of them if that is larger; 0 without /proc."""
    total = highest = 0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(process.name)) != group:
                continue
            shared = (process / "smaps_rollup").read_text(encoding="ascii")
            status = (process / "status").read_text(encoding="utf-8", errors="replace")
        except (OSError, ValueError):  # it has just ended
            continue
        total += _kilobytes(shared, "Pss:")
        highest = max(highest, _kilobytes(status, "VmHWM:"))
    return max(total, highest) / 1024


def _kilobytes(text: str, key: str) -> int:
    """The number of a line `KEY 123 kB` of a file in /proc; 0 where there is no such line."""
    return next((int(line.split()[1]) for line in text.splitlines() if line.startswith(key)), 0)
