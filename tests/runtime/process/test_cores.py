"""How many things are done at once: the cores of this process, or fewer where the environment says so."""

from __future__ import annotations

import os

import pytest

from flexpara.runtime.process.cores import LIMIT, core_count, own_cores


@pytest.mark.parametrize(("asked", "most"), [("1", 1), ("0", 1), ("100000", 100000), ("", 100000), ("two", 100000)])
def test_the_environment_lowers_the_count(asked: str, most: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LIMIT, asked)
    assert core_count() == min(len(own_cores()), most)


@pytest.mark.skipif(not hasattr(os, "sched_setaffinity"), reason="this system pins no process")
def test_a_pinned_process_counts_its_own_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv(LIMIT, raising=False)
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {min(before)})
    try:
        assert core_count() == 1
    finally:
        os.sched_setaffinity(0, before)
