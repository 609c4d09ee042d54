"""Runs that may be resumed: what is kept, found again, refused, forgotten."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from flexpara.runtime.cli.runfile import Run, find_run
from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.options.unwrap import Options, Outputs

if TYPE_CHECKING:
    from pathlib import Path

PAPER = Options(charts=3, preset="paper", steps=50, ablation=("no-upper",), mode="global")


def run(folder: Path, **parts: Any) -> Run:
    settings: dict[str, Any] = {
        "options": PAPER,
        "outputs": Outputs(maps=("normal",), formats=("glb", "obj")),
        "every": 10,
        **parts,
    }
    return Run(folder / "bunny.obj", folder / "out", **settings)


def test_a_run_comes_back_as_it_was_kept(tmp_path: Path) -> None:
    run(tmp_path).save()
    assert find_run(tmp_path / "out") == run(tmp_path)


def test_a_moved_output_folder_is_the_output_of_the_resumed_run(tmp_path: Path) -> None:
    run(tmp_path).save()
    (tmp_path / "out").rename(tmp_path / "moved")
    assert find_run(tmp_path / "moved").output == tmp_path / "moved"


def test_a_run_that_is_done_leaves_nothing(tmp_path: Path) -> None:
    run(tmp_path).save()
    run(tmp_path).forget()
    assert list((tmp_path / "out").iterdir()) == []


def test_a_run_without_checkpoints_keeps_and_removes_nothing(tmp_path: Path) -> None:
    plain = run(tmp_path, every=None)
    plain.save()
    assert not plain.output.exists()
    run(tmp_path).save()
    plain.forget()
    assert find_run(tmp_path / "out") == run(tmp_path)


@pytest.mark.parametrize("parts", [{"every": 0}, {"options": Options()}])
def test_checkpoints_that_nobody_makes_are_refused(parts: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"checkpoint-every is .*expected"):
        run(tmp_path, **parts)


def test_an_output_without_a_run_is_named(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no run to resume"):
        find_run(tmp_path)


def test_two_runs_in_one_folder_are_refused(tmp_path: Path) -> None:
    run(tmp_path).save()
    Run(tmp_path / "cow.obj", tmp_path / "out", PAPER, Outputs(), 5).save()
    with pytest.raises(InputError, match="holds 2 runs"):
        find_run(tmp_path / "out")


@pytest.mark.parametrize(
    "facts",
    [
        [],
        {},
        {"format": "other"},
        {"mesh": "/elsewhere/cow.obj"},
        {"mesh": 3},
        {"options": {"charts": 0}},
        {"options": {"chart": 1}},
        {"options": 4},
        {"outputs": {"formats": ["fbx"]}},
        {"every": "soon"},
        {"every": 0},
    ],
)
def test_a_damaged_run_is_refused(facts: Any, tmp_path: Path) -> None:
    run(tmp_path).save()
    path = tmp_path / "out" / "bunny.checkpoint" / "run.json"
    before = json.loads(path.read_text(encoding="utf-8"))
    path.write_text(json.dumps({**before, **facts} if facts else facts), encoding="utf-8")
    with pytest.raises(InputError):
        find_run(tmp_path / "out")
