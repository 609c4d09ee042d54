"""The frontier of seam length over distortion: `python -m benchmarks.frontier FOLDER_OR_FILE… [-o out/frontier]`.

Each mesh is unwrapped by flexpara at several settings (`--settings`, names of `SETTINGS`) and by the peers, each in a
process of its own, and judged by `quality`.  Rows are kept in `results.jsonl` as they come; a rerun does what is
missing, and `--for SECONDS` ends one after the row at which so many have passed.  At the end `results.md` has the
table and what it says (`verdicts`), `MESH.svg` a plot of seam over distortion for each mesh.
seconds: CPU seconds of the whole process for flexpara, start-up and files included; of the call alone for a peer.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
from pathlib import Path
from time import monotonic
from typing import Any

from benchmarks.corpus.__main__ import about, meshes
from benchmarks.corpus.processes import ROOT, run

from .plot import drawn
from .verdicts import sentences

Row = dict[str, Any]

SETTINGS: dict[str, tuple[str, ...]] = {
    "default": (),
    "one chart": ("--charts", "1"),
    "one chart, 1.025": ("--charts", "1", "--max-stretch", "1.025"),
    "auto": ("--charts", "auto"),
    "price 0.0005": ("--charts", "auto", "--seam-price", "0.0005"),
    "price 0.0001": ("--charts", "auto", "--seam-price", "0.0001"),
    "price 0.01": ("--seam-price", "0.01"),
    **{f"charts {count}": ("--charts", str(count)) for count in (2, 4, 16, 32)},
}
PEERS = ("xatlas", "uvunwrap")
UNWRAP = ("--maps", "none", "--no-preview", "--quiet", "--force")
COLUMNS = {
    "mesh": "{}", "tool": "{}", "charts": "{}", "stretch": "{:.4f}", "seam": "{:.2f}", "objective": "{:.4f}",
    "jaggedness": "{:.2f}", "exposure": "{:.2f}", "crease": "{:.2f}", "compactness": "{:.2f}", "packing": "{:.3f}",
    "flips": "{}", "overlap": "{:.1e}", "seconds": "{:.1f}", "said": "{}",
}  # fmt: skip


def by_flexpara(path: Path, setting: str, arguments: argparse.Namespace, folder: Path) -> tuple[str, float, Path]:
    """(what went wrong, CPU seconds, file) of one unwrap."""
    command = [sys.executable, "-m", "flexpara", "unwrap", str(path), "-o", str(folder), *UNWRAP, *SETTINGS[setting]]
    ended = run(command, arguments.limit)
    said = "" if ended.code == 0 else f"exit {ended.code}: {ended.said}"
    return said, ended.cpu_seconds, folder / f"{path.stem}.glb"


def by_peer(path: Path, tool: str, arguments: argparse.Namespace, folder: Path) -> tuple[str, float, Path]:
    """As `by_flexpara`, on the surface that flexpara reads from the file."""
    surface, answer = folder / "surface.npz", folder / "answer.npz"
    for task, source, result in (("read", path, surface), (tool, surface, answer)):
        words = [sys.executable, "-m", "benchmarks.corpus.peer", task, str(source), str(result)]
        ended = run(words, arguments.limit)
        if ended.code != 0:
            return f"exit {ended.code}: {ended.said}", ended.cpu_seconds, answer
    seconds = json.loads(answer.with_suffix(".json").read_text(encoding="utf-8"))["seconds"]
    return "", float(seconds), answer


def row_of(path: Path, tool: str, arguments: argparse.Namespace) -> Row:
    """One mesh by one tool or setting."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        made = by_peer if tool in PEERS else by_flexpara
        said, seconds, layout = made(path, tool, arguments, folder)
        row: Row = {"mesh": path.stem, "tool": tool, "seconds": seconds, "said": said}
        if said:
            return row
        judge = [sys.executable, "-m", "benchmarks.frontier.quality", str(layout), str(folder / "judged.json")]
        ended = run([*judge, arguments.evaluator], arguments.limit)
        if ended.code != 0:
            return row | {"said": f"the judge ended with {ended.code}: {ended.said}"}
        return row | json.loads((folder / "judged.json").read_text(encoding="utf-8"))


