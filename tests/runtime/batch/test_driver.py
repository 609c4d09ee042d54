"""Jobs and workers: results, limits, deaths and interrupts, with work that takes no time."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

from flexpara.runtime.batch.crew import LocalCrew, shares_of_cores
from flexpara.runtime.batch.driver import Driver, interrupts
from flexpara.runtime.batch.jobs import Job, find_jobs
from flexpara.runtime.batch.lock import locked
from flexpara.runtime.batch.manifest import Entry, left_to_do, read_entries
from flexpara.runtime.batch.pool import Limits
from flexpara.runtime.errors import InputError
from flexpara.runtime.options.unwrap import Options, Outputs

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="workers are watched by way of /proc")

NO_LIMITS = Limits()
WORKS = """
import json, os, signal, time
from flexpara.runtime.process.deadline import Deadline, interrupts_ask
from flexpara.runtime.errors import DiskFullError, InputError

def write(run):
    run.output.mkdir(parents=True, exist_ok=True)
    report = {"metrics": {"charts": 2}, "network": {}, "source": {"faces": 7}, "seconds": {"charts": 0.5}, "train": {}}
    (run.output / f"{run.mesh.stem}.report.json").write_text(json.dumps(report))

def by_name(run):
    name = run.mesh.stem
    if name.startswith("die"):
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("once") and not (run.output / "tried").exists():
        run.output.mkdir(parents=True)
        (run.output / "tried").write_text("")
        (run.output / ".flexpara-left").mkdir()
        os.kill(os.getpid(), signal.SIGKILL)
    if name.startswith("slow"):
        time.sleep(60)
    if name.startswith("large"):
        keep = b"x" * 400_000_000
        time.sleep(60)
    if name.startswith("patient"):
        keep = b"x" * (400_000_000 if name == "patient-large" else 1)
        time.sleep(2.0)  # it is asked before it listens
        deadline = Deadline()
        with interrupts_ask(deadline, lambda _line: None):
            while not deadline.passed():
                time.sleep(0.02)
    if name.startswith("refused"):
        raise InputError("value, expected another; correct it")
    if name.startswith("full"):
        raise DiskFullError("the disk is full, expected room; free some")
    if name.startswith("changes"):
        run.mesh.write_text("# later")
    if name.startswith("defect"):
        raise ValueError("oh")
    print("noise on stdout")
    write(run)
