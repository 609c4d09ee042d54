"""The paper's tables beside a run here: `python -m benchmarks.paper --models DIR [--preset fast] [--systems LIST]`.

Every system unwraps the same cleaned surface in a process of its own and is measured by the same function in the same
run (`flexpara.runtime.geometry.metrics`).  Where a mesh has the name of a model of the paper, the paper's figures stand
beside.
Markdown goes to stdout, progress to stderr, every figure to --json.  A budget that ran out is "incomplete", a system
that isn't there "not run"; neither gets a number.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

from flexpara.runtime.errors import FlexparaError
from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.io.meshfile import load_asset

from .paper_markdown import READINGS, comparisons, markdown, name_of
from .systems import ABLATIONS, MODES, MODES_OF, NAMES, Job, Outcome, run
from .tables import coverage, load_figures
from .unwrap import ROOT, SUFFIXES, header

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from flexpara.runtime.mesh import Asset

Row = dict[str, Any]
PACKAGES = {"libigl": "igl"}
"""Distribution → module, beyond those that `header` lists."""
GIVEN = ("preset", "charts", "seed", "steps", "width", "points", "precision")
"""Options of flexpara that go to it as they are."""
DEVICE = "import torch; print(torch.cuda.get_device_name() if torch.cuda.is_available() else 'cpu')"


def row_of(job: Job, asset: Asset, outcome: Outcome) -> Row:
    """One row: who did what to which mesh, how it ended, and where it is done its metrics, seconds and report."""
    row: Row = {"mesh": asset.stem, "faces": len(asset.faces), "mode": job.mode, "system": job.system}
    row |= {"preset": job.preset if job.system == "flexpara" else None, "ablation": job.ablation}
    row |= {"status": outcome.status, "why": outcome.why}
    if outcome.answer is None:
        return row
    corner_uv, seconds, report = outcome.answer
    try:
        metrics = measure(asset.surface, corner_uv).to_dict()
    except FlexparaError as error:
        return row | {"status": "failed", "why": f"its uv can't be measured: {error}"}
    return row | {"metrics": metrics, "seconds": seconds, "raw": raw_figures(report), "report": report}


def raw_figures(report: Row) -> dict[str, Row]:
    """Figures of the network's own map in a report of flexpara, by reading; empty where it has none."""
    train = report.get("train", {})
    raw = train.get("paper", train).get("raw", {})
    return {name: raw[name] for name in READINGS if name in raw}


def jobs_of(mode: str, arguments: argparse.Namespace) -> list[Job]:
    """What was asked for in a mode: flexpara, its ablations, then the others."""
    given = {name: getattr(arguments, name) for name in GIVEN}
    python = {"smart-uv": str(arguments.blender_python)}
    asked = [name for name in NAMES if name in arguments.systems and mode in MODES_OF[name]]
    jobs = [Job(name, mode, **given, python=python.get(name, sys.executable)) for name in asked]
    ablations = [name for name in arguments.ablations if ABLATIONS[name] == mode and "flexpara" in asked]
    return [*jobs[:1], *(Job("flexpara", mode, **given, ablation=name) for name in ablations), *jobs[1:]]


def outcomes_of(asset: Asset, arguments: argparse.Namespace) -> Iterator[tuple[Job, Outcome]]:
    """Each job that was asked for, as soon as it has ended; slim alone has flexpara run first, for its seams."""
    for mode in arguments.modes:
        jobs = jobs_of(mode, arguments)
        systems = {job.system for job in jobs}
        unasked = [replace(jobs[0], system="flexpara")] if "slim" in systems and "flexpara" not in systems else []
        seams: NDArray[np.float64] | None = None
        for job in [*unasked, *jobs]:
            with tempfile.TemporaryDirectory() as folder:
                outcome = run(job, asset.surface, arguments.budget, Path(folder), seams)
            if job.system == "flexpara" and not job.ablation and outcome.answer is not None:
                seams = outcome.answer.corner_uv
            if job not in unasked:
                yield job, outcome


def with_ratios(rows: list[Row]) -> list[Row]:
    """The rows, and in each that is done its isometric mean over xatlas' in the same table: free of normalisation."""
    done = [row for row in rows if row["status"] == "done"]
    xatlas = {(row["mesh"], row["mode"]): row for row in done if row["system"] == "xatlas"}

    def ratio(row: Row) -> float | None:
        reference = xatlas.get((row["mesh"], row["mode"]))
        if reference is None or row["status"] != "done":
            return None
        return row["metrics"]["isometric_mean"] / max(reference["metrics"]["isometric_mean"], 1e-12)

    return [row | {"isometric_ratio": ratio(row)} for row in rows]


def about(arguments: argparse.Namespace) -> Row:
    """Date, hardware, versions, commit and settings: what the numbers depend on."""
    facts = header()
    versions = {name: version(name) for name, module in PACKAGES.items() if importlib.util.find_spec(module)}
    device = "no torch"
    if importlib.util.find_spec("torch"):
        done = subprocess.run([sys.executable, "-c", DEVICE], cwd=ROOT, capture_output=True, text=True, check=True)
        device = done.stdout.strip()
    names = (*GIVEN, "budget", "modes", "systems", "ablations")
    return facts | {
        "date": datetime.now(UTC).strftime("%Y-%m-%d"),
        "device": device,
        "conditions": conditions(),
        "versions": facts["versions"] | versions,
        "settings": {name: getattr(arguments, name) for name in names},
    }


