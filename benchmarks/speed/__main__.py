"""Time and memory over faces: `python -m benchmarks.speed FOLDER [--models DIR] [--most FACES] [--runs N] [--for S]`.

Makes meshes and clouds of a thousand to a million faces in FOLDER (`cases`), runs flexpara, xatlas and uvunwrap on
each as whole processes, N times, and keeps every run in FOLDER/speed.json as it ends: what is there is not run again.
With --for no run begins after so many seconds, so that a long table can be made in slices.  Then prints the medians,
and draws FOLDER/seconds.svg and FOLDER/memory.svg.  Times of a busy machine are inflated; CPU seconds hardly are.
"""

from __future__ import annotations

import json
import statistics
import sys
from argparse import ArgumentParser
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

from benchmarks.corpus.processes import run

from .cases import Case, cases
from .curves import drawn

if TYPE_CHECKING:
    from collections.abc import Callable

TOOLS = ("flexpara", "xatlas", "uvunwrap")
LIMIT = 1800.0
"""Seconds after which a run is ended."""
QUALITY = ("charts", "stretch")

Row = dict[str, Any]


def command(tool: str, path: Path) -> list[str]:
    """What is run: the whole process, uv and ONNX file only."""
    if tool != "flexpara":
        return [sys.executable, "-m", "benchmarks.corpus.peer", tool, str(path.with_suffix(".npz")), str(answer(path))]
    words = ["--maps", "none", "--format", "glb", "--no-preview", "--quiet", "--force"]
    return [sys.executable, "-m", "flexpara", "unwrap", str(path), "-o", str(path.with_suffix(".out")), *words]


def answer(path: Path) -> Path:
    """Where a peer's layout goes."""
    return path.with_name(f"{path.stem}.answer.npz")


def quality(tool: str, path: Path) -> Row:
    """Charts and mean stretch of what the last run wrote."""
    if tool == "flexpara":
        report = path.with_suffix(".out") / f"{path.stem}.report.json"
        metrics = json.loads(report.read_text(encoding="utf-8"))["metrics"]
        return {"charts": metrics["charts"], "stretch": metrics["symmetric_dirichlet_mean"]}
    found = path.with_name(f"{path.stem}.quality.json")
    ended = run([sys.executable, "-m", "benchmarks.frontier.quality", str(answer(path)), str(found), "none"], LIMIT)
    row = json.loads(found.read_text(encoding="utf-8")) if ended.code == 0 else {}
    return {name: row.get(name) for name in QUALITY}


def timed(case: Case, tool: str) -> Row:
    """One run, and what came of it."""
    ended = run(command(tool, case.path), LIMIT)
    facts = {"code": ended.code, "seconds": ended.seconds, "cpu": ended.cpu_seconds, "mb": ended.peak_mb}
    row = {"family": case.family, "name": case.path.stem, "faces": case.faces, "tool": tool, **facts}
    return row | (quality(tool, case.path) if ended.code == 0 else {})


def measure(folder: Path, wanted: list[Case], runs: int, late: Callable[[], bool] = lambda: False) -> list[Row]:
    """All runs, those that an earlier call made included; none begins once it is ``late``."""
    kept = folder / "speed.json"
    done: list[Row] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else []
    for number in range(runs):  # a table of one run each first
        for case in wanted:
            for tool in TOOLS if case.family != "cloud" else TOOLS[:1]:
                before = sum(row["tool"] == tool and row["name"] == case.path.stem for row in done)
                if before > number or late():
                    continue
                done.append(timed(case, tool))
                kept.write_text(json.dumps(done, indent=1), encoding="utf-8")
    return done


def medians(rows: list[Row]) -> list[Row]:
    """A row for each case and tool that ended well: medians of its runs, and the ratio of CPU seconds to xatlas'."""
    found: list[Row] = []
    for name in dict.fromkeys(row["name"] for row in rows):
        for tool in TOOLS:
            good = [row for row in rows if (row["name"], row["tool"], row["code"]) == (name, tool, 0)]
            if good:
                middle = {key: statistics.median(row[key] for row in good) for key in ("seconds", "cpu", "mb")}
                found.append({**good[-1], **middle, "runs": len(good)})
    xatlas = {row["name"]: row for row in found if row["tool"] == "xatlas"}
    for row in found:
        beside = xatlas.get(row["name"])
        row["of_xatlas"] = row["seconds"] / beside["seconds"] if beside else None
    return found


def table(rows: list[Row]) -> str:
    """Medians as markdown."""
    lines = ["| mesh | faces | tool | seconds | of xatlas | CPU seconds | MB | charts | mean stretch | runs |"]
    lines.append("|---" * 10 + "|")
    for row in medians(rows):
        ratio = f"{row['of_xatlas']:.2f}" if row["of_xatlas"] is not None else ""
        charts, stretch = ("" if row.get(key) is None else row[key] for key in QUALITY)
        stretch = f"{stretch:.4f}" if stretch else ""
        facts = f"{row['seconds']:.1f} | {ratio} | {row['cpu']:.1f} | {row['mb']:.0f} | {charts} | {stretch}"
        lines.append(f"| {row['name']} | {row['faces']} | {row['tool']} | {facts} | {row['runs']} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, draw, and print the table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--models", type=Path, help="folder of spot, homer, cow and bunny as OBJ")
    parser.add_argument("--most", type=int, default=1_400_000)
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--for", type=float, default=float("inf"), dest="seconds")
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    start = monotonic()
    wanted = list(cases(asked.folder, asked.models, asked.most))
    rows = measure(asked.folder, wanted, asked.runs, lambda: monotonic() - start > asked.seconds)
    for key, words in (("seconds", "seconds of wall"), ("mb", "peak memory, MB")):
        name = {"seconds": "seconds", "mb": "memory"}[key]
        (asked.folder / f"{name}.svg").write_text(drawn(f"{words} over faces", medians(rows), key), encoding="utf-8")
    print(table(rows))


if __name__ == "__main__":
    main()
