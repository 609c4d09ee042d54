"""The manifest: a line for each asset, what a kill leaves of one, and what is left to do."""

from __future__ import annotations

import json
from dataclasses import asdict, replace
from typing import TYPE_CHECKING

import pytest

from flexpara.runtime.batch.jobs import Job, find_jobs
from flexpara.runtime.batch.manifest import Entry, append, left_to_do, read_entries
from flexpara.runtime.errors import InputError
from flexpara.runtime.options.unwrap import Options, Outputs

if TYPE_CHECKING:
    from pathlib import Path

ENTRY = Entry("a.obj", "done", "content", "asked", "a", seconds=1.5, metrics={"charts": 3}, files={"a.glb": "0"})


def test_the_last_line_of_an_asset_holds(tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    assert read_entries(path) == {}
    later = replace(ENTRY, status="failed", error="ü")
    for entry in (ENTRY, replace(ENTRY, asset="b.obj"), later):
        append(path, entry)
    assert read_entries(path) == {"a.obj": later, "b.obj": replace(ENTRY, asset="b.obj")}


@pytest.mark.parametrize("kept", [1, 40, -1])
def test_a_line_cut_short_by_a_kill_is_read_over_and_overwritten(kept: int, tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    append(path, ENTRY)
    whole = path.read_bytes()
    path.write_bytes(whole + whole[:kept])
    assert read_entries(path) == {"a.obj": ENTRY} or kept == -1
    append(path, replace(ENTRY, asset="b.obj"))
    assert list(read_entries(path)) == ["a.obj", "b.obj"]
    assert path.read_bytes().startswith(whole)


@pytest.mark.parametrize("line", [b"{}", b"[1]", b"\xff", b'{"asset": "x", "other": 1}', b"[" * 50000])
def test_lines_of_others_are_refused(line: bytes, tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    path.write_bytes(line + b"\n")
    append(path, ENTRY)
    with pytest.raises(InputError, match="line 1"):
        read_entries(path)


@pytest.mark.parametrize(
    "change",
    [
        {"seconds": None},
        {"seconds": [1]},
        {"memory": 10**400},
        {"metrics": {"charts": "3"}},
        {"files": {"a.glb": 1}},
        {"folder": "../outside"},
        {"folder": "/etc"},
        {"asset": 3},
        {"asset": "\ud800"},
        {"again": "no"},
    ],
)
def test_values_of_another_kind_are_refused(change: dict[str, object], tmp_path: Path) -> None:
    path = tmp_path / "manifest.jsonl"
    path.write_text(json.dumps({**asdict(ENTRY), **change}) + "\n", encoding="utf-8")
    append(path, ENTRY)
    with pytest.raises(InputError, match="line 1"):
        read_entries(path)


def job_in(folder: Path) -> Job:
    mesh = folder / "a.obj"
    mesh.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    return find_jobs([mesh], folder / "out", Options(), Outputs())[0]


def test_what_is_missing_or_changed_is_left_to_do(tmp_path: Path) -> None:
    job = job_in(tmp_path)
    job.run.output.mkdir(parents=True)
    (job.run.output / "a.glb").write_bytes(b"")
    done = replace(ENTRY, content=job.content(), asked=job.asked("1"))
    assert left_to_do([job], {"a.obj": done}, "1", retry=False) == []
    assert left_to_do([job], {}, "1", retry=False) == [job]
    assert left_to_do([job], {"a.obj": done}, "2", retry=False) == [job]
    assert left_to_do([job], {"a.obj": replace(done, content="other")}, "1", retry=False) == [job]
    failed = replace(done, status="failed", files={})
    assert left_to_do([job], {"a.obj": failed}, "1", retry=False) == []
    assert left_to_do([job], {"a.obj": failed}, "1", retry=True) == [job]
    assert left_to_do([job], {"a.obj": replace(failed, again=True)}, "1", retry=False) == [job]
    (job.run.output / "a.glb").unlink()
    assert left_to_do([job], {"a.obj": done}, "1", retry=False) == [job]
