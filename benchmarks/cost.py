"""What many assets cost, from what a batch measured: assets a core hour by faces, and a schedule at many workers.

    python -m benchmarks.cost out/throughput/batch/manifest.jsonl [--assets 1000000] [--workers 1000] [--limit 120]

Seconds are those of a warm worker with a core of its own, as its manifest has them.  The assets to come are drawn from
the measured ones, with replacement.  Workers take them one after the other from one queue, as `flexpara batch` gives
them out; one that is lost takes its asset with it, which is tried again at once, and is back after a while.
"""

from __future__ import annotations

import argparse
import heapq
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from flexpara.runtime.batch.manifest import Entry, read_entries

BOUNDS = (0, 1_000, 3_000, 10_000, 30_000, 100_000, 300_000, 10**9)
"""Faces at which a line of the table begins."""


@dataclass(frozen=True)
class Cluster:
    """Who works.

    limit: seconds after which an asset is given up.  lost_after: mean hours until a worker is lost.  back: seconds.
    """

    workers: int = 1000
    limit: float | None = None
    lost_after: float = 200.0
    back: float = 120.0
    seed: int = 0


@dataclass(frozen=True)
class Schedule:
    """What came of it, in hours.

    ideal: all work over all workers.  first_idle: when the queue was empty.  end: when the last asset ended.
    """

    ideal: float
    first_idle: float
    end: float
    lost: int
    given_up: int


def measured(paths: Sequence[Path]) -> list[Entry]:
    """Assets that gave an atlas, of several manifests."""
    return [entry for path in paths for entry in read_entries(path).values() if entry.status == "done"]


def by_faces(entries: Sequence[Entry]) -> str:
    """Assets a core hour, seconds and memory, for each span of face counts."""
    lines = [f"{'faces':>20} {'measured':>9} {'median s':>9} {'slowest s':>10} {'a core hour':>12} {'MB at most':>11}"]
    faces = np.array([entry.metrics["faces"] for entry in entries])
    for low, high in pairwise(BOUNDS):
        some = [entry for entry, count in zip(entries, faces, strict=True) if low <= count < high]
        if not some:
            continue
        seconds = np.array([entry.seconds for entry in some])
        span = f"{low} to {high}" if high < BOUNDS[-1] else f"{low} and more"
        numbers = f"{len(some):>9} {np.median(seconds):>9.1f} {seconds.max():>10.1f} {3600 / seconds.mean():>12.0f}"
        lines.append(f"{span:>20} {numbers} {max(entry.memory for entry in some) / 1e6:>11.0f}")
    return "\n".join(lines)


def simulated(seconds: NDArray[np.float64], cluster: Cluster) -> Schedule:
    """One run over assets of these seconds, in the order of the queue."""
    rng = np.random.default_rng(cluster.seed)
    most = np.inf if cluster.limit is None else cluster.limit
    work = np.minimum(seconds, most)
    rate = 1.0 / (3600.0 * cluster.lost_after)
    lost = rng.random(len(work)) < 1.0 - np.exp(-rate * work)
    share = rng.random(len(work))
    free = [0.0] * min(cluster.workers, len(work))
    end = 0.0
    for took, gone, part in zip(work.tolist(), lost.tolist(), share.tolist(), strict=True):
        begin = heapq.heappop(free)
        if gone:  # the asset is tried again by the next that is free
            heapq.heappush(free, begin + part * took + cluster.back)
            begin = max(heapq.heappop(free), begin + part * took)
        heapq.heappush(free, begin + took)
        end = max(end, begin + took)
    given_up = int((seconds > most).sum())
    return Schedule(work.sum() / cluster.workers / 3600, min(free) / 3600, end / 3600, int(lost.sum()), given_up)


def told(name: str, found: Schedule) -> str:
    """A line of the table of schedules."""
    tail = 60 * (found.end - found.first_idle)
    numbers = f"{found.ideal:>8.2f} {found.end:>8.2f} {found.ideal / found.end:>7.1%} {tail:>9.1f}"
    return f"{name:<34} {numbers} {found.lost:>6} {found.given_up:>9}"


def main(words: Sequence[str] | None = None) -> int:
    """Both tables."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.cost", description=__doc__)
    parser.add_argument("manifests", nargs="+", type=Path)
    parser.add_argument("--assets", type=int, default=1_000_000)
    parser.add_argument("--workers", type=int, default=1000)
    parser.add_argument("--limit", type=float, default=120.0, help="seconds an asset may take")
    asked = parser.parse_args(words)
    entries = measured(asked.manifests)
    if not entries:
        parser.error("no asset is done in these manifests")
    seconds = np.array([entry.seconds for entry in entries])
    drawn = np.random.default_rng(0).choice(seconds, asked.assets)
    slow = drawn * np.where(np.random.default_rng(1).random(asked.assets) < 0.001, 50.0, 1.0)
    print(by_faces(entries))
    print(f"\n{asked.assets} assets: {drawn.sum() / 3600:.0f} core hours; {asked.workers} workers, in hours:")
    print(f"{'':<34} {'ideal':>8} {'end':>8} {'in use':>7} {'tail min':>9} {'lost':>6} {'given up':>9}")
    free, limited = Cluster(asked.workers), Cluster(asked.workers, asked.limit)
    print(told("as measured", simulated(drawn, free)))
    print(told("one in 1000 takes 50 times as long", simulated(slow, free)))
    print(told(f"… given up after {asked.limit:g} s", simulated(slow, limited)))
    print(told("… the slowest begun first", simulated(-np.sort(-slow), free)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
