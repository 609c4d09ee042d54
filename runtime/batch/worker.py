"""A process that works on one asset after the other: what it imports, compiles and opens is there for the next.

It reads a job a line on standard input and answers each with a line on standard output.  It has cores of its own, so
that workers do not fight for them, and ends with all it started as soon as its parent is gone.
"""

from __future__ import annotations

import hashlib
import json
import os
import signal
import sys
import threading
import time
import traceback
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..cli.runfile import Run, run_of
from ..errors import DiskFullError, FlexparaError
from ..process.deadline import drop_waiting, hold_back
from ..process.heap import give_freed_memory_back, keep_freed_memory
from ..process.named import named

if TYPE_CHECKING:
    from collections.abc import Callable

WATCH = 0.2
"""Seconds between two looks at the parent."""
LARGE = 1 << 30
"""Bytes that it may hold between two assets before it gives back what is free."""
METRICS = ("charts", "symmetric_dirichlet_mean", "seam_length", "packing_efficiency", "flipped_faces")
NETWORK = ("rms_texels", "chart_agreement")


def main(parent: str, work: str, cores: str) -> None:
    """Answer jobs until standard input ends.

    parent: number of the process that this one ends with.  work: MODULE:FUNCTION of a run.  cores: comma-separated,
    or none for any.
    """
    if cores and hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {int(core) for core in cores.split(",")})
    hold_back()  # but while charts are searched, when an interrupt asks for what there is
    keep_freed_memory()
    answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 1)
    os.dup2(nothing, 2)
    threading.Thread(target=_end_with, args=(int(parent),), daemon=True).start()
    function: Callable[[Run], object] = named(work)
    for line in sys.stdin:
        drop_waiting()  # it was meant for the job before
        answers.write(json.dumps(answer(function, run_of(json.loads(line))), allow_nan=False) + "\n")
        answers.flush()
        if resident() > LARGE:  # it counts against the next asset
            give_freed_memory_back()


def _end_with(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(WATCH)
    os.killpg(0, signal.SIGKILL)  # it leads a group of its own


def answer(function: Callable[[Run], object], run: Run) -> dict[str, Any]:
    """What became of a run, as the fields of an entry."""
    begin = time.monotonic()
    reset_peak()
    try:
        function(run)
        facts: dict[str, Any] = {"status": "done", **outcome(run.output)}
    except FlexparaError as error:
        said = " ".join(str(error).split()).removeprefix(f"{run.mesh}: ")  # the entry names it
        facts = {"status": "failed", "error": said, "again": isinstance(error, DiskFullError)}
    except MemoryError:
        facts = {"status": "failed", "error": "out of memory, expected less to be enough; give it a machine with more"}
    except Exception as error:  # a defect in one asset must not end the others
        place = traceback.extract_tb(error.__traceback__)[-1]
        where = f"{Path(place.filename).name}:{place.lineno}"
        facts = {"status": "failed", "error": f"{type(error).__name__}: {error} ({where}), a defect; please report it"}
    return {**facts, "seconds": round(time.monotonic() - begin, 3), "memory": peak()}


def outcome(folder: Path) -> dict[str, Any]:
    """Metrics, seconds and notes of the reports in an asset's folder, and the hash of each file."""
    reports = [json.loads(path.read_bytes()) for path in sorted(folder.glob("*.report.json"))]
    metrics = {name: report["metrics"].get(name) for report in reports[:1] for name in METRICS}
    metrics |= {name: report["network"].get(name) for report in reports[:1] for name in NETWORK}
    faces = sum(report["source"].get("faces", 0) for report in reports)
    stages: dict[str, float] = {}
    for report in reports:
        for name, seconds in report["seconds"].items():
            stages[name] = round(stages.get(name, 0.0) + seconds, 3)
    notes = [str(note) for report in reports for note in report["train"].get("notes", ())]
    files = {path.name: digest(path) for path in sorted(folder.iterdir()) if path.is_file()}
    return {"metrics": {**metrics, "faces": faces}, "stages": stages, "notes": notes, "files": files}


def digest(path: Path) -> str:
    """The sha256 of a file."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def reset_peak() -> None:
    """Begin to count the peak of memory anew, where the system can."""
    try:
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")
    except OSError:
        return


def peak() -> int:
    """Peak of this process's memory, in bytes; 0 where the system does not say."""
    return _told("VmHWM")


def resident() -> int:
    """Bytes that this process holds now; 0 where the system does not say."""
    return _told("VmRSS")


def _told(name: str) -> int:
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    except OSError:
        return 0
    return next((int(line.split()[1]) * 1024 for line in lines if line.startswith(name)), 0)


if __name__ == "__main__":
    main(*sys.argv[1:])
