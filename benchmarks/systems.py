"""Every system of the paper's tables that can be run, each in a process of its own with a time budget.

v vertices · f faces.  corner_uv (f, 3, 2) float64 is in one scale for u and v, of any unit.  `run` is called by the
harness; the process it starts is `python -m benchmarks.systems JOB.json SURFACE.npz RESULT.npz`, for Blender another.
Seconds are those of the system's own call, reading and measuring excluded; flexpara's include the import of its
libraries.  slim gets flexpara's finished seams, as the paper's SLIM gets seams made by hand, and is timed without them.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import asdict, dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from flexpara.runtime.errors import FlexparaError, InputError, MissingDependencyError, MissingFileError
from flexpara.runtime.geometry.metrics import uv_charts
from flexpara.runtime.geometry.topology import split_non_manifold_vertices
from flexpara.runtime.mesh import Surface

from .peers import PEERS

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

ROOT = Path(__file__).resolve().parent.parent
GLOBAL, MULTI_CHART = "global", "multi-chart"
MODES = (MULTI_CHART, GLOBAL)
ABLATIONS = {
    "no-triangle": GLOBAL,
    "no-differential": GLOBAL,
    "no-upper": GLOBAL,
    "no-lower": GLOBAL,
    "bidirectional": MULTI_CHART,
    "chart-differential": MULTI_CHART,
}
"""flexpara's ablations and the mode that each belongs to."""
SLIM_ITERATIONS = 20
"""Those of libigl's own SLIM tutorial (number 205); `slim_solve` has no default."""


@dataclass(frozen=True)
class Job:
    """What is asked of a system; all but its name and mode is read by flexpara alone, as `flexpara.unwrap` means it.

    ablation: one of its ablations, or "".
    python: the interpreter that runs it, this one by default; smart-uv alone can do with one that lacks flexpara.
    """

    system: str
    mode: str = MULTI_CHART
    preset: str = "fast"
    charts: int = 8
    seed: int = 0
    steps: int | None = None
    width: int | None = None
    points: int | None = None
    precision: str = "float32"
    ablation: str = ""
    python: str = sys.executable


class Answer(NamedTuple):
    """uv of a system, the seconds of its call, and what it reports of itself (JSON-ready)."""

    corner_uv: NDArray[np.float64]
    seconds: float
    report: dict[str, Any]


@dataclass(frozen=True, eq=False)
class Outcome:
    """How a job ended.

    status: "done" · "not run" (it can't be run here, or not in this mode) · "incomplete" (the budget ran out) ·
    "failed" (it was run and gave no layout).  why: one line, "" when done.  answer: None unless done.
    """

    status: str
    why: str = ""
    answer: Answer | None = field(default=None, repr=False)


def by_flexpara(job: Job, surface: Surface, seams: NDArray[np.float64] | None) -> Answer:
    """`flexpara.unwrap` with its defaults, but for what the job says.  seams: not read.  Raises as it does."""
    del seams
    import flexpara

    wanted: dict[str, Any] = {"charts": job.charts, "seed": job.seed, "preset": job.preset, "mode": job.mode}
    wanted |= {"steps": job.steps, "width": job.width, "points": job.points, "precision": job.precision}
    wanted |= {"ablation": (job.ablation,) if job.ablation else ()}
    start = time.perf_counter()
    result = flexpara.unwrap((surface.vertices, surface.faces), **wanted)
    seconds = time.perf_counter() - start
    return Answer(result.atlas.corner_uv, seconds, result.report)


def by_slim(job: Job, surface: Surface, seams: NDArray[np.float64] | None) -> Answer:
    """SLIM by libigl on each of flexpara's finished charts, cut open: from the circle map, `SLIM_ITERATIONS`.

    seams: (f, 3, 2) flexpara's finished uv, read for where its charts are joined and where they are not.

    Raises:
        InputError: there are no seams.
    """
    if seams is None:
        raise InputError(f"no seams of flexpara, {job.mode}, on which slim could start; run flexpara as well")
    try:
        flatten = import_module("flexpara.train.finish.flatten").flatten
    except ImportError as error:
        raise MissingDependencyError(f'{error}; pip install "flexpara[train]"') from error
    chart, cut = uv_charts(surface.faces, seams)
    faces, source = split_non_manifold_vertices(surface.faces, cut)
    corner_uv, boxes = np.zeros((len(faces), 3, 2)), np.zeros((int(chart.max()) + 1, 2))
    start = time.perf_counter()
    for number in range(len(boxes)):
        used, local = np.unique(faces[chart == number], return_inverse=True)
        local = local.reshape(-1, 3)
        uv = flatten(Surface(surface.vertices[source[used]], local), SLIM_ITERATIONS)
        corner_uv[chart == number] = (uv - uv.min(axis=0))[local]
        boxes[number] = np.ptp(uv, axis=0)
    seconds = time.perf_counter() - start
    corner_uv += on_shelves(boxes)[chart][:, None]
    return Answer(corner_uv, seconds, {"charts": len(boxes), "iterations": SLIM_ITERATIONS})


