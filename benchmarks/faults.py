"""Kills at random moments: `python -m benchmarks.faults [--kills N]`.

A batch is killed again and again, now the driver, now a worker, and begun anew each time, until it is done.  Then its
files are compared, byte for byte, with those of a batch that nobody disturbed; hidden files that were left are counted.
Reports hold times, so of them only the parts without are compared.
"""

from __future__ import annotations

import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated

from cyclopts import App, Parameter

from flexpara.runtime.samples import make_sample

SAMPLES = (("cube", 4), ("cone", 12), ("tube", 12), ("sphere", 8))
app = App(help=__doc__)


def make_assets(folder: Path, count: int) -> None:
    """Small meshes, in two folders."""
    for number in range(count):
        name, resolution = SAMPLES[number % len(SAMPLES)]
        vertices, faces = make_sample(name, resolution=resolution)
        path = folder / ("even" if number % 2 == 0 else "odd") / f"{name}{number}.obj"
        path.parent.mkdir(parents=True, exist_ok=True)
        lines = [f"v {x:.9g} {y:.9g} {z:.9g}\n" for x, y, z in ((1.0 + number) * vertices).tolist()]
        path.write_text("".join([*lines, *(f"f {a} {b} {c}\n" for a, b, c in (faces + 1).tolist())]), encoding="utf-8")


def begin(assets: Path, output: Path) -> subprocess.Popen[bytes]:
    """The batch, in a process of its own."""
    words = [sys.executable, "-m", "flexpara", "batch", str(assets), "-o", str(output), "--maps", "none", "--quiet"]
    return subprocess.Popen(words, stderr=subprocess.DEVNULL)


def workers_of(driver: int) -> list[int]:
    """Numbers of the processes that a driver started."""
    path = Path(f"/proc/{driver}/task/{driver}/children")
    try:
        return [int(word) for word in path.read_text(encoding="ascii").split()]
    except OSError:
        return []


def fingerprints(output: Path) -> dict[str, str]:
    """The hash of each file of the assets; of a report, without its times."""
    found = {}
    for path in sorted(output.rglob("*")):
        if path.is_dir() or path.parent == output:
            continue
        data = path.read_bytes()
        if path.name.endswith(".report.json"):
            report = json.loads(data)
            report.pop("seconds")
            data = json.dumps(report, sort_keys=True).encode()
        found[path.relative_to(output).as_posix()] = hashlib.sha256(data).hexdigest()
    return found


def killed(assets: Path, output: Path, kills: int, rng: random.Random) -> dict[str, int]:
    """Kill the batch, and begin it anew whenever its driver is dead or done; how often each was killed."""
    count = {"driver": 0, "worker": 0, "began": 0}
    driver = None
    while count["driver"] + count["worker"] < kills:
        if driver is None or driver.poll() is not None:
            if driver is not None and driver.returncode == 0:  # done: all of it again
                (output / "manifest.jsonl").unlink()
            driver = begin(assets, output)
            count["began"] += 1
        time.sleep(rng.uniform(0.0, 2.5))
        who = "driver" if rng.random() < 0.5 else "worker"
        victims = [driver.pid] if who == "driver" else workers_of(driver.pid)
        if victims and driver.poll() is None:
            try:
                os.kill(rng.choice(victims), signal.SIGKILL)
            except ProcessLookupError:
                continue
            count[who] += 1
            if who == "driver":
                driver.wait()
    if driver is not None:
        driver.wait()
    return count


@app.default
def main(*, kills: int = 200, assets: int = 6, seed: Annotated[int, Parameter(help="Of the moments.")] = 0) -> None:
    """Print what the kills were, whether the bytes are equal, and what was left lying about."""
    with TemporaryDirectory() as folder:
        root = Path(folder)
        make_assets(root / "assets", assets)
        begin(root / "assets", root / "calm").wait()
        count = killed(root / "assets", root / "out", kills, random.Random(seed))
        code = begin(root / "assets", root / "out").wait()
        calm, stormy = fingerprints(root / "calm"), fingerprints(root / "out")
        same = sum(calm[name] == stormy.get(name) for name in calm)
        stray = sorted(set(stormy) - set(calm))
        print(f"{count['driver']} drivers and {count['worker']} workers killed, begun {count['began']} times")
        print(f"last exit code {code}; {same} of {len(calm)} files equal; {len(stray)} stray: {stray}")
        raise SystemExit(int(code != 0 or same < len(calm) or bool(stray)))


if __name__ == "__main__":
    app()
