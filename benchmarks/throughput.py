"""`flexpara batch` beside a shell loop over `flexpara unwrap`: assets an hour, all files written.

    python -m benchmarks.throughput [MESH|FOLDER…] [-o out/throughput] [--workers 2]

Hardware and load decide these numbers: run it on an idle machine.  It may be stopped at any time: what ended is kept in
the output folder, and the same command goes on from there.  The last line is the ratio of the rates, over the meshes
that both have done; a mesh that either refuses is named and left out.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from flexpara.runtime.batch.manifest import Entry, read_entries
from flexpara.runtime.cli.inputs import ENDINGS

SHARED = Path(__file__).resolve().parents[2] / "shared"
DEFAULT = (SHARED / "models", SHARED / "corpus" / "organic")
Loop = dict[str, tuple[float, int]]
"""Seconds and exit code of each mesh."""


def meshes_in(places: Sequence[Path]) -> list[Path]:
    """The meshes of folders, and single ones, by name."""
    found = [
        file
        for place in places
        for file in (sorted(place.iterdir()) if place.is_dir() else [place])
        if file.suffix.lower() in ENDINGS
    ]
    return sorted(found, key=lambda path: path.name)


def run_loop(meshes: Sequence[Path], output: Path) -> Loop:
    """Each mesh by a process of its own, one after the other; what an earlier run has done is not done again."""
    record = output / "loop.jsonl"
    done: Loop = {}
    if record.is_file():
        lines = (json.loads(line) for line in record.read_text(encoding="utf-8").splitlines())
        done = {line["mesh"]: (line["seconds"], line["code"]) for line in lines}
    for mesh in meshes:
        if mesh.name in done:
            continue
        words = ["unwrap", str(mesh), "-o", str(output / "loop" / mesh.stem), "--quiet"]
        begin = time.perf_counter()
        ended = subprocess.run([sys.executable, "-m", "flexpara", *words], stderr=subprocess.DEVNULL)
        done[mesh.name] = (time.perf_counter() - begin, ended.returncode)
        line = {"mesh": mesh.name, "seconds": round(done[mesh.name][0], 3), "code": ended.returncode}
        with record.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
        print(f"loop   {mesh.name:<40} {line['seconds']:>8.1f} s", flush=True)
    return {mesh.name: done[mesh.name] for mesh in meshes}


def run_batch(meshes: Sequence[Path], output: Path, workers: str) -> tuple[float, dict[str, Entry]]:
    """All meshes by one command; its seconds, those of runs that were stopped included."""
    record, listed = output / "batch.jsonl", output / "assets.jsonl"
    listed.write_text("".join(json.dumps({"file": str(mesh)}) + "\n" for mesh in meshes), encoding="utf-8")
    manifest = output / "batch" / "manifest.jsonl"
    if set(read_entries(manifest)) != {mesh.name for mesh in meshes}:
        words = ["batch", str(listed), "-o", str(output / "batch"), "--workers", workers]
        begin = time.perf_counter()
        try:
            subprocess.run([sys.executable, "-m", "flexpara", *words])
        finally:
            with record.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"seconds": round(time.perf_counter() - begin, 3)}) + "\n")
    lines = record.read_text(encoding="utf-8").splitlines()
    return sum(json.loads(line)["seconds"] for line in lines), read_entries(manifest)


def table(loop: Loop, seconds: float, entries: dict[str, Entry]) -> str:
    """What each took, and the ratio of the rates."""
    lines = [f"{'mesh':<40} {'loop s':>8} {'worker s':>9} {'charts s':>9}"]
    refused = {name for name, (_, code) in loop.items() if code or entries[name].status != "done"}
    for name, (took, _) in loop.items():
        charts = entries[name].stages.get("charts", 0.0)
        mark = " refused" if name in refused else ""
        lines.append(f"{name:<40} {took:>8.1f} {entries[name].seconds:>9.1f} {charts:>9.1f}{mark}")
    whole = sum(took for took, _ in loop.values())
    cores = len(os.sched_getaffinity(0))
    lines.append(f"{len(loop)} meshes, {len(refused)} refused, {cores} cores")
    lines.append(f"loop {whole:.1f} s, batch {seconds:.1f} s: {whole / seconds:.2f} times the rate")
    return "\n".join(lines)


def main(words: Sequence[str] | None = None) -> int:
    """Run what is missing of both, and print the table."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.throughput", description=__doc__)
    parser.add_argument("meshes", nargs="*", type=Path, default=list(DEFAULT))
    parser.add_argument("-o", "--output", type=Path, default=Path("out/throughput"))
    parser.add_argument("--workers", default="auto")
    asked = parser.parse_args(words)
    asked.output.mkdir(parents=True, exist_ok=True)
    meshes = meshes_in(asked.meshes)
    seconds, entries = run_batch(meshes, asked.output, asked.workers)
    missing = {mesh.name for mesh in meshes} - set(entries)
    if missing:
        print(f"{len(missing)} meshes are left: the same command goes on")
        return 130
    print(table(run_loop(meshes, asked.output), seconds, entries))
    return 0


if __name__ == "__main__":
    sys.exit(main())
