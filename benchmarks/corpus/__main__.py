"""Run flexpara on whatever is in folders: `python -m benchmarks.corpus FOLDER_OR_FILE… [-o out/corpus]`.

Each file is unwrapped as a user would, `flexpara unwrap FILE -o OUT --maps none --format glb,obj --no-preview --quiet`,
in a process of its own with a time limit; another process judges what was written (see `judge`).  `--peers
xatlas,uvunwrap` unwraps the same cleaned surface by those tools beside it; their seconds are those of the call alone.

Results come as lines of JSON, `results.jsonl`, as they are found; a rerun does what is missing (`--again` all of it).
At the end `results.json` and `results.md` hold the table, a summary line a tool, and the bars that were missed.
`--compare OLD.jsonl` sets an earlier run beside this one.  Exit code 1 when a bar is missed.
Standard library only, so that the processes it starts are measured as they are.
"""

from __future__ import annotations

import argparse
import json
import os
import shlex
import signal
import subprocess
import sys
import tempfile
import threading
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from . import tables
from .processes import ROOT, ended_too, run
from .tables import Row

SUFFIXES = {".obj", ".ply", ".stl", ".off", ".glb", ".gltf", ".3mf", ".dae", ".usda", ".usdz"}
UNWRAP = ("--maps", "none", "--format", "glb,obj", "--no-preview", "--quiet")
PEERS = ("xatlas", "uvunwrap")
JUDGE_LIMIT = 600.0
BARS = "seconds<=60 peak_mb<=1024 stretch<=1.1"
FILE_BARS = Path(__file__).with_name("bars.json")
DEFECTS = ("collapsed", "flips", "degenerate", "overlap", "outside")


def unwrapped(path: Path, name: str, arguments: argparse.Namespace, folder: Path) -> Row:
    """The row of one file: flexpara's command line, then the judge on what it wrote."""
    out = folder / "out"
    command = [arguments.python, "-m", "flexpara", "unwrap", str(path), "-o", str(out), *UNWRAP]
    ended = run([*command, *shlex.split(arguments.options)], arguments.limit)
    status = {None: "timeout", 0: "ok", 2: "refused"}.get(ended.code, f"exit {ended.code}")
    row: Row = {"file": name, "tool": "flexpara", "status": status, "code": ended.code, "seconds": ended.seconds}
    row |= {
        "cpu_seconds": ended.cpu_seconds,
        "peak_mb": ended.peak_mb,
        "said": ended.said,
        "stderr_lines": ended.lines,
        "jobs": arguments.jobs,
    }
    if status != "ok":
        return row
    reports = list(out.glob("*.report.json"))
    written = sorted(path for kind in ("glb", "obj") for path in out.glob(f"*.{kind}"))
    if len(reports) != 1 or len(written) != 2:
        names = ", ".join(sorted(path.name for path in out.iterdir()))
        return row | {"status": "unjudged", "said": f"a report, a glb and an obj were expected, found {names}"}
    row |= from_report(json.loads(reports[0].read_text(encoding="utf-8")))
    return row | from_files(str(path), written, arguments, folder)


def from_report(report: dict[str, Any]) -> Row:
    """What the run says of itself."""
    network, metrics = report["network"], report["metrics"]
    agreement = [network[name] for name in ("chart_agreement", "seam_agreement") if network.get(name) is not None]
    said = {name: metrics[name] for name in ("charts", "symmetric_dirichlet_mean", "seam_length", "flipped_faces")}
    return {
        "rms_texels": network["rms_texels"],
        "agreement": min(agreement) if agreement else None,
        "network": network,
        "report": said | {"overlap_fraction": metrics["overlap_fraction"], "changes": report.get("changes")},
        "seconds_of": report.get("seconds"),
    }


