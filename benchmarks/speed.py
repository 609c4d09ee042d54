"""Time and memory over faces, whole processes: `python -m benchmarks.speed FOLDER [--most FACES] [--runs N]`.

Makes meshes of a thousand to a million faces in FOLDER (spheres with noise, as scans have it), runs flexpara, xatlas
and uvunwrap on each, N times, and keeps every run in FOLDER/speed.json as it ends: what is there is not run again.
Then prints the medians as a table.  Times of a busy machine are inflated; CPU seconds hardly are.
"""

from __future__ import annotations

import json
import statistics
import sys
from argparse import ArgumentParser
from pathlib import Path

import numpy as np

from benchmarks.corpus.processes import run
from flexpara.runtime.samples import make_sample

RESOLUTIONS = (48, 96, 192, 384, 768, 1536)
"""Of the sphere: 1,280 faces and four times as many each, to 1,310,720."""
NOISE = 0.05
"""Standard deviation of a vertex along its normal, in edge lengths."""
TOOLS = ("flexpara", "xatlas", "uvunwrap")
LIMIT = 1800.0
"""Seconds after which a run is ended."""


def scan(resolution: int) -> tuple[np.ndarray, np.ndarray]:
    """A sphere as a scanner would see it, stretched to an egg: vertices (v, 3) and faces (f, 3)."""
    vertices, faces = make_sample("sphere", resolution=resolution)
    edge = float(np.linalg.norm(vertices[faces[:, 0]] - vertices[faces[:, 1]], axis=1).mean())
    noise = np.random.default_rng(0).normal(scale=NOISE * edge, size=(len(vertices), 1))
    return vertices * (1.0 + noise) * [1.0, 0.8, 1.4], faces


def prepared(folder: Path, most: int) -> list[tuple[Path, int]]:
    """OBJ files and their faces, with an .npz beside each for the peers; made where they are absent."""
    found = []
    for resolution in RESOLUTIONS:
        vertices, faces = scan(resolution)
        if len(faces) > most:
            break
        path = folder / f"scan{len(faces)}.obj"
        if not path.exists():
            lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices.tolist()]
            lines += [f"f {a} {b} {c}" for a, b, c in (faces + 1).tolist()]
            np.savez(path.with_suffix(".npz"), vertices=vertices, faces=faces)
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        found.append((path, len(faces)))
    return found


def command(tool: str, path: Path) -> list[str]:
    """What is run: the whole process, uv and ONNX file only."""
    if tool != "flexpara":
        answer = path.with_name(f"{path.stem}.{tool}.npz")
        return [sys.executable, "-m", "benchmarks.peers", tool, str(path.with_suffix(".npz")), str(answer)]
    output = path.with_name(f"{path.stem}.out")
    words = ["--maps", "none", "--no-preview", "--quiet", "--force"]
    return [sys.executable, "-m", "flexpara", "unwrap", str(path), "-o", str(output), *words]


def measure(folder: Path, most: int, runs: int) -> list[dict[str, object]]:
    """All runs, those that an earlier call made included."""
    kept = folder / "speed.json"
    done = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else []
    for path, faces in prepared(folder, most):
        for tool in TOOLS:
            before = sum(row["tool"] == tool and row["faces"] == faces for row in done)
            for _ in range(before, runs):
                ended = run(command(tool, path), LIMIT)
                facts = {"code": ended.code, "seconds": ended.seconds, "cpu": ended.cpu_seconds, "mb": ended.peak_mb}
                done.append({"tool": tool, "faces": faces, **facts})
                kept.write_text(json.dumps(done, indent=1), encoding="utf-8")
    return done


def table(rows: list[dict[str, object]]) -> str:
    """Medians as markdown: a row for each mesh and tool, and the ratio of its CPU seconds to those of xatlas."""
    lines = ["| faces | tool | seconds | CPU seconds | of xatlas | MB |", "|---|---|---|---|---|---|"]
    for faces in sorted({int(str(row["faces"])) for row in rows}):
        medians = {}
        for tool in TOOLS:
            good = [row for row in rows if (row["faces"], row["tool"], row["code"]) == (faces, tool, 0)]
            if good:
                names = ("seconds", "cpu", "mb")
                medians[tool] = [statistics.median(float(str(row[name])) for row in good) for name in names]
        for tool, (seconds, cpu, mb) in medians.items():
            ratio = f"{cpu / medians['xatlas'][1]:.2f}" if "xatlas" in medians else ""
            lines.append(f"| {faces} | {tool} | {seconds:.1f} | {cpu:.1f} | {ratio} | {mb:.0f} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, and print the table."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--most", type=int, default=1_400_000)
    parser.add_argument("--runs", type=int, default=3)
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    print(table(measure(asked.folder, asked.most, asked.runs)))


if __name__ == "__main__":
    main()
