"""The benchmarks of a batch: resumable, and sums that can be checked by hand."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest

from benchmarks import cost, soak, throughput
from flexpara.runtime.batch.manifest import Entry

if TYPE_CHECKING:
    from pathlib import Path


def entry(name: str, seconds: float, faces: int = 500) -> Entry:
    return Entry(name, "done", "", "", "a", seconds=seconds, memory=10**8, metrics={"faces": faces})


def test_equal_assets_fill_all_workers() -> None:
    found = cost.simulated(np.full(100, 36.0), cost.Cluster(workers=10, lost_after=1e9))
    assert found.end == pytest.approx(0.1)
    assert found.ideal == pytest.approx(0.1)


def test_a_straggler_at_the_end_is_waited_for_and_a_limit_ends_it() -> None:
    seconds = np.array([36.0] * 99 + [3600.0])
    free = cost.simulated(seconds, cost.Cluster(workers=10, lost_after=1e9))
    limited = cost.simulated(seconds, cost.Cluster(workers=10, limit=36.0, lost_after=1e9))
    assert free.end == pytest.approx(1.09)
    assert limited.end == pytest.approx(0.1)
    assert limited.given_up == 1


def test_lost_workers_cost_time_and_no_asset() -> None:
    calm = cost.simulated(np.full(1000, 36.0), cost.Cluster(workers=10, lost_after=1e9))
    rough = cost.simulated(np.full(1000, 36.0), cost.Cluster(workers=10, lost_after=0.5))
    assert rough.lost > 0
    assert rough.end > calm.end


def test_rates_are_told_by_faces() -> None:
    lines = cost.by_faces([entry("a", 10.0), entry("b", 30.0), entry("c", 100.0, 5000)]).splitlines()
    assert [line.split()[-2] for line in lines[1:]] == ["180", "36"]


def test_a_loop_goes_on_where_it_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "loop.jsonl").write_text(json.dumps({"mesh": "a.obj", "seconds": 8.0, "code": 0}) + "\n")
    ran: list[str] = []

    def pretended(words: list[str], **_: object) -> object:
        ran.append(words[4])
        return type("Ended", (), {"returncode": 0})

    monkeypatch.setattr(throughput.subprocess, "run", pretended)
    found = throughput.run_loop([tmp_path / "a.obj", tmp_path / "b.obj"], tmp_path)
    assert ran == [str(tmp_path / "b.obj")]
    assert found["a.obj"] == (8.0, 0)
    again = throughput.run_loop([tmp_path / "a.obj", tmp_path / "b.obj"], tmp_path)
    assert again.keys() == found.keys()
    assert len(ran) == 1


def test_the_ratio_of_rates_is_printed() -> None:
    text = throughput.table(
        {"a.obj": (8.0, 0), "b.obj": (2.0, 2)}, 4.0, {"a.obj": entry("a", 3.0), "b.obj": entry("b", 1.0)}
    )
    assert text.splitlines()[-1] == "loop 10.0 s, batch 4.0 s: 2.50 times the rate"
    assert "1 refused" in text


def test_growth_is_seen() -> None:
    flat = [soak.Reading("unwrap", number, 100_000_000 + number, 9, 0) for number in range(100)]
    assert soak.verdict(flat)[1]
    leaking = [soak.Reading("unwrap", number, 100_000_000 + number * 10**6, 9, 0) for number in range(100)]
    assert not soak.verdict(leaking)[1]
    handles = [soak.Reading("unwrap", number, 10**8, 9 + number, 0) for number in range(100)]
    assert not soak.verdict(handles)[1]


def test_objects_of_opengl_that_nobody_released_are_counted() -> None:
    context_of = pytest.importorskip("flexpara.bake.raster.context")
    with context_of.open_context() as context:
        for _ in range(2000):  # Mesa never gives the name of a buffer twice
            context.buffer(b"four").release()
    before = soak.opengl_objects()
    assert before > 0
    with context_of.open_context() as context:
        context.buffer(b"four")  # forgotten, not released
    assert soak.opengl_objects() == before + 1
    context_of.release_idle()
