"""Work shared between forked copies."""

from __future__ import annotations

import os
import time
from pathlib import Path

import numpy as np
import pytest

from flexpara.runtime.errors import FinishError
from flexpara.train import workers
from flexpara.train.workers import Beside, parallel_map


@pytest.fixture(params=[1, 2, 3])
def cores(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(workers, "available_cores", lambda: request.param)
    return request.param


@pytest.mark.usefixtures("cores")
def test_results_come_in_the_order_of_the_items() -> None:
    assert parallel_map(lambda n: n * n, range(50)) == [n * n for n in range(50)]


@pytest.mark.usefixtures("cores")
def test_results_keep_the_order_of_the_items_whatever_is_begun_first() -> None:
    assert parallel_map(lambda n: n * n, range(50), float) == [n * n for n in range(50)]


def test_what_takes_longest_is_begun_first(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "available_cores", lambda: 2)
    begun: list[int] = []
    parallel_map(begun.append, range(50), lambda n: -abs(n - 20))
    assert begun == sorted(begun, key=lambda n: abs(n - 20))
    assert begun


@pytest.mark.usefixtures("cores")
def test_no_items_give_no_results() -> None:
    assert parallel_map(abs, []) == []


@pytest.mark.usefixtures("cores")
def test_large_results_pass_through() -> None:
    found = parallel_map(lambda n: np.full(300_000, n), [1, 2, 3])
    assert [part.sum() for part in found] == [300_000, 600_000, 900_000]


@pytest.mark.usefixtures("cores")
def test_what_the_function_raises_is_raised() -> None:
    with pytest.raises(FinishError, match="seven"):
        parallel_map(seven_fails, range(20))


def test_the_work_is_shared(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "available_cores", lambda: 2)
    assert len(set(parallel_map(slow_process_number, range(6)))) == 2


def test_a_killed_copy_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "available_cores", lambda: 2)
    parent = os.getpid()

    def killed(_: int) -> None:
        time.sleep(0.05)
        if os.getpid() != parent:
            os._exit(1)

    with pytest.raises(FinishError, match="killed"):
        parallel_map(killed, range(6))


@pytest.mark.usefixtures("cores")
def test_no_process_is_left_behind() -> None:
    parallel_map(abs, range(8))
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


@pytest.mark.usefixtures("cores")
def test_no_file_stays_open() -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    parallel_map(abs, range(8))
    assert len(list(Path("/proc/self/fd").iterdir())) == before


@pytest.mark.usefixtures("cores")
def test_work_beside_gives_its_result_once_and_leaves_nothing_behind() -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    work = Beside(lambda: np.arange(300_000))
    assert work.result() is work.result()
    assert work.result().sum() == 44_999_850_000
    assert len(list(Path("/proc/self/fd").iterdir())) == before
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


@pytest.mark.usefixtures("cores")
def test_what_work_beside_raises_is_raised_where_its_result_is_wanted() -> None:
    work = Beside(lambda: seven_fails(7))
    with pytest.raises(FinishError, match="seven"):
        work.result()


def test_work_beside_shares_nothing_and_this_process_goes_on_meanwhile(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workers, "available_cores", lambda: 2)
    work = Beside(lambda: parallel_map(slow_process_number, range(4)))
    here = parallel_map(slow_process_number, range(4))
    (there,) = set(work.result())
    assert there not in here
    assert len(set(here)) == 2


@pytest.mark.usefixtures("cores")
def test_work_that_nobody_asks_for_is_given_up() -> None:
    work = Beside(lambda: time.sleep(60.0))
    work.end()
    del work
    with pytest.raises(ChildProcessError):
        os.waitpid(-1, os.WNOHANG)


def test_a_known_result_needs_no_work() -> None:
    assert Beside.known(3).result() == 3


def seven_fails(n: int) -> int:
    if n == 7:
        raise FinishError("seven found, expected another; choose one")
    return n


def slow_process_number(_: int) -> int:
    time.sleep(0.05)
    return os.getpid()
