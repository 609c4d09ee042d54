"""How fast an exported map answers: `python -m benchmarks.queryrate FILE.onnx MESH [--points N] [--runs N]`.

Prints the seconds until a new session's first answer, and points a second on one core and on all that this process may
use: medians.  Points are drawn evenly on the mesh, a quarter of them a little off it.
"""

from __future__ import annotations

import statistics
import sys
from argparse import ArgumentParser
from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING

import numpy as np

from flexpara.runtime.io.meshfile import load_asset
from flexpara.runtime.process.cores import core_count
from flexpara.runtime.sessions.session import UnwrapSession

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

OFF = 0.01
"""How far off the surface a quarter of the points lie, as a share of its extent."""


def points_of(mesh: Path, count: int) -> NDArray[np.float32]:
    """(n, 3) points on and near a mesh."""
    surface, rng = load_asset(mesh).surface, np.random.default_rng(0)
    area = surface.face_areas()
    share = rng.dirichlet([1.0, 1.0, 1.0], size=count)
    corners = surface.triangles[rng.choice(len(area), size=count, p=area / area.sum())]
    points = np.einsum("nc,ncd->nd", share, corners)
    off = rng.normal(scale=OFF * np.ptp(surface.vertices), size=points.shape)
    points[::4] += off[::4]
    return points.astype(np.float32)


def median_seconds(task: Callable[[], object], runs: int) -> float:
    """Of one call."""
    taken = []
    for _ in range(runs):
        start = perf_counter()
        task()
        taken.append(perf_counter() - start)
    return statistics.median(taken)


def main() -> None:
    """Measure, and print three lines."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("model", type=Path)
    parser.add_argument("mesh", type=Path)
    parser.add_argument("--points", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=5)
    asked = parser.parse_args()
    points = points_of(asked.mesh, asked.points)
    first = median_seconds(lambda: UnwrapSession(asked.model).unwrap(points[:1]), asked.runs)
    sys.stdout.write(f"first answer: {1e3 * first:.0f} ms\n")
    for threads in sorted({1, core_count()}):
        session = UnwrapSession(asked.model, threads=threads)
        seconds = median_seconds(lambda session=session: session.unwrap(points), asked.runs)
        sys.stdout.write(f"{threads} threads: {1e-6 * len(points) / seconds:.2f} M points a second\n")


if __name__ == "__main__":
    main()
