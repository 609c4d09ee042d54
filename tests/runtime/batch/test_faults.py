"""Whatever is killed, and whenever: the same command run again ends with the bytes of a run that nobody disturbed.

Nightly, 200 kills: ``FLEXPARA_KILLS=100 pytest tests/runtime/batch/test_faults.py -k killed``.
"""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from random import Random

import pytest

from flexpara.runtime.samples import make_sample

KEPT = ("manifest.jsonl", "index.html", ".batch.lock")
"""What every run leaves beside its results."""
KILLS = int(os.environ.get("FLEXPARA_KILLS", "1"))
"""Moments at which a worker, and a driver, is killed; each moment is another."""
KINDS = ("sphere", "bracket", "torus")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("meshes")
    for kind in KINDS:
        vertices, faces = make_sample(kind, resolution=4)
        lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in faces]
        (folder / f"{kind}.obj").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder


def begun(meshes: Path, output: Path, *more: str) -> subprocess.Popen[str]:
    """A batch at work."""
    words = ["batch", str(meshes), "-o", str(output), "--maps", "none", "--size", "256", *more]
    command = [sys.executable, "-m", "flexpara", *words]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def ended(run: subprocess.Popen[str]) -> tuple[int, str]:
    """Exit code and what it said."""
    _, said = run.communicate(timeout=120)
    return run.returncode, said


def content(output: Path) -> dict[str, object]:
    """All files of an output folder but the ledger, and the page with its times; reports without their seconds."""
    found: dict[str, object] = {}
    for path in sorted(output.rglob("*")):
        name = path.relative_to(output).as_posix()
        if path.is_file() and name not in KEPT:
            found[name] = path.read_bytes()
        if name.endswith("report.json"):
            found[name] = {key: value for key, value in json.loads(path.read_bytes()).items() if key != "seconds"}
    return found


@pytest.fixture(scope="module")
def undisturbed(meshes: Path, tmp_path_factory: pytest.TempPathFactory) -> dict[str, object]:
    output = tmp_path_factory.mktemp("undisturbed")
    code, said = ended(begun(meshes, output))
    assert code == 0, said
    return content(output)


def workers_of(driver: int) -> list[int]:
    """The workers of a driver; none once it has ended."""
    try:
        children = Path(f"/proc/{driver}/task/{driver}/children").read_text(encoding="ascii").split()
    except OSError:
        return []
    return [int(child) for child in children if b"batch.worker" in Path(f"/proc/{child}/cmdline").read_bytes()]


def test_each_asset_has_the_bytes_of_a_single_run(meshes: Path, undisturbed: dict[str, object], tmp_path: Path) -> None:
    words = ["unwrap", str(meshes / "torus.obj"), "-o", str(tmp_path), "--maps", "none", "--size", "256", "--quiet"]
    subprocess.run([sys.executable, "-m", "flexpara", *words], check=True)
    alone = {f"torus/{name}": value for name, value in content(tmp_path).items()}
    assert alone == {name: value for name, value in undisturbed.items() if name.startswith("torus/")}


@pytest.mark.skipif(sys.platform != "linux", reason="workers are found in /proc")
@pytest.mark.parametrize("seed", range(KILLS))
def test_a_killed_worker_costs_nothing_but_time(
    meshes: Path, undisturbed: dict[str, object], tmp_path: Path, seed: int
) -> None:
    run = begun(meshes, tmp_path)
    while not (workers := workers_of(run.pid)):
        assert run.poll() is None, "the batch ended before a worker was seen"
        time.sleep(0.02)
    time.sleep(Random(seed).uniform(0.0, 1.0))
    os.kill(workers[0], signal.SIGKILL)
    assert ended(run)[0] == 0
    assert content(tmp_path) == undisturbed


@pytest.mark.parametrize("seed", range(KILLS))
def test_a_killed_driver_leaves_what_the_next_run_completes(
    meshes: Path, undisturbed: dict[str, object], tmp_path: Path, seed: int
) -> None:
    moments = Random(seed)
    for _ in range(1 + seed % 4):
        run = begun(meshes, tmp_path)
        time.sleep(moments.uniform(0.3, 3.0))
        run.kill()
        ended(run)
    code, said = ended(begun(meshes, tmp_path))
    assert code == 0, said
    assert content(tmp_path) == undisturbed


def test_ctrl_c_gives_back_what_runs_and_the_next_run_completes_it(
    meshes: Path, undisturbed: dict[str, object], tmp_path: Path
) -> None:
    run = begun(meshes, tmp_path)
    while not (tmp_path / "manifest.jsonl").exists() or not (tmp_path / "manifest.jsonl").stat().st_size:
        time.sleep(0.02)
    time.sleep(0.3)
    run.send_signal(signal.SIGINT)
    asked = time.monotonic()
    code, _ = ended(run)
    assert code == 130
    assert time.monotonic() - asked < 10.0  # two seconds on an idle machine
    code, said = ended(begun(meshes, tmp_path))
    assert code == 0, said
    assert content(tmp_path) == undisturbed