"""


@pytest.fixture
def works(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    (tmp_path / "works.py").write_text(WORKS, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}{os.pathsep}{os.environ.get('PYTHONPATH', '')}")
    return "works:by_name"


def jobs_in(folder: Path, *names: str) -> list[Job]:
    meshes = folder / "assets"
    meshes.mkdir()
    for name in names:
        (meshes / f"{name}.obj").write_text("", encoding="utf-8")
    return find_jobs([meshes], folder / "out", Options(), Outputs())


def worked(jobs: list[Job], folder: Path, works: str, limits: Limits = NO_LIMITS) -> dict[str, Entry]:
    (folder / "out").mkdir(exist_ok=True)
    manifest = folder / "out" / "manifest.jsonl"
    crew = LocalCrew(works, [[0], [0]], limits)
    assert Driver(manifest, "1", limits, lambda _entry: None).run(jobs, crew)
    return read_entries(manifest)


def test_each_job_ends_with_its_entry(tmp_path: Path, works: str) -> None:
    found = worked(jobs_in(tmp_path, "a", "b", "c", "refused", "defect"), tmp_path, works)
    assert {name: entry.status for name, entry in found.items()} == {
        "a.obj": "done",
        "b.obj": "done",
        "c.obj": "done",
        "refused.obj": "failed",
        "defect.obj": "failed",
    }
    assert found["a.obj"].metrics == {**found["b.obj"].metrics, "charts": 2, "faces": 7}
    assert list(found["a.obj"].files) == ["a.report.json"]
    assert found["refused.obj"].error == "value, expected another; correct it"
    assert found["defect.obj"].error.startswith("ValueError: oh (works.py:")


def test_what_may_pass_or_changes_meanwhile_is_done_again(tmp_path: Path, works: str) -> None:
    jobs = jobs_in(tmp_path, "changes", "full", "refused", "z")
    found = worked(jobs, tmp_path, works)
    assert found["full.obj"].again
    assert not found["refused.obj"].again
    assert [job.name for job in left_to_do(jobs, found, "1", retry=False)] == ["changes.obj", "full.obj"]


def test_a_worker_that_dies_is_replaced_and_its_job_tried_again(tmp_path: Path, works: str) -> None:
    found = worked(jobs_in(tmp_path, "a", "die", "once", "z"), tmp_path, works)
    assert [entry.status for _, entry in sorted(found.items())] == ["done", "failed", "done", "done"]
    assert "died 2 times (SIGKILL)" in found["die.obj"].error
    assert found["die.obj"].again
    assert not list((tmp_path / "out").rglob(".flexpara-*"))


@pytest.mark.parametrize(
    ("name", "limits", "said"),
    [
        ("slow", Limits(seconds=1.5), "took more than 1.5 s"),
        ("large", Limits(memory=300_000_000), "took more than 0.3 GB of memory"),
    ],
)
def test_what_takes_too_much_is_given_up_and_the_rest_goes_on(
    name: str, limits: Limits, said: str, tmp_path: Path, works: str
) -> None:
    found = worked(jobs_in(tmp_path, name, "z"), tmp_path, works, limits)
    assert said in found[f"{name}.obj"].error
    assert found["z.obj"].status == "done"


@pytest.mark.parametrize(
    ("name", "limits"),
    [
        ("patient", Limits(seconds=30.0, hint_seconds=0.05)),
        ("patient-large", Limits(memory=500_000_000, hint_memory=0.7)),
    ],
)
def test_what_comes_near_a_limit_is_asked_for_what_it_has(
    name: str, limits: Limits, tmp_path: Path, works: str
) -> None:
    found = worked(jobs_in(tmp_path, name, "z"), tmp_path, works, limits)
    assert {entry.status for entry in found.values()} == {"done"}
    assert list(found[f"{name}.obj"].files) == [f"{name}.report.json"]


@pytest.mark.parametrize(
    ("interrupts", "grace", "number"),
    [(1, 0.5, signal.SIGINT), (2, 1e9, signal.SIGINT), (1, 0.5, signal.SIGTERM)],
)
def test_interrupts_give_back_what_is_running(
    interrupts: int, grace: float, number: signal.Signals, tmp_path: Path, works: str
) -> None:
    """The first once its grace is over, the second though it is not: who waits for "slow" has it done."""
    limits, jobs = Limits(grace=grace), jobs_in(tmp_path, "a", "slow")
    (tmp_path / "out").mkdir()
    manifest = tmp_path / "out" / "manifest.jsonl"

    def interrupt() -> None:
        while not read_entries(manifest):
            time.sleep(0.05)
        for _ in range(interrupts):
            os.kill(os.getpid(), number)
            time.sleep(0.3)

    before = signal.getsignal(number)
    threading.Thread(target=interrupt, daemon=True).start()
    crew = LocalCrew(works, [[0], [0]], limits)
    whole = Driver(manifest, "1", limits, lambda _entry: None).run(jobs, crew)
    assert not whole
    assert list(read_entries(manifest)) == ["a.obj"]
    assert signal.getsignal(number) is before


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP])
def test_what_is_ignored_stays_ignored(number: signal.Signals) -> None:
    before = signal.signal(number, signal.SIG_IGN)
    try:
        with interrupts() as stop:
            os.kill(os.getpid(), number)
            os.kill(os.getpid(), signal.SIGINT)
        assert stop.count == 1
        assert signal.getsignal(number) is signal.SIG_IGN
    finally:
        signal.signal(number, before)


def test_workers_end_with_their_driver(works: str) -> None:
    script = (
        "import sys, time; from flexpara.runtime.batch.pool import Worker; "
        f"worker = Worker({works!r}, [0]); print(worker.process.pid, flush=True); time.sleep(60)"
    )
    with subprocess.Popen([sys.executable, "-c", script], stdout=subprocess.PIPE, text=True) as driver:
        assert driver.stdout is not None
        number = int(driver.stdout.readline())
        driver.kill()
    limit = time.monotonic() + 10.0
    while alive(number) and time.monotonic() < limit:
        time.sleep(0.05)
    assert not alive(number)


def alive(number: int) -> bool:
    """Whether a process runs; one that ended and is not yet waited for does not."""
    try:
        state = Path(f"/proc/{number}/stat").read_text(encoding="ascii").rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state not in "ZX"


def test_a_folder_has_one_batch_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "out" / ".batch.lock"
    with locked(path), pytest.raises(InputError, match=rf"process {os.getpid()} works on"), locked(path):
        pass
    with locked(path):
        pass


def test_a_folder_that_cannot_be_written_to_is_refused_before_the_work(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(InputError, match="choose another -o"), locked(tmp_path / "file" / ".batch.lock"):
        pass


def test_cores_are_shared_out() -> None:
    cores = sorted(os.sched_getaffinity(0))
    assert shares_of_cores("auto") == [[core] for core in cores]
    assert shares_of_cores("1") == [cores]
    assert len(shares_of_cores(str(3 * len(cores)))) == 3 * len(cores)