def from_files(source: str, written: list[Path], arguments: argparse.Namespace, folder: Path) -> Row:
    """The judge's columns: of the first file, but of each defect the worst of all."""
    result = folder / "judged.json"
    command = [sys.executable, "-m", "benchmarks.corpus.judge", str(result), arguments.evaluator, source]
    ended = run([*command, *map(str, written)], JUDGE_LIMIT)
    if ended.code != 0:
        return {"status": "unjudged", "said": f"the judge ended with {ended.code}: {ended.said}"}
    found = json.loads(result.read_text(encoding="utf-8"))
    for name, metrics in found.items():
        if "error" in metrics:
            return {"status": "unjudged", "said": f"{name}: {metrics['error']}"}
    first = found[written[0].name]
    worst = {name: max(metrics[name] for metrics in found.values()) for name in DEFECTS}
    return first | worst | {"faces_written": {name: metrics["faces"] for name, metrics in found.items()}}


def by_peer(tool: str, path: Path, name: str, arguments: argparse.Namespace, folder: Path) -> Row:
    """The row of a peer on the surface that flexpara reads from the file."""
    surface, answer = folder / "surface.npz", folder / "answer.npz"
    row: Row = {"file": name, "tool": tool, "status": "ok", "said": "", "jobs": arguments.jobs}
    read = run([sys.executable, "-m", "benchmarks.corpus.peer", "read", str(path), str(surface)], arguments.limit)
    ended = read
    if read.code == 0:
        command = [sys.executable, "-m", "benchmarks.corpus.peer", tool, str(surface), str(answer)]
        ended = run(command, arguments.peer_limit)
    if ended.code != 0:
        status = {None: "timeout", 2: "refused"}.get(ended.code, f"exit {ended.code}")
        return row | {"status": status, "seconds": ended.seconds, "said": ended.said}
    seconds = json.loads(answer.with_suffix(".json").read_text(encoding="utf-8"))["seconds"]
    return row | {"seconds": seconds, "peak_mb": ended.peak_mb} | from_files("none", [answer], arguments, folder)


def all_rows(arguments: argparse.Namespace, known: list[Row]) -> list[Row]:
    """Known rows and those still missing, each written and printed as soon as it is there; in the files' order."""
    rows = {(row["file"], row["tool"]): row for row in known}
    wanted = [(tool, path, name) for path, name in arguments.files for tool in ("flexpara", *arguments.peers)]
    missing = [item for item in wanted if (item[2], item[0]) not in rows]
    lock, results = threading.Lock(), arguments.output / "results.jsonl"

    def work(item: tuple[str, Path, str]) -> None:
        tool, path, name = item
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            if arguments.keep and tool == "flexpara":
                folder = arguments.output / "files" / name
                folder.mkdir(parents=True, exist_ok=True)
            row = unwrapped(path, name, arguments, folder) if tool == "flexpara" else by_peer(*item, arguments, folder)
        with lock:
            rows[name, tool] = row
            with results.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(row) + "\n")
            print(tables.line(row), flush=True)

    with ThreadPoolExecutor(arguments.jobs) as pool:
        for _ in pool.map(work, missing):
            pass
    return [rows[name, tool] for tool, _, name in wanted]


