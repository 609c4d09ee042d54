"""Whatever is killed, and whenever: the same command run again ends with the bytes of a run that nobody disturbed.

Nightly, 200 kills of each kind: ``FLEXPARA_KILLS=200 pytest tests/runtime/batch/test_faults.py -k killed``; a slice of
them: ``FLEXPARA_KILLS=100:150``.
"""

from __future__ import annotations

import json
import os
import secrets
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Sequence

KEPT = ("manifest.jsonl", "index.html", ".batch.lock")
"""What every run leaves beside its results."""
FIRST, _, LAST = os.environ.get("FLEXPARA_KILLS", "1").rpartition(":")
KILLS = range(int(FIRST or 0), int(LAST))
"""Moments at which a worker, a driver, and a machine is killed; each moment is another."""
KINDS = ("sphere", "bracket", "torus")


@pytest.fixture(scope="module")
def meshes(tmp_path_factory: pytest.TempPathFactory, write_samples: Callable[[Path, Sequence[str]], Path]) -> Path:
    return write_samples(tmp_path_factory.mktemp("meshes"), KINDS)


def begun(meshes: Path, output: Path, *more: str, environment: dict[str, str] | None = None) -> subprocess.Popen[str]:
    """A batch at work."""
    words = ["batch", str(meshes), "-o", str(output), "--maps", "none", "--size", "256", *more]
    command = [sys.executable, "-m", "flexpara", *words]
    environment = {**os.environ, **(environment or {})}
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


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
@pytest.mark.parametrize("seed", KILLS)
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


@pytest.mark.parametrize("seed", KILLS)
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


MACHINE = "FLEXPARA_TEST_MACHINE"
"""Variable that all processes of one machine of a cluster have."""
TOKEN = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}
"""Variables without which nobody gives jobs to a cluster of these tests."""
needs_ray = pytest.mark.skipif(find_spec("ray") is None, reason="Ray is absent (pip install ray)")


@dataclass(frozen=True)
class Machine:
    """What `ray start` started.

    mark: in the environment of its processes; some of Ray's overwrite theirs, but stay in its session.
    """

    mark: bytes
    session: int

    def processes(self) -> list[int]:
        """All that run on it."""
        return [
            number
            for number in process_numbers()
            if self.mark in told_of(number, "environ") or self.session == session_of(number)
        ]

    def works(self) -> bool:
        """Whether it works on a job."""
        return any(b"batch.worker" in told_of(number, "cmdline") for number in self.processes())

    def kill(self) -> None:
        """As when it loses its power."""
        while found := self.processes():
            for number in found:
                with suppress(ProcessLookupError):
                    os.kill(number, signal.SIGKILL)
            time.sleep(0.02)


class Cluster:
    """Machines of a Ray cluster, all of them on this one: what `ray start` starts, each with a core."""

    def __init__(self, folder: str) -> None:
        with socket.socket() as free:
            free.bind(("127.0.0.1", 0))
            port = free.getsockname()[1]
        self.address, self.name = f"127.0.0.1:{port}", Path(folder).name
        self.machines: list[Machine] = []
        self.start("--head", "--port", str(port), "--temp-dir", folder, "--include-dashboard", "false")

    def start(self, *words: str) -> Machine:
        """One more machine."""
        name = f"{self.name}-{len(self.machines)}."
        size = ["--num-cpus", "1", "--object-store-memory", "80000000", "--disable-usage-stats"]
        command = [sys.executable, "-m", "ray.scripts.scripts", "start", *size, *words]
        marked = {**os.environ, **TOKEN, MACHINE: name}
        with subprocess.Popen(
            command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, env=marked, start_new_session=True
        ) as run:
            assert run.wait(120) == 0
        self.machines.append(Machine(f"{MACHINE}={name}".encode(), run.pid))
        return self.machines[-1]


def process_numbers() -> list[int]:
    """All processes of this machine, but those that ended and are not yet waited for."""
    return [int(path.name) for path in Path("/proc").glob("[0-9]*") if told_of(int(path.name), "cmdline")]


