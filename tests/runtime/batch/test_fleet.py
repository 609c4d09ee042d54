"""Ray: what is asked of it, and what is said where it is absent; test_faults.py begins real clusters."""

from __future__ import annotations

import socket
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from flexpara.runtime.batch import fleet
from flexpara.runtime.batch.fleet import Fleet
from flexpara.runtime.batch.jobs import find_jobs
from flexpara.runtime.batch.pool import Limits
from flexpara.runtime.errors import InputError, MissingDependencyError
from flexpara.runtime.options.batch import BatchOptions
from flexpara.runtime.options.unwrap import Options, Outputs


class StandIn:
    """Ray as far as a fleet asks it, on a cluster of so many cores and cards: keeps what it was asked."""

    def __init__(self, **resources: float) -> None:
        self.resources, self.asked = resources, list[dict[str, Any]]()
        self.exceptions = SimpleNamespace(RayError=RuntimeError)

    def init(self, *_: object, **__: object) -> None: ...

    def cluster_resources(self) -> dict[str, float]:
        return self.resources

    def remote(self, _: object) -> Any:
        return SimpleNamespace(options=self.options)

    def options(self, **asked: Any) -> Any:
        self.asked.append(asked)
        return SimpleNamespace(remote=lambda *_: len(self.asked))


def test_absence_is_said_with_its_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(MissingDependencyError, match=r"flexpara\[fleet\]"):
        Fleet("works:by_name", Limits(), "local")


def test_a_head_that_does_not_answer_is_refused_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "ray", StandIn())
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match="nothing listens at"):
        Fleet("works:by_name", Limits(), f"127.0.0.1:{port}")


@pytest.mark.parametrize("word", ["here", "host", "host:port", "", "a b:1"])
def test_what_is_no_address_is_refused(word: str) -> None:
    with pytest.raises(InputError, match="HOST:PORT"):
        BatchOptions(ray=word)


def test_a_cluster_has_as_many_workers_as_it_has() -> None:
    assert BatchOptions(ray="local", workers="3").workers == "3"
    with pytest.raises(InputError, match="expected auto"):
        BatchOptions(ray="head:6379", workers="3")


@pytest.mark.parametrize(("preset", "cards", "asked"), [("fast", 2.0, 0), ("paper", 2.0, 1), ("paper", 0.0, 0)])
def test_training_asks_for_a_card_where_there_is_one(
    preset: Any, cards: float, asked: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    standin = StandIn(CPU=2.0, **({"GPU": cards} if cards else {}))
    monkeypatch.setitem(sys.modules, "ray", standin)
    monkeypatch.setattr(fleet, "own_token", dict)
    for name in fleet.SETTINGS:
        monkeypatch.setenv(name, "0")
    (tmp_path / "a.obj").write_text("", encoding="utf-8")
    (job,) = find_jobs([tmp_path / "a.obj"], tmp_path / "out", Options(preset=preset), Outputs())
    crew = Fleet("works:by_name", Limits(memory=10**9), "local")
    given = 0
    while crew.free():
        crew.start(job)
        given += 1
    assert given == 4
    assert standin.asked[0] == {**standin.asked[0], "num_cpus": 1, "num_gpus": asked, "memory": 10**9}