def about() -> dict[str, Any]:
    """Hardware and commit: what the numbers depend on."""
    command = ["git", "describe", "--always", "--dirty"]
    commit = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False).stdout.strip()
    cpuinfo = Path("/proc/cpuinfo")
    lines = cpuinfo.read_text(encoding="utf-8").splitlines() if cpuinfo.is_file() else []
    cpu = next((text.partition(":")[2].strip() for text in lines if text.startswith("model name")), "unknown")
    return {"cpu": cpu, "cores": len(os.sched_getaffinity(0)), "commit": commit}


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The command line; `files` are pairs of path and name, each once."""
    evaluator = ROOT.parent / "shared" / "check" / "uveval.py"
    parser = argparse.ArgumentParser(prog="python -m benchmarks.corpus", description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("inputs", nargs="+", type=Path, help="folders (searched for meshes) or files")
    add("-o", "--output", type=Path, default=ROOT / "out" / "corpus", help="folder of results, to resume from as well")
    add("--limit", type=float, default=120.0, help="seconds a file may take")
    add("--peer-limit", type=float, default=120.0, help="seconds a peer may take for a file")
    add("--jobs", type=int, default=1, help="files at the same time; more than one makes each slower")
    add("--peers", default="", help=f"comma-separated: {', '.join(PEERS)}")
    add("--options", default="", help='more options of flexpara unwrap, e.g. "--charts 1"')
    add("--evaluator", default=str(evaluator), help="file with evaluate(vertices, faces, corner_uv), or none")
    add("--bars", default=BARS, help="what every file must hold, beside being valid")
    add("--file-bars", type=Path, default=FILE_BARS, help='JSON: {"simple/plane.obj": ["charts<=1"], …}; or patterns')
    add("--compare", type=Path, help="results.jsonl of an earlier run")
    add("--keep", action="store_true", help="keep what flexpara wrote, under files/ of the output folder")
    add("--again", action="store_true", help="forget earlier results of these files")
    add("--python", default=sys.executable, help="interpreter that runs flexpara")
    arguments = parser.parse_args(argv)
    arguments.peers = [name for name in arguments.peers.split(",") if name]
    if unknown := set(arguments.peers) - set(PEERS):
        parser.error(f"no peer {', '.join(unknown)}, expected some of {', '.join(PEERS)}")
    if arguments.evaluator != "none" and not Path(arguments.evaluator).is_file():
        parser.error(f"no evaluator at {arguments.evaluator}: name one, or --evaluator none for flexpara's metrics")
    arguments.files = list(dict.fromkeys(pair for item in arguments.inputs for pair in meshes(item)))
    twice = [name for name, times in Counter(name for _, name in arguments.files).items() if times > 1]
    if twice:
        parser.error(f"{', '.join(twice)}: several files of that name, expected names that differ; run them apart")
    if not arguments.files:
        parser.error(f"no mesh at {', '.join(map(str, arguments.inputs))}")
    return arguments


def meshes(item: Path) -> list[tuple[Path, str]]:
    """(path, name) of each mesh below a folder, or of the file; the name is that of its folder and its own."""
    item = item.resolve()
    found = sorted(path for path in item.rglob("*") if path.suffix.lower() in SUFFIXES) if item.is_dir() else [item]
    return [(path, f"{path.parent.name}/{path.name}") for path in found]


def main(argv: list[str] | None = None) -> int:
    """Run, report, and say what is missed."""
    arguments = parse(argv)
    arguments.output.mkdir(parents=True, exist_ok=True)
    results = arguments.output / "results.jsonl"
    names = {name for _, name in arguments.files}
    known = [row for row in tables.read_rows(results) if not (arguments.again and row["file"] in names)]
    facts = about()
    print(f"{facts['cpu']}, {facts['cores']} cores · commit {facts['commit']} · {len(names)} files")
    print(f"{sum(row['file'] in names for row in known)} rows are there from before\n\n{tables.header()}", flush=True)
    rows = all_rows(arguments, known)
    own = json.loads(arguments.file_bars.read_text(encoding="utf-8"))
    missed = tables.violations(rows, arguments.bars.split(), own)
    answered = sum(row["tool"] == "flexpara" and row["code"] == 0 for row in rows)
    met = f"Every bar is met by the {answered} files that were answered."
    closing = [*tables.summary(rows), "", f"Missed by {len(missed)} files:" if missed else met]
    closing += [f"- {text}" for text in missed]
    if arguments.compare:
        closing += ["", *tables.compare(tables.read_rows(arguments.compare), rows)]
    print("\n" + "\n".join(closing))
    listing = [tables.header(), *map(tables.line, rows), "", *closing, ""]
    (arguments.output / "results.md").write_text("\n".join(listing), encoding="utf-8")
    whole = {"about": facts, "rows": rows, "missed": missed}
    (arguments.output / "results.json").write_text(json.dumps(whole, indent=1), encoding="utf-8")
    return 1 if missed else 0


if __name__ == "__main__":
    with ended_too(signal.SIGINT):
        sys.exit(main())
