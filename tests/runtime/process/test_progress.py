"""Progress: what a clock passes on and adds up, and where bars are drawn."""

from __future__ import annotations

import io
import sys
import time

import pytest

from flexpara.runtime.process.deadline import Deadline
from flexpara.runtime.process.progress import Clock, Stages, progress_bars


class Terminal(io.StringIO):
    """A stderr that says it is a terminal."""

    def isatty(self) -> bool:
        return True


def test_a_clock_passes_every_call_on() -> None:
    calls: list[tuple[str, int, int, float | None]] = []
    clock = Clock(lambda stage, step, steps, loss=None: calls.append((stage, step, steps, loss)))
    clock("train", 1, 2, 0.5)
    with clock.stage("pack"):
        pass
    assert calls == [("train", 1, 2, 0.5), ("pack", 0, 1, None), ("pack", 1, 1, None)]


def test_time_until_a_call_belongs_to_its_stage() -> None:
    clock = Clock()
    with clock.stage("slow"):
        time.sleep(0.05)
    with clock.stage("quick"):
        pass
    assert clock.seconds["slow"] >= 0.05
    assert clock.seconds["quick"] < clock.seconds["slow"]


@pytest.mark.parametrize(("terminal", "quiet"), [(True, True), (False, False)])
def test_nothing_is_drawn_when_quiet_or_without_a_terminal(
    terminal: bool, quiet: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    stderr = Terminal() if terminal else io.StringIO()
    monkeypatch.setattr(sys, "stderr", stderr)
    with progress_bars(quiet=quiet) as progress:
        assert progress is None
    assert stderr.getvalue() == ""


def test_a_terminal_sees_stage_step_and_loss(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "120")
    monkeypatch.setattr(sys, "stderr", Terminal())
    with progress_bars() as progress:
        assert progress is not None
        progress("train", 3, 400, 0.125)
    drawn = sys.stderr.getvalue()  # pyright: ignore[reportAttributeAccessIssue]
    for word in ("train", "3/400", "0.125"):
        assert word in drawn


def test_stages_end_as_the_next_begins() -> None:
    calls: list[tuple[str, int, int, float | None]] = []
    stage = Stages(lambda stage, step, steps, loss=None: calls.append((stage, step, steps, loss)))
    stage("parts")
    stage("charts")
    assert calls == [("parts", 0, 1, None), ("parts", 1, 1, None), ("charts", 0, 1, None)]
    assert not stage.deadline.passed()


def test_a_clock_is_taken_as_it_is() -> None:
    clock = Clock(deadline=Deadline(5.0))
    assert Clock.of(clock) is clock
    assert Clock.of(None).deadline.seconds is None