def on_shelves(boxes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Lower left corners (k, 2) of boxes (k, 2) that lie apart from each other: rows from tall to low, about a square.

    Slim only flattens: this places its charts so that none overlap, no more.
    """
    gap = 0.02 * float(boxes.max())
    width = max(1.1 * float(np.sqrt(np.prod(boxes + gap, axis=1).sum())), float(boxes[:, 0].max()))
    corner, left, bottom, height = np.zeros_like(boxes), 0.0, 0.0, 0.0
    for number in np.argsort(-boxes[:, 1]).tolist():
        wide, tall = boxes[number].tolist()
        if left > 0.0 and left + wide > width:
            left, bottom, height = 0.0, bottom + height + gap, 0.0
        corner[number] = left, bottom
        left, height = left + wide + gap, max(height, tall)
    return corner


def by_peer(job: Job, surface: Surface, seams: NDArray[np.float64] | None) -> Answer:
    """A peer, xatlas or uvunwrap, with default options.  Raises: MissingDependencyError without it."""
    del seams
    try:
        corner_uv, seconds = PEERS[job.system](surface.vertices, surface.faces)
    except ImportError as error:
        raise MissingDependencyError(f"{error}; pip install {job.system}") from error
    return Answer(corner_uv, seconds, {})


SYSTEMS: dict[str, Callable[[Job, Surface, NDArray[np.float64] | None], Answer]] = {
    "flexpara": by_flexpara,
    "xatlas": by_peer,
    "uvunwrap": by_peer,
    "slim": by_slim,
}
NAMES = (*SYSTEMS, "smart-uv")
MODES_OF = {name: MODES if name in ("flexpara", "slim") else (MULTI_CHART,) for name in NAMES}


def run(job: Job, surface: Surface, budget: float, folder: Path, seams: NDArray[np.float64] | None = None) -> Outcome:
    """Run a job in a process of its own; `budget` seconds after its start it is ended, with all it has started.

    Args:
        job: what to do.
        surface: welded, as all systems get it.
        budget: wall seconds of the whole process.
        folder: an existing folder for the files that pass between the processes.
        seams: (f, 3, 2) float64 flexpara's finished uv, for slim.

    Raises:
        MissingFileError: the job's interpreter doesn't exist.
    """
    if job.mode not in MODES_OF[job.system]:
        return Outcome("not run", f"{job.system} has no {job.mode} mode")
    task, given, result = folder / "job.json", folder / "surface.npz", folder / "result.npz"
    task.write_text(json.dumps(asdict(job)), encoding="utf-8")
    none = np.zeros((0, 3, 2))
    np.savez(given, vertices=surface.vertices, faces=surface.faces, seams=none if seams is None else seams)
    result.unlink(missing_ok=True)
    script = ["benchmarks/blender.py"] if job.system == "smart-uv" else ["-m", "benchmarks.systems", str(task)]
    try:
        code, said = in_time([job.python, *script, str(given), str(result)], budget)
    except FileNotFoundError as error:
        raise MissingFileError(f"{job.python} is no program, expected a Python interpreter; name another") from error
    if code is None:
        return Outcome("incomplete", f"the budget of {budget:g} s ran out")
    if not result.exists():
        return Outcome("failed", f"its process ended with {code}: {said}")
    with np.load(result, allow_pickle=False) as found:
        status, why = str(found["status"]), str(found["why"])
        if status != "done":
            return Outcome(status, why)
        report = json.loads(str(found["report"]))
        return Outcome(status, why, Answer(found["corner_uv"], float(found["seconds"]), report))


def in_time(command: list[str], budget: float) -> tuple[int | None, str]:
    """(exit code, last line of stderr) of a command run from the repository's root; code None when time ran out."""
    pipe = subprocess.PIPE
    process = subprocess.Popen(
        command, cwd=ROOT, stdout=subprocess.DEVNULL, stderr=pipe, text=True, start_new_session=True
    )
    try:
        _, errors = process.communicate(timeout=budget)
    except BaseException as error:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        if isinstance(error, subprocess.TimeoutExpired):
            return None, ""
        raise
    return process.returncode, " ".join(errors.strip().splitlines()[-1:])


def main(task: str, given: str, result: str) -> None:
    """One job, files in and file out.  A refusal is a result: "not run" for what isn't here, "failed" for the rest."""
    job = Job(**json.loads(Path(task).read_text(encoding="utf-8")))
    with np.load(given, allow_pickle=False) as found:
        surface = Surface(found["vertices"], found["faces"])
        seams = found["seams"] if len(found["seams"]) else None
    try:
        answer = SYSTEMS[job.system](job, surface, seams)
    except FlexparaError as error:
        status = "not run" if isinstance(error, InputError | MissingDependencyError) else "failed"
        np.savez(result, status=status, why=" ".join(str(error).split()))
        return
    report = json.dumps(answer.report)
    np.savez(result, status="done", why="", corner_uv=answer.corner_uv, seconds=answer.seconds, report=report)


if __name__ == "__main__":
    main(*sys.argv[1:])
