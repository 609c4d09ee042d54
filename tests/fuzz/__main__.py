"""Damaged files for every reader: `python -m tests.fuzz --seconds 60`.

Each case must be read, or refused by a FlexparaError, within five seconds and a gigabyte, touching nothing outside its
folder.  Anything else is a finding: its file is kept, with the numbers that make it again.
"""

from __future__ import annotations

import argparse
import multiprocessing
import pickle
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from .controls import CONTROLS
from .readers import READERS
from .worker import Case, Limits, serve

PATIENCE = 90.0
"""Seconds on the clock after which a worker that uses no processor time counts as hanging."""
SPAWN = multiprocessing.get_context("spawn")


@dataclass
class Tally:
    """What came of the cases.  counts: (reader, outcome) → number.  slowest: seconds of each reader's slowest case."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)
    seconds: dict[str, float] = field(default_factory=dict)
    slowest: dict[str, float] = field(default_factory=dict)


class Worker:
    """A process that reads cases; replaced when one ends it."""

    def __init__(self, root: Path, seeds: Mapping[str, list[bytes]], limits: Limits) -> None:
        self.pipe, theirs = SPAWN.Pipe()
        self.process = SPAWN.Process(target=serve, args=(theirs, root, seeds, limits), daemon=True)
        self.process.start()
        theirs.close()

    def outcome(self, case: Case) -> str:
        """What came of a case: "read", "refused", or what went wrong."""
        self.pipe.send(case)
        if not self.pipe.poll(PATIENCE):
            self.process.kill()
            return f"no answer within {PATIENCE:g} seconds"
        try:
            return self.pipe.recv()
        except EOFError:
            self.process.join()
            return f"the process ended with {self.process.exitcode} (-27: out of time)"

    def alive(self) -> bool:
        """Whether it can take a case."""
        return self.process.is_alive()

    def close(self) -> None:
        """End it."""
        if self.alive():
            self.pipe.send(None)
        self.process.join(10)
        self.process.kill()


def fuzz(asked: argparse.Namespace, seeds: Mapping[str, list[bytes]], place: Path) -> Tally:
    """Cases of all readers in turn until files or seconds are used up."""
    tally, limits, number = Tally(), Limits(), asked.first
    end, worker = time.monotonic() + asked.seconds, Worker(place / "root", seeds, Limits())
    while time.monotonic() < end and sum(tally.counts.values()) < asked.files:
        for name in asked.reader:
            if not worker.alive():
                worker = Worker(place / "root", seeds, limits)
            case, start = Case(name, number, asked.seed), time.monotonic()
            said = worker.outcome(case)
            took = time.monotonic() - start
            tally.seconds[name] = tally.seconds.get(name, 0.0) + took
            tally.slowest[name] = max(took, tally.slowest.get(name, 0.0))
            outcome = said if said in ("read", "refused") else "finding"
            tally.counts[name, outcome] += 1
            if outcome == "finding":
                keep(case, said, seeds, asked.keep)
        number += 1
    worker.close()
    return tally


def keep(case: Case, said: str, seeds: Mapping[str, list[bytes]], folder: Path) -> None:
    """The damaged bytes of a finding, and what it said beside them."""
    folder.mkdir(parents=True, exist_ok=True)
    stem = f"{case.reader}-{case.seed}-{case.number}"
    (folder / stem).write_bytes(case.data(seeds))
    (folder / f"{stem}.txt").write_text(f"{case}\n{said}\n", encoding="utf-8", errors="replace")
    sys.stderr.write(f"{case}: {said.strip().splitlines()[-1][:300]}\n")


def table(tally: Tally) -> str:
    """A line for each reader."""
    lines = [f"{'reader':<10}{'files':>8}{'read':>8}{'refused':>9}{'findings':>10}{'seconds':>9}{'slowest':>9}"]
    for name in tally.seconds:
        count = [tally.counts[name, outcome] for outcome in ("read", "refused", "finding")]
        numbers = f"{sum(count):>8}{count[0]:>8}{count[1]:>9}{count[2]:>10}"
        lines.append(f"{name:<10}{numbers}{tally.seconds[name]:>9.1f}{tally.slowest[name]:>9.2f}")
    lines.append(f"{'all':<10}{sum(tally.counts.values()):>8}")
    return "\n".join(lines)


def arguments(words: Sequence[str] | None = None) -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0, help="on the clock, for all of it")
    parser.add_argument("--files", type=int, default=10**9, help="cases at most")
    parser.add_argument("--seed", type=int, default=0, help="of all that is random")
    parser.add_argument("--first", type=int, default=0, help="number of the first case of each reader")
    parser.add_argument("--reader", action="append", choices=sorted(READERS), help="of these alone; may be repeated")
    parser.add_argument("--control", action="append", choices=sorted(CONTROLS), help="a reader that does wrong")
    parser.add_argument("--keep", type=Path, default=Path("fuzz-findings"), help="the folder for findings")
    parser.add_argument("--seeds", type=Path, help="a file that keeps seeds from one run to the next")
    asked = parser.parse_args(words)
    asked.reader, asked.keep = asked.control or asked.reader or list(READERS), asked.keep.absolute()
    return asked


def seeds_of(path: Path | None) -> dict[str, list[bytes]]:
    """The seeds, from a file of an earlier run where it is there."""
    if path is not None and path.is_file():
        return pickle.loads(path.read_bytes())
    from .seedfiles import all_seeds

    seeds = all_seeds() | {name: [b"a"] for name in CONTROLS}
    if path is not None:
        path.write_bytes(pickle.dumps(seeds))
    return seeds


def main() -> int:
    """1 where something was found."""
    asked = arguments()
    with tempfile.TemporaryDirectory(prefix="flexpara-fuzz-") as place:
        tally = fuzz(asked, seeds_of(asked.seeds), Path(place).resolve())
    sys.stdout.write(table(tally) + "\n")
    return int(any(outcome == "finding" for _, outcome in tally.counts))


if __name__ == "__main__":
    sys.exit(main())
