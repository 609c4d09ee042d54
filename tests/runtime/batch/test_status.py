"""How far a batch is, and its page; and the command itself on two real files."""

from __future__ import annotations

import json
from dataclasses import replace
from typing import TYPE_CHECKING

import pytest

from flexpara.__main__ import main
from flexpara.runtime.batch.manifest import Entry, all_entries, append, read_entries
from flexpara.runtime.batch.status import Status, status_of, write_page
from flexpara.runtime.errors import MissingFileError

if TYPE_CHECKING:
    from pathlib import Path

ENTRY = Entry("a.obj", "done", "content", "asked", "a", metrics={"charts": 3}, elapsed=1.0)


def entry(number: int) -> Entry:
    metrics = {"charts": 1, "symmetric_dirichlet_mean": 1.0 + 0.01 * number}
    return replace(ENTRY, asset=f"{number}.obj", seconds=20.0 - number, elapsed=36.0 * number, metrics=metrics)


def test_rate_and_time_left_follow_from_what_ended() -> None:
    status = Status(30, [entry(number) for number in range(1, 11)])
    assert status.rate == pytest.approx(100.0)
    lines = status.lines()
    assert lines[:4] == ["assets    30", "done      10", "failed    0", "left      20"]
    assert "time left 0.20 h" in lines


def test_the_worst_come_first() -> None:
    status = Status(30, [entry(number) for number in range(1, 15)])
    assert [found.asset for found in status.worst("symmetric_dirichlet_mean")][:2] == ["14.obj", "13.obj"]
    assert [found.asset for found in status.worst("seconds")][:2] == ["1.obj", "2.obj"]
    assert len(status.worst("seconds")) == 10


def test_the_page_names_all_and_trusts_no_name(tmp_path: Path) -> None:
    evil = replace(ENTRY, asset="<script>.obj", status="failed", error="<b>")
    page = write_page(tmp_path, Status(2, [entry(1), evil])).read_text(encoding="utf-8")
    assert "1 of 2 done" in page
    assert '<a href="a/">1.obj</a>' in page
    assert "&lt;script&gt;.obj" in page
    assert "<b>" not in page
    assert "http" not in page


def test_what_is_no_asset_any_more_does_not_count(tmp_path: Path) -> None:
    (tmp_path / "batch.json").write_text('{"assets": 2, "names": ["a.obj", "b.obj"]}', encoding="utf-8")
    for name in ("a.obj", "gone.obj"):
        append(tmp_path / "manifest.jsonl", replace(ENTRY, asset=name))
    status = status_of(tmp_path)
    assert status.lines()[:4] == ["assets    2", "done      1", "failed    0", "left      1"]


def test_what_shards_have_done_is_done_for_all_and_counts_once(tmp_path: Path) -> None:
    for part, names in (("", ["a.obj", "b.obj"]), ("1-of-2", ["a.obj"])):
        plan = {"assets": len(names), "names": names}
        (tmp_path / f"{part}batch.json").write_text(json.dumps(plan), encoding="utf-8")
    append(tmp_path / "manifest-1-of-2.jsonl", ENTRY)
    append(tmp_path / "manifest.jsonl", replace(ENTRY, asset="b.obj", status="failed"))
    assert status_of(tmp_path).lines()[:4] == ["assets    2", "done      1", "failed    1", "left      0"]
    append(tmp_path / "manifest.jsonl", replace(ENTRY, content="own"))
    assert all_entries(tmp_path, tmp_path / "manifest.jsonl")["a.obj"].content == "own"


def test_shards_are_counted_together(tmp_path: Path) -> None:
    for part, total in (("1-of-2", 4), ("2-of-2", 3)):
        (tmp_path / f"{part}batch.json").write_text(json.dumps({"assets": total}), encoding="utf-8")
        append(tmp_path / f"manifest-{part}.jsonl", replace(ENTRY, asset=part))
    status = status_of(tmp_path)
    assert (status.total, len(status.entries)) == (7, 2)
    with pytest.raises(MissingFileError, match="-o of flexpara batch"):
        status_of(tmp_path / "absent")


def test_a_batch_goes_on_where_it_ended(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assets, output = tmp_path / "assets", tmp_path / "out"
    (assets / "deep").mkdir(parents=True)
    (assets / "quad.obj").write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n", encoding="utf-8")
    (assets / "deep" / "bad.ply").write_text("no mesh", encoding="utf-8")
    words = ["batch", str(assets), "-o", str(output), "--maps", "none"]
    assert main([*words, "--dry-run"]) == 0
    assert capsys.readouterr().out.split() == ["deep/bad.ply", "quad.obj"]
    assert not output.exists()
    assert main(words) == 2
    found = read_entries(output / "manifest.jsonl")
    assert {name: each.status for name, each in found.items()} == {"quad.obj": "done", "deep/bad.ply": "failed"}
    assert "no PLY header" in found["deep/bad.ply"].error
    assert found["quad.obj"].metrics["charts"] == 1
    assert set(found["quad.obj"].files) == {f"quad.{ending}" for ending in ("glb", "onnx", "report.json")}
    assert (output / "index.html").is_file()
    before = (output / "quad" / "quad.onnx").stat().st_mtime_ns
    assert main(words) == 2
    assert (output / "quad" / "quad.onnx").stat().st_mtime_ns == before
    assert "0 of 2 assets are left to do" in capsys.readouterr().err
    assert main(["batch", "--status", str(output)]) == 0
    assert "failed    1" in capsys.readouterr().out
