"""Whatever is killed, and whenever: the same command run again ends with the bytes of a run that nobody disturbed.

Nightly, ``FLEXPARA_KILLS=40 pytest tests/runtime/batch -k killed`` kills 40 workers, 100 drivers, 40 machines of a
cluster and 40 of its drivers (test_cluster.py); a slice of them: ``FLEXPARA_KILLS=10:20``.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from random import Random
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator


def test_each_asset_has_the_bytes_of_a_single_run(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path
) -> None:
    words = ["unwrap", str(meshes / "torus.obj"), "-o", str(tmp_path), "--maps", "none", "--size", "256", "--quiet"]
    subprocess.run([sys.executable, "-m", "flexpara", *words], check=True)
    alone = {f"torus/{name}": value for name, value in runs.content(tmp_path).items()}
    assert alone == {name: value for name, value in undisturbed.items() if name.startswith("torus/")}


def test_an_asset_with_a_high_poly_mesh_has_the_bytes_of_a_single_run_and_one_without_it_fails(
    runs: Any, tmp_path: Path
) -> None:
    (tmp_path / "low").mkdir()
    (tmp_path / "high").mkdir()
    for name in ("low/a.obj", "low/b.obj", "high/a.obj"):
        raised = "0.01" if name.startswith("high") else "0"
        corners = "".join(f"v {x} {y} {raised}\n" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
        (tmp_path / name).write_text(f"{corners}f 1 2 3 4\n", encoding="utf-8")

    def ran(command: str, mesh: str, high: str, output: str) -> subprocess.CompletedProcess[str]:
        words = [command, mesh, "-o", output, "--high", high, "--maps", "height", "--size", "32", "--no-preview"]
        flexpara = [sys.executable, "-m", "flexpara"]
        return subprocess.run([*flexpara, *words, "--quiet"], cwd=tmp_path, capture_output=True, text=True)

    batch = ran("batch", "low", "high", "out")
    assert batch.returncode == 2
    assert f"error: b.obj: {tmp_path}/high holds nothing named like b.obj, expected a file for --high" in batch.stderr
    assert ran("unwrap", "low/a.obj", "high/a.obj", "single").returncode == 0
    found = runs.content(tmp_path / "out" / "a")
    assert {"a.glb", "a_height.exr"} <= set(found)
    assert found == runs.content(tmp_path / "single")


@pytest.mark.skipif(sys.platform != "linux", reason="workers are found in /proc")
def test_a_killed_worker_costs_nothing_but_time(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path, moment: int
) -> None:
    run = runs.begun(meshes, tmp_path)
    while not (workers := runs.workers_of(run.pid)):
        assert run.poll() is None, "the batch ended before a worker was seen"
        time.sleep(0.02)
    time.sleep(Random(moment).uniform(0.0, 1.0))
    os.kill(workers[0], signal.SIGKILL)
    assert runs.ended(run)[0] == 0
    assert runs.content(tmp_path) == undisturbed


def test_a_killed_driver_leaves_what_the_next_run_completes(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path, moment: int
) -> None:
    moments = Random(moment)
    for _ in range(1 + moment % 4):
        run = runs.begun(meshes, tmp_path)
        time.sleep(moments.uniform(0.3, 3.0))
        run.kill()
        runs.ended(run)
    code, said = runs.ended(runs.begun(meshes, tmp_path))
    assert code == 0, said
    assert runs.content(tmp_path) == undisturbed


def test_a_clock_that_is_set_back_changes_nothing(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path
) -> None:
    """The clock of all processes falls by an hour with each look; files seem to come from the future."""
    (tmp_path / "sitecustomize.py").write_text(
        "import time\nlate, fallen = time.time(), []\n"
        "time.time = lambda: (fallen.append(1), late - 3600 * len(fallen))[1]\n",
        encoding="utf-8",
    )
    paths = {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    output = tmp_path / "out"
    code, said = runs.ended(runs.begun(meshes, output, environment=paths))
    assert code == 0, said
    for path in output.rglob("*"):
        os.utime(path, (1, 1))
    code, said = runs.ended(runs.begun(meshes, output, environment=paths))
    assert code == 0
    assert "0 of 3 assets are left" in said
    assert runs.content(output) == undisturbed


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 64 kB, which one result fills."""
    folder = tmp_path / "disk"
    folder.mkdir()
    made = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)], capture_output=True)
    if made.returncode:
        pytest.skip("no disk can be mounted here")
    yield folder
    subprocess.run(["umount", "-l", str(folder)], check=True)


@pytest.mark.skipif(sys.platform != "linux", reason="a disk is mounted")
def test_a_full_disk_leaves_nothing_half_written_and_more_room_completes_it(
    runs: Any, meshes: Path, undisturbed: dict[str, object], small_disk: Path
) -> None:
    code, said = runs.ended(runs.begun(meshes, small_disk))
    assert code == 2, said
    assert "is full" in said
    left = runs.content(small_disk)
    assert left.items() <= undisturbed.items()
    assert len(left) < len(undisturbed)
    subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)
    code, said = runs.ended(runs.begun(meshes, small_disk))
    assert code == 0, said
    assert runs.content(small_disk) == undisturbed


def test_two_batches_on_one_folder_are_one(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path
) -> None:
    first = runs.begun(meshes, tmp_path)
    while not runs.workers_of(first.pid):
        assert first.poll() is None
        time.sleep(0.02)
    code, said = runs.ended(runs.begun(meshes, tmp_path))
    assert code == 2
    assert f"process {first.pid} works on" in said
    assert runs.ended(first)[0] == 0
    assert runs.content(tmp_path) == undisturbed


def test_a_second_ctrl_c_leaves_nothing_half_written(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path
) -> None:
    run = runs.begun(meshes, tmp_path)
    while not runs.workers_of(run.pid):
        assert run.poll() is None
        time.sleep(0.02)
    run.send_signal(signal.SIGINT)
    time.sleep(0.2)
    run.send_signal(signal.SIGINT)
    assert runs.ended(run)[0] == 130
    assert runs.content(tmp_path).items() <= undisturbed.items()


def test_ctrl_c_gives_back_what_runs_and_the_next_run_completes_it(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path
) -> None:
    run = runs.begun(meshes, tmp_path, "--workers", "1")  # two would end all three in the time that they get
    while not (tmp_path / "manifest.jsonl").exists() or not (tmp_path / "manifest.jsonl").stat().st_size:
        time.sleep(0.02)
    run.send_signal(signal.SIGINT)
    assert runs.ended(run)[0] == 130
    code, said = runs.ended(runs.begun(meshes, tmp_path))
    assert code == 0, said
    assert runs.content(tmp_path) == undisturbed