def conditions() -> str:
    """What else decides how long things take: threads, priority, and how busy the machine was at the start."""
    threads = os.environ.get("OMP_NUM_THREADS", "as many as cores")
    return f"OMP_NUM_THREADS {threads}, niceness {os.nice(0)}, load average {os.getloadavg()[0]:.1f} at the start"


def words(text: str, known: tuple[str, ...]) -> tuple[str, ...]:
    """Comma-separated words, each among those known."""
    found = tuple(dict.fromkeys(word.strip() for word in text.split(",") if word.strip()))
    unknown = [word for word in found if word not in known]
    if unknown or not found:
        raise argparse.ArgumentTypeError(f"{text!r}: expected some of {','.join(known)}")
    return found


def positive(text: str) -> float:
    """A number of seconds above zero."""
    value = float(text)
    if not value > 0.0:
        raise argparse.ArgumentTypeError(f"{text}: expected more than 0 seconds")
    return value


def mesh_files(places: list[Path]) -> list[Path]:
    """The mesh files among files and folders, in order."""
    inside = [sorted(place.iterdir()) if place.is_dir() else [place] for place in places if place.exists()]
    return [path for paths in inside for path in paths if path.suffix.lower() in SUFFIXES]


def with_common_options(parser: argparse.ArgumentParser) -> argparse.ArgumentParser:
    """The options that the gallery has as well."""
    parser.add_argument("--models", nargs="+", type=Path, required=True, help="mesh files, or folders of them")
    parser.add_argument("--preset", default="fast", help="flexpara's preset: fast or paper")
    parser.add_argument("--charts", type=int, default=8)
    parser.add_argument("--steps", type=int, help="flexpara's training steps, instead of the preset's")
    parser.add_argument("--width", type=int, help="channels of preset paper's hidden layers, instead of the paper's")
    parser.add_argument("--points", type=int, help="of the surface, in each step of preset paper")
    parser.add_argument("--precision", default="float32", help="of preset paper: float32 or bfloat16")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--ablations", type=lambda text: words(text, tuple(ABLATIONS)), default=(), help=",".join(ABLATIONS)
    )
    parser.add_argument("--budget", type=positive, default=600.0, help="wall seconds a system may take on one mesh")
    parser.add_argument(
        "--blender-python", type=Path, default=Path(sys.executable), help="a Python that has bpy, for smart-uv"
    )
    return parser


def with_meshes(parser: argparse.ArgumentParser, argv: list[str] | None) -> argparse.Namespace:
    """The parsed command line, `files` added; ends the program where there are none."""
    arguments = parser.parse_args(argv)
    arguments.files = mesh_files(arguments.models)
    if not arguments.files:
        named = ", ".join(map(str, arguments.models))
        parser.error(f"no mesh at {named}: name files or folders of {' '.join(sorted(SUFFIXES))}")
    return arguments


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    about_it = __doc__.splitlines()[0] if __doc__ else ""
    parser = with_common_options(argparse.ArgumentParser(prog="python -m benchmarks.paper", description=about_it))
    parser.add_argument("--systems", type=lambda text: words(text, NAMES), default=NAMES, help=",".join(NAMES))
    parser.add_argument("--modes", type=lambda text: words(text, MODES), default=MODES, help=",".join(MODES))
    parser.add_argument("--json", type=Path, help="write every figure there as well")
    return with_meshes(parser, argv)


def write_json(path: Path, facts: Row, rows: list[Row]) -> None:
    """Every figure so far, and which of the paper's were not run."""
    counts = coverage(load_figures(), rows)
    not_run = [
        {"table": table, "why": why, "figures": count}
        for table, reasons in counts.items()
        for why, count in reasons.items()
        if why
    ]
    whole = {"about": facts, "rows": rows, "comparisons": comparisons(rows), "not_run": not_run}
    path.write_text(json.dumps(whole, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def main(argv: list[str] | None = None) -> int:
    """Run, print, write; 1 when a system failed (to be absent, or out of time, is no failure)."""
    arguments = parse(argv)
    facts, rows = about(arguments), list[Row]()
    for path in arguments.files:
        asset = load_asset(path)
        for job, outcome in outcomes_of(asset, arguments):
            rows.append(row := row_of(job, asset, outcome))
            ended = f"{row['seconds']:.1f} s" if row["status"] == "done" else f"{row['status']}: {row['why']}"
            print(f"{row['mesh']} · {row['mode']} · {name_of(row)} · {ended}", file=sys.stderr, flush=True)
            if arguments.json:
                write_json(arguments.json, facts, with_ratios(rows))
    print(markdown(facts, with_ratios(rows)))
    return 1 if any(row["status"] == "failed" for row in rows) else 0


if __name__ == "__main__":
    sys.exit(main())