def line(row: Row) -> str:
    """A line of the table; what a row has not is empty."""
    cells = [form.format(row[name]) if row.get(name) is not None else "" for name, form in COLUMNS.items()]
    return f"| {' | '.join(cells)} |"


def read_rows(path: Path) -> dict[tuple[str, str], Row]:
    """Rows of an earlier run, by mesh and tool; a last line that was cut off is left out."""
    rows = {}
    for text in path.read_text(encoding="utf-8").splitlines() if path.is_file() else []:
        try:
            row = json.loads(text)
        except json.JSONDecodeError:
            continue
        rows[row["mesh"], row["tool"]] = row
    return rows


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    shared = ROOT.parent / "shared"
    parser = argparse.ArgumentParser(prog="python -m benchmarks.frontier", description=(__doc__ or "").splitlines()[0])
    add = parser.add_argument
    add("inputs", nargs="*", type=Path, default=[shared / "models"], help="folders or files")
    add(
        "-o", "--output", type=Path, default=ROOT / "out" / "frontier", help="folder of results, to resume from as well"
    )
    add("--settings", default="default,one chart; 1.025", help="names separated by commas, ; for a comma inside one")
    add("--peers", default=",".join(PEERS), help="other tools; none for none")
    add("--evaluator", default=str(shared / "check" / "seamquality.py"), help="file with seam_quality(), or none")
    add("--limit", type=float, default=300.0, help="seconds a process may take")
    add("--for", type=float, default=float("inf"), dest="seconds", help="seconds after which no row is begun")
    arguments = parser.parse_args(argv)
    asked = [name.replace(";", ",") for name in arguments.settings.split(",") if name]
    peers = [name for name in arguments.peers.split(",") if name not in ("", "none")]
    if unknown := (set(asked) - set(SETTINGS)) | (set(peers) - set(PEERS)):
        parser.error(f"no setting or peer {', '.join(unknown)}, expected some of {', '.join((*SETTINGS, *PEERS))}")
    arguments.tools = [*peers, *asked]
    arguments.files = [path for item in arguments.inputs for path, _ in meshes(item)]
    if not all(path.is_file() for path in arguments.files) or not arguments.files:
        parser.error(f"no mesh at {', '.join(map(str, arguments.inputs))}")
    return arguments


def rows_wanted(arguments: argparse.Namespace) -> dict[tuple[str, str], Row]:
    """The rows that are asked for, by mesh and tool: those of earlier runs, and new ones until time is up."""
    results, start = arguments.output / "results.jsonl", monotonic()
    known, found = read_rows(results), {}
    for path in arguments.files:
        for tool in arguments.tools:
            name = path.stem, tool
            if name not in known:
                if monotonic() - start > arguments.seconds:
                    continue
                known[name] = row_of(path, tool, arguments)
                with results.open("a", encoding="utf-8") as stream:
                    stream.write(json.dumps(known[name]) + "\n")
            found[name] = known[name]
            print(line(found[name]), flush=True)
    return found


def main(argv: list[str] | None = None) -> int:
    """Run what is missing, print the table, draw the plots; 1 where something failed, 3 where rows are missing."""
    arguments = parse(argv)
    arguments.output.mkdir(parents=True, exist_ok=True)
    facts = about()
    head = [f"| {' | '.join(COLUMNS)} |", f"|{'---|' * len(COLUMNS)}"]
    print(f"{facts['cpu']}, {facts['cores']} cores · commit {facts['commit']}\n", *head, sep="\n", flush=True)
    rows, said = rows_wanted(arguments), list[str]()
    for path in arguments.files:
        own = [row for (mesh, _), row in rows.items() if mesh == path.stem]
        said += sentences(path.stem, own, PEERS)
        points = [row for row in own if not row["said"]]
        (arguments.output / f"{path.stem}.svg").write_text(drawn(path.stem, points), encoding="utf-8")
    print("", *said, sep="\n")
    table = [*head, *map(line, rows.values()), "", *said, ""]
    (arguments.output / "results.md").write_text("\n".join(table), encoding="utf-8")
    if any(row["said"] for row in rows.values()):
        return 1
    return 3 if len(rows) < len(arguments.files) * len(arguments.tools) else 0


if __name__ == "__main__":
    sys.exit(main())