def told_of(number: int, what: str) -> bytes:
    """What the system tells of a process; nothing where that has ended."""
    try:
        return Path(f"/proc/{number}/{what}").read_bytes()
    except OSError:
        return b""


def session_of(number: int) -> int:
    """The session of a process; 0 where it has ended."""
    with suppress(ProcessLookupError):
        return os.getsid(number)
    return 0


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    with TemporaryDirectory(prefix="flexpara-ray-", ignore_cleanup_errors=True) as folder:  # short: it holds sockets
        cluster = Cluster(folder)
        yield cluster
        for machine in cluster.machines:
            machine.kill()


@needs_ray
@pytest.mark.xdist_group("ray")
@pytest.mark.skipif(sys.platform != "linux", reason="machines are found in /proc")
@pytest.mark.parametrize("seed", KILLS)
def test_a_killed_machine_costs_nothing_but_time(
    meshes: Path, undisturbed: dict[str, object], cluster: Cluster, tmp_path: Path, seed: int
) -> None:
    machine = cluster.start("--address", cluster.address)
    run = begun(meshes, tmp_path, "--ray", cluster.address, environment=TOKEN)
    while not machine.works():
        assert run.poll() is None, "the batch ended before the machine had a job"
        time.sleep(0.02)
    time.sleep(Random(seed).uniform(0.0, 2.0))
    machine.kill()
    code, said = ended(run)
    assert code == 0, said
    assert content(tmp_path) == undisturbed


def test_a_clock_that_is_set_back_changes_nothing(meshes: Path, undisturbed: dict[str, object], tmp_path: Path) -> None:
    """The clock of all processes falls by an hour with each look; files seem to come from the future."""
    (tmp_path / "sitecustomize.py").write_text(
        "import time\nlate, fallen = time.time(), []\n"
        "time.time = lambda: (fallen.append(1), late - 3600 * len(fallen))[1]\n",
        encoding="utf-8",
    )
    paths = {"PYTHONPATH": os.pathsep.join([str(tmp_path), os.environ.get("PYTHONPATH", "")])}
    output = tmp_path / "out"
    code, said = ended(begun(meshes, output, environment=paths))
    assert code == 0, said
    for path in output.rglob("*"):
        os.utime(path, (1, 1))
    code, said = ended(begun(meshes, output, environment=paths))
    assert code == 0
    assert "0 of 3 assets are left" in said
    assert content(output) == undisturbed


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
    meshes: Path, undisturbed: dict[str, object], small_disk: Path
) -> None:
    code, said = ended(begun(meshes, small_disk))
    assert code == 2, said
    assert "is full" in said
    left = content(small_disk)
    assert left.items() <= undisturbed.items()
    assert len(left) < len(undisturbed)
    subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)
    code, said = ended(begun(meshes, small_disk))
    assert code == 0, said
    assert content(small_disk) == undisturbed


def test_two_batches_on_one_folder_are_one(meshes: Path, undisturbed: dict[str, object], tmp_path: Path) -> None:
    first = begun(meshes, tmp_path)
    while not workers_of(first.pid):
        assert first.poll() is None
        time.sleep(0.02)
    code, said = ended(begun(meshes, tmp_path))
    assert code == 2
    assert f"process {first.pid} works on" in said
    assert ended(first)[0] == 0
    assert content(tmp_path) == undisturbed


def test_a_second_ctrl_c_ends_at_once(meshes: Path, undisturbed: dict[str, object], tmp_path: Path) -> None:
    run = begun(meshes, tmp_path)
    while not workers_of(run.pid):
        assert run.poll() is None
        time.sleep(0.02)
    run.send_signal(signal.SIGINT)
    time.sleep(0.2)
    run.send_signal(signal.SIGINT)
    asked = time.monotonic()
    assert ended(run)[0] == 130
    assert time.monotonic() - asked < 5.0  # a moment on an idle machine
    assert content(tmp_path).items() <= undisturbed.items()


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
