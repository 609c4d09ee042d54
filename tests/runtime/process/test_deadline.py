"""Deadlines: budgets and requests, seen by forked copies too, and what Ctrl-C does within."""

from __future__ import annotations

import os
import signal
import threading

import pytest

from flexpara.runtime.process.deadline import Deadline, interrupts_ask, never


def test_without_a_budget_it_never_passes_by_itself() -> None:
    assert not Deadline().passed(reserve=1e9)
    assert not never()


def test_a_budget_passes_when_less_than_the_reserve_is_left() -> None:
    deadline = Deadline(1000.0)
    assert not deadline.passed()
    assert deadline.passed(reserve=1001.0)
    assert not deadline.asked


def test_who_asks_need_not_wait() -> None:
    deadline = Deadline(1000.0)
    deadline.ask()
    assert deadline.asked
    assert deadline.passed()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes can't be forked here")
def test_a_copy_of_the_process_sees_the_request() -> None:
    deadline = Deadline()
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.read(reading, 1)
        os._exit(0 if deadline.asked else 1)
    deadline.ask()
    os.write(writing, b"x")
    assert os.waitpid(child, 0)[1] == 0
    os.close(reading)
    os.close(writing)


def test_the_first_interrupt_asks_and_says_so_and_the_second_interrupts() -> None:
    deadline, told, before = Deadline(), list[str](), signal.getsignal(signal.SIGINT)
    with interrupts_ask(deadline, told.append):
        signal.raise_signal(signal.SIGINT)
        assert deadline.asked
        assert len(told) == 1
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is before


def test_other_threads_leave_signals_alone() -> None:
    before = signal.getsignal(signal.SIGINT)
    seen = []

    def work() -> None:
        with interrupts_ask(Deadline(), print):
            seen.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert seen == [before]


def test_a_request_spends_no_budget() -> None:
    deadline = Deadline(1000.0)
    deadline.ask()
    assert deadline.passed()
    assert not deadline.is_spent()
    assert deadline.is_spent(reserve=1001.0)
