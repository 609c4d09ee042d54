"""The table of flexpara beside xatlas and uvunwrap, on any meshes: `python -m benchmarks.unwrap [FOLDER_OR_FILE …]`.

Every tool unwraps the same cleaned surface and is measured by the same function in the same run.  xatlas and uvunwrap
are timed by their call, flexpara as a whole process (`flexpara unwrap MESH --maps none`), start-up and all files
included.  Peak memory is that of the whole process.  Lengths are relative (see `flexpara.runtime.geometry.metrics`);
seconds are the median of --repeat runs.  The bars are those the project has set itself; a row of flexpara names those
it misses.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import statistics
import subprocess
import sys
import tempfile
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.geometry.topology import components
from flexpara.runtime.io.meshfile import load_asset

if TYPE_CHECKING:
    from collections.abc import Iterator

    from flexpara.runtime.mesh import Asset

ROOT = Path(__file__).resolve().parent.parent
SUFFIXES = {".obj", ".ply", ".stl", ".off", ".glb", ".gltf"}
Row = dict[str, Any]

ISO_BAR, SEAM_BAR = 1.7, 0.70  # × xatlas
ISO_BARS, SEAM_BARS = {"bunny": 1.0}, {"fandisk": 1.0, "beetle-alt": 1.0}
TIME_BARS = {"bunny": 2.5}  # × xatlas
SMALL_FACES, SMALL_SECONDS = 20_000, 20.0
MEMORY_BAR_MB, RMS_BAR, AGREEMENT_BAR, IMPORT_BAR = 2048.0, 1.5, 0.99, 0.3

COLUMNS = {
    "mesh": "{}", "tool": "{}", "faces": "{}", "charts": "{}", "iso": "{:.5f}", "iso_ratio": "{:.2f}",
    "symdir": "{:.4f}", "conformal": "{:.4f}", "seam": "{:.2f}", "seam_ratio": "{:.2f}", "flips": "{}",
    "overlap": "{:.1e}", "seconds": "{:.2f}", "seconds_ratio": "{:.2f}", "peak_mb": "{:.0f}",
    "rms_texels": "{:.2f}", "agreement": "{:.4f}", "bars": "{}",
}  # fmt: skip


WATCH = """import json, resource, subprocess, sys, time
start = time.perf_counter()
code = subprocess.run(sys.argv[1:], stdout=subprocess.DEVNULL).returncode
used = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(json.dumps([code, time.perf_counter() - start, used / 1024]))"""


def timed(command: list[str]) -> tuple[float, float]:
    """Run a command from the repository root: (wall seconds, peak resident MB).  Raises: RuntimeError when it fails.

    A bare interpreter starts and watches it: a process begins with the peak memory of the one that started it.
    """
    watched = [sys.executable, "-S", "-c", WATCH, *command]
    done = subprocess.run(watched, cwd=ROOT, capture_output=True, text=True, check=True)
    code, seconds, peak = json.loads(done.stdout)
    if code:
        last = " ".join(done.stderr.strip().splitlines()[-1:])
        raise RuntimeError(f"{' '.join(command[1:4])} ended with {code}: {last}")
    return seconds, peak


def measured(asset: Asset, corner_uv: np.ndarray) -> Row:
    """The columns that every tool has."""
    metrics = measure(asset.surface, corner_uv).to_dict()
    return {
        "charts": metrics["charts"],
        "iso": metrics["isometric_mean"],
        "symdir": metrics["symmetric_dirichlet_mean"],
        "conformal": metrics["conformal_mean"],
        "seam": metrics["seam_length"],
        "flips": metrics["flipped_faces"],
        "overlap": metrics["overlap_fraction"],
    }


def peer_row(tool: str, asset: Asset, repeat: int, folder: Path) -> Row:
    """Unwrap by another tool, in processes of its own."""
    given, result = folder / "surface.npz", folder / "uv.npz"
    np.savez(given, vertices=asset.surface.vertices, faces=asset.surface.faces)
    command = [sys.executable, "-m", "benchmarks.peers", tool, str(given), str(result)]
    peaks, answers = list[float](), list[dict[str, np.ndarray]]()
    for _ in range(repeat):
        peaks.append(timed(command)[1])
        with np.load(result, allow_pickle=False) as found:
            answers.append(dict(found))
    seconds = statistics.median(float(answer["seconds"]) for answer in answers)
    return measured(asset, answers[-1]["corner_uv"]) | {"seconds": seconds, "peak_mb": max(peaks)}


def flexpara_row(path: Path, asset: Asset, arguments: argparse.Namespace, folder: Path) -> Row:
    """Unwrap by flexpara's command line, and read what it wrote."""
    command = [
        sys.executable,
        "-m",
        "flexpara",
        "unwrap",
        str(path),
        "-o",
        str(folder),
        "--maps",
        "none",
        "--quiet",
        "--force",
    ]
    command += ["--charts", str(arguments.charts), "--size", str(arguments.size), "--seed", str(arguments.seed)]
    runs = [timed(command) for _ in range(arguments.repeat)]
    made = load_asset(folder / f"{path.stem}.glb")
    if made.uv is None or len(made.faces) != len(asset.faces):
        raise RuntimeError(
            f"{path.stem}.glb holds {len(made.faces)} faces, expected the {len(asset.faces)} of the source"
        )
    network = json.loads((folder / f"{path.stem}.report.json").read_text(encoding="utf-8"))["network"]
    row = measured(asset, made.uv[made.faces])
    row |= {"seconds": statistics.median(run[0] for run in runs), "peak_mb": max(run[1] for run in runs)}
    rms = float("inf") if network["rms_texels"] is None else network["rms_texels"]
    return row | {"rms_texels": rms, "agreement": min(network["chart_agreement"], network["seam_agreement"])}


