"""Batches on a Ray cluster of these tests' own: machines that die, a driver that does, interrupts, limits."""

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
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from collections.abc import Iterator

pytestmark = [
    pytest.mark.skipif(find_spec("ray") is None, reason="Ray is absent (pip install ray)"),
    pytest.mark.skipif(sys.platform != "linux", reason="machines are found in /proc"),
    pytest.mark.xdist_group("ray"),
]
MACHINE = "FLEXPARA_TEST_MACHINE"
"""Variable that all processes of one machine of a cluster have."""
TOKEN = {"RAY_AUTH_MODE": "token", "RAY_AUTH_TOKEN": secrets.token_hex(32)}
"""Variables without which nobody gives jobs to a cluster of these tests."""


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


def test_a_killed_machine_costs_nothing_but_time(
    runs: Any, meshes: Path, undisturbed: dict[str, object], cluster: Cluster, tmp_path: Path, moment: int
) -> None:
    machine = cluster.start("--address", cluster.address)
    run = runs.begun(meshes, tmp_path, "--ray", cluster.address, environment=TOKEN)
    while not machine.works():
        assert run.poll() is None, "the batch ended before the machine had a job"
        time.sleep(0.02)
    time.sleep(Random(moment).uniform(0.0, 2.0))
    machine.kill()
    code, said = runs.ended(run)
    assert code == 0, said
    assert runs.content(tmp_path) == undisturbed


@pytest.fixture(scope="module")
def joined(cluster: Cluster) -> Cluster:
    """The cluster with a machine more, which nobody kills."""
    cluster.start("--address", cluster.address)
    return cluster


def at_work(cluster: Cluster, run: subprocess.Popen[str]) -> None:
    """Wait until a machine works on a job of a run."""
    while not any(machine.works() for machine in cluster.machines):
        assert run.poll() is None, "the batch ended before a machine had a job"
        time.sleep(0.02)


@pytest.mark.parametrize("interrupts", [1, 2])
def test_ctrl_c_gives_the_machines_jobs_back_and_the_next_run_completes_them(
    runs: Any, meshes: Path, undisturbed: dict[str, object], joined: Cluster, tmp_path: Path, interrupts: int
) -> None:
    run = runs.begun(meshes, tmp_path, "--ray", joined.address, environment=TOKEN)
    at_work(joined, run)
    for _ in range(interrupts):
        run.send_signal(signal.SIGINT)
        time.sleep(0.2)
    code, said = runs.ended(run)
    assert code == 130, said
    assert runs.content(tmp_path).items() <= undisturbed.items()
    code, said = runs.ended(runs.begun(meshes, tmp_path, "--ray", joined.address, environment=TOKEN))
    assert code == 0, said
    assert runs.content(tmp_path) == undisturbed


def test_a_killed_driver_of_a_cluster_leaves_what_the_next_run_completes(
    runs: Any, meshes: Path, undisturbed: dict[str, object], joined: Cluster, tmp_path: Path, moment: int
) -> None:
    run = runs.begun(meshes, tmp_path, "--ray", joined.address, environment=TOKEN)
    at_work(joined, run)
    time.sleep(Random(moment).uniform(0.0, 2.0))
    run.kill()
    runs.ended(run)
    code, said = runs.ended(runs.begun(meshes, tmp_path, "--ray", joined.address, environment=TOKEN))
    assert code == 0, said
    assert runs.content(tmp_path) == undisturbed


@pytest.mark.parametrize(
    ("limit", "said"),
    [
        (("--per-asset-seconds", "0.3"), "took more than 0.3 s"),
        (("--per-asset-memory", "90MB"), "took more than 0.09 GB"),
    ],
)
def test_what_takes_too_much_on_a_machine_is_given_up_and_a_rerun_without_limit_completes_it(
    runs: Any, meshes: Path, undisturbed: dict[str, object], joined: Cluster, tmp_path: Path, limit: Any, said: str
) -> None:
    ray = ("--ray", joined.address)
    assert runs.ended(runs.begun(meshes, tmp_path, *ray, *limit, environment=TOKEN))[0] == 2
    entries = [json.loads(line) for line in (tmp_path / "manifest.jsonl").read_text(encoding="utf-8").splitlines()]
    assert [entry["status"] for entry in entries] == ["failed"] * 3
    assert all(said in entry["error"] for entry in entries)
    assert set(runs.content(tmp_path)) == {"batch.json"}
    code, told = runs.ended(runs.begun(meshes, tmp_path, *ray, "--retry-failed", environment=TOKEN))
    assert code == 0, told
    assert runs.content(tmp_path) == undisturbed


def test_a_cluster_of_its_own_gives_the_same_bytes_and_is_gone_afterwards(
    runs: Any, meshes: Path, undisturbed: dict[str, object], tmp_path: Path
) -> None:
    mark = {MACHINE: f"{tmp_path.name}-local."}
    code, said = runs.ended(runs.begun(meshes, tmp_path, "--ray", "local", "--workers", "2", environment=mark))
    assert code == 0, said
    assert runs.content(tmp_path) == undisturbed
    machine, limit = Machine(f"{MACHINE}={mark[MACHINE]}".encode(), -1), time.monotonic() + 20.0
    while machine.processes() and time.monotonic() < limit:
        time.sleep(0.1)
    assert machine.processes() == []
