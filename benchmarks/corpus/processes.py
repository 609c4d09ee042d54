"""One command in a process group of its own: exit code, wall and CPU seconds, peak memory, the last line of stderr.

Standard library only: a process begins with the peak memory of the one that started it, so this one stays small.
Memory is the larger of two: the greatest resident size that one process of the group had (kernel's figure), and the
greatest sum over the group, each shared page counted once (sampled five times a second, Linux only).  MB are 2²⁰ bytes.
"""

from __future__ import annotations

import os
import signal
import subprocess
import tempfile
import threading
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

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
    with tempfile.TemporaryFile() as errors:
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
        max(peak[0], used.ru_maxrss / 1024),
        said[-1] if said else "",
        len(said),
    )


def end_all() -> None:
    """Kill every command that is running, with all that it started."""
    for group in list(RUNNING):
        _kill(group)


def _watch(group: int, deadline: float, over: threading.Event, late: threading.Event, peak: list[float]) -> None:
    """Until `over`: note the group's memory in `peak`; kill it at the deadline and set `late`."""
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
    """MB of all processes of a group, each shared page counted once; 0 where /proc doesn't say."""
    total = 0
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if os.getpgid(int(process.name)) != group:
                continue
            text = (process / "smaps_rollup").read_text(encoding="ascii")
        except (OSError, ValueError):  # it has just ended
            continue
        total += sum(int(line.split()[1]) for line in text.splitlines() if line.startswith("Pss:"))
    return total / 1024