def judge(row: Row, arguments: argparse.Namespace) -> list[str]:
    """The bars that a row of flexpara misses; empty when it clears them all.  Ratios are to xatlas."""
    mesh = row["mesh"]
    bars = {
        "flips": row["flips"] == 0,
        "overlap": row["overlap"] == 0.0,
        "charts": row["charts"] <= arguments.charts + row["components"] - 1,
        "iso": row["iso_ratio"] <= ISO_BARS.get(mesh, ISO_BAR),
        "seam": row["seam_ratio"] <= SEAM_BARS.get(mesh, SEAM_BAR),
        "memory": row["peak_mb"] <= MEMORY_BAR_MB,
        "rms": row["rms_texels"] <= RMS_BAR,
        "agreement": row["agreement"] >= AGREEMENT_BAR,
        "seconds": row["seconds_ratio"] <= TIME_BARS.get(mesh, float("inf"))
        and (row["faces"] >= SMALL_FACES or row["seconds"] <= SMALL_SECONDS),
    }
    return [name for name, clear in bars.items() if not clear]


def rows_of(path: Path, arguments: argparse.Namespace) -> Iterator[Row]:
    """One row a tool, flexpara last, each as soon as it is measured."""
    asset = load_asset(path)
    common = {
        "mesh": path.stem,
        "faces": len(asset.faces),
        "components": int(components(asset.surface.faces).max()) + 1,
    }
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        reference = common | {"tool": "xatlas"} | peer_row("xatlas", asset, arguments.repeat, folder)
        yield reference
        if importlib.util.find_spec("uvunwrap"):
            yield with_ratios(
                common | {"tool": "uvunwrap"} | peer_row("uvunwrap", asset, arguments.repeat, folder), reference
            )
        row = with_ratios(common | {"tool": "flexpara"} | flexpara_row(path, asset, arguments, folder), reference)
        missed = judge(row, arguments)
        yield row | {"missed": missed, "bars": "all met" if not missed else f"misses {', '.join(missed)}"}


def with_ratios(row: Row, reference: Row) -> Row:
    """Add the columns that compare a tool with xatlas."""
    return row | {f"{name}_ratio": row[name] / max(reference[name], 1e-12) for name in ("iso", "seam", "seconds")}


def line(row: Row) -> str:
    """One line of the Markdown table; a column that a tool has not is empty."""
    return "| " + " | ".join(form.format(row[name]) if name in row else "" for name, form in COLUMNS.items()) + " |"


def import_seconds(repeat: int = 5) -> float:
    """Median wall time of `import flexpara`, less that of an interpreter that imports nothing."""
    spans = []
    for code in ("pass", "import flexpara"):
        spans.append(statistics.median(timed([sys.executable, "-c", code])[0] for _ in range(repeat)))
    return spans[1] - spans[0]


def header() -> Row:
    """Hardware, versions and commit: what the numbers depend on."""
    commit = subprocess.run(
        ["git", "describe", "--always", "--dirty"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    cpuinfo = Path("/proc/cpuinfo")
    models = (
        [text for text in cpuinfo.read_text().splitlines() if text.startswith("model name")] if cpuinfo.exists() else []
    )
    packages = [
        name for name in ("numpy", "torch", "onnxruntime", "xatlas", "uvunwrap") if importlib.util.find_spec(name)
    ]
    return {
        "cpu": models[0].partition(":")[2].strip() if models else platform.processor(),
        "cores": len(os.sched_getaffinity(0)),
        "commit": commit.stdout.strip(),
        "python": platform.python_version(),
        "versions": {name: version(name) for name in packages},
        "import_seconds": import_seconds(),
    }


def parse(argv: list[str] | None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.unwrap", description=__doc__.splitlines()[0] if __doc__ else ""
    )
    parser.add_argument(
        "meshes", nargs="*", type=Path, default=[ROOT.parent / "shared" / "models"], help="files, or folders of them"
    )
    parser.add_argument("--charts", type=int, default=8)
    parser.add_argument("--size", type=int, default=2048, help="texels a side")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--repeat", type=int, default=1, help="runs; seconds are their median")
    parser.add_argument("--json", type=Path, help="write every figure there as well")
    arguments = parser.parse_args(argv)
    found = [sorted(item.iterdir()) if item.is_dir() else [item] for item in arguments.meshes if item.exists()]
    arguments.files = [path for paths in found for path in paths if path.suffix.lower() in SUFFIXES]
    if not arguments.files:
        parser.error(
            f"no mesh at {', '.join(map(str, arguments.meshes))}: name files or folders of {' '.join(sorted(SUFFIXES))}"
        )
    return arguments


def main(argv: list[str] | None = None) -> int:
    """Print the table, row by row; 1 when flexpara misses a bar or fails on a mesh."""
    arguments = parse(argv)
    about, rows, failures = header(), list[Row](), list[str]()
    packages = ", ".join(f"{name} {number}" for name, number in about["versions"].items())
    print(f"{about['cpu']}, {about['cores']} cores · Python {about['python']} · {packages} · commit {about['commit']}")
    fast = "met" if about["import_seconds"] <= IMPORT_BAR else "missed"
    print(f"`import flexpara`: {about['import_seconds']:.3f} s (bar {IMPORT_BAR} s: {fast})\n")
    print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}", flush=True)
    for path in arguments.files:
        try:
            for row in rows_of(path, arguments):
                rows.append(row)
                print(line(row), flush=True)
        except RuntimeError as error:
            failures.append(f"{path.stem}: {error}")
            print(f"| {path.stem} | failed: {error} |", flush=True)
        if arguments.json:
            arguments.json.write_text(
                json.dumps({"about": about, "rows": rows, "failures": failures}, indent=1), encoding="utf-8"
            )
    missed = [f"{row['mesh']}: {name}" for row in rows for name in row.get("missed", [])] + failures
    missed += [] if fast == "met" else ["import"]
    print(f"\n{'Every bar is met.' if not missed else 'Missed: ' + '; '.join(missed)}")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
