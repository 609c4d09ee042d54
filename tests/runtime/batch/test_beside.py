"""Files that options name for each asset of a batch: by name in a folder, by a pattern, in a list."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from flexpara.__main__ import app, main, unwrap_one
from flexpara.runtime.batch import commands
from flexpara.runtime.batch.beside import ENDINGS_OF, options_of_files
from flexpara.runtime.batch.jobs import Job, find_jobs
from flexpara.runtime.cli.runfile import facts_of, run_of
from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.options.unwrap import Options, Outputs
from flexpara.runtime.options.words import file_fields

if TYPE_CHECKING:
    from pathlib import Path

NOT_TAKEN = {
    "--checkpoint-every": "an asset that was cut short is begun again",
    "--resume": "the same batch goes on by itself",
    "--compare": "a table of one mesh, to choose options by before a batch",
}
"""Options of unwrap and bake that a batch does not take, and why."""


def files(folder: Path, *names: str) -> Path:
    for name in names:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name, encoding="utf-8")
    return folder


def jobs_of(folder: Path, options: Options | None = None, **outputs: Any) -> dict[str, Job]:
    found = find_jobs([folder], folder.parent / "out", options or Options(), Outputs(**outputs))
    return {job.name: job for job in found}


def words(command: str) -> set[str]:
    """The options of a command, as they are typed; the mesh is no option."""
    names = [argument.names for argument in app[command].assemble_argument_collection()]
    return {name for several in names for name in several if name.startswith("--")} - {"--mesh"}


def test_a_batch_takes_each_option_of_unwrap_and_bake() -> None:
    assert (words("unwrap") | words("bake")) - words("batch") == set(NOT_TAKEN)
    assert {"--high", "--cage", "--match-names", "--field", "--udim", "--charts"} <= words("batch")


def test_each_option_that_names_a_file_knows_what_it_is_called_in_a_folder() -> None:
    assert file_fields(Options) | file_fields(Outputs) | {"cage"} == set(ENDINGS_OF)
    assert set(options_of_files(Options())) | set(options_of_files(Outputs())) == set(ENDINGS_OF) - {"cage"}


def test_a_folder_gives_each_asset_the_file_of_its_name(tmp_path: Path) -> None:
    assets = files(tmp_path / "assets", "a.obj", "b/a.obj", "b/c.stl")
    high = files(tmp_path / "high", "a.ply", "b/a.glb", "elsewhere/c.obj", "a.txt")
    found = jobs_of(assets, high=(high,))
    assert found["a.obj"].run.outputs.high == (high / "a.ply",)
    assert found["b/a.obj"].run.outputs.high == (high / "b/a.glb",)
    assert found["b/c.stl"].run.outputs.high == (high / "elsewhere/c.obj",)


def test_low_takes_high_and_its_parts_from_one_folder(tmp_path: Path) -> None:
    names = ("wheel_low.obj", "wheel_high.obj", "wheel_high_bolts.obj", "seat_low.obj", "seat_high.obj")
    assets = files(tmp_path / "assets", *names)
    found = jobs_of(assets, high=(assets,))
    assert list(found) == ["seat_low.obj", "wheel_low.obj"]
    assert found["wheel_low.obj"].run.outputs.high == (assets / "wheel_high.obj", assets / "wheel_high_bolts.obj")


def test_a_folder_of_high_poly_meshes_among_the_assets_holds_none(tmp_path: Path) -> None:
    assets = files(tmp_path / "assets", "a.obj", "high/a.obj", "high/unused.obj")
    said: list[str] = []
    found = find_jobs([assets], tmp_path / "out", Options(), Outputs(high=(assets / "high",)), said.append)
    assert [job.name for job in found] == ["a.obj"]
    assert said == ["2 meshes are there for others, by the options given, and passed over"]


def test_a_pattern_names_the_file_of_each_asset(tmp_path: Path) -> None:
    assets = files(tmp_path / "assets", "x/a.obj", "x/a_hi.obj", "x/[b].obj", "x/[b]_hi.ply")
    found = jobs_of(assets, high=(assets / "x/{stem}_hi.*",), cage=str(assets / "x" / "{stem}_hi.*"))
    assert [job.run.outputs.high for job in found.values()] == [(assets / "x/[b]_hi.ply",), (assets / "x/a_hi.obj",)]
    assert found["x/a.obj"].run.outputs.cage == str(assets / "x/a_hi.obj")


def test_a_file_for_all_stays_and_words_do(tmp_path: Path) -> None:
    assets, high = files(tmp_path / "assets", "a.obj", "b.obj"), files(tmp_path, "high.obj") / "high.obj"
    found = jobs_of(assets, Options(protect=tmp_path.relative_to(tmp_path) / "_weight"), high=(high,), cage="0.1")
    assert {job.run.outputs.high for job in found.values()} == {(high,)}
    assert {(str(job.run.options.protect), job.run.outputs.cage) for job in found.values()} == {("_weight", "0.1")}


@pytest.mark.parametrize(("high", "said"), [("high", "holds nothing named like b.obj"), ("{stem}_hi.obj", "b_hi.obj")])
def test_an_asset_without_its_file_is_named_and_the_others_are_done(high: str, said: str, tmp_path: Path) -> None:
    assets = files(tmp_path / "assets", "a.obj", "b.obj")
    files(tmp_path, "high/a.obj", "a_hi.obj")
    found = jobs_of(assets, high=(tmp_path / high,))
    assert found["a.obj"].problem == ""
    assert said in found["b.obj"].problem
    assert "expected a file for --high" in found["b.obj"].problem
    before = found["b.obj"].asked("1")
    files(tmp_path, "high/b.obj", "b_hi.obj")
    assert jobs_of(assets, high=(tmp_path / high,))["b.obj"].asked("1") != before


def test_two_files_of_one_name_are_refused_for_their_asset(tmp_path: Path) -> None:
    assets, high = files(tmp_path / "assets", "a.obj"), files(tmp_path / "high", "a.obj", "a.glb")
    assert "have one name, expected one for --high" in jobs_of(assets, high=(high,))["a.obj"].problem
    starts = files(tmp_path / "starts", "a_high_x.obj", "a_high_y.obj")
    assert "2 files for --start" in jobs_of(assets, Options(start=starts))["a.obj"].problem


def test_what_is_named_for_all_and_absent_is_refused_at_once(tmp_path: Path) -> None:
    assets = files(tmp_path / "assets", "a.obj")
    with pytest.raises(MissingFileError, match=r"absent is not there, expected a file for --high .*correct the path"):
        jobs_of(assets, high=(tmp_path / "absent",))


def test_files_of_a_line_of_a_list_count_from_its_folder(tmp_path: Path) -> None:
    folder = files(tmp_path / "listed", "a.obj", "fine/a.obj", "cuts/a.txt", "b.obj")
    own = {"high": "fine/a.obj", "cage": 0.1, "match_names": True, "cut": "cuts", "protect": "_weight"}
    lines = [{"file": "a.obj", "options": own}, {"file": "b.obj", "options": {"high": ["{folder}/a.obj"]}}]
    (folder / "list.jsonl").write_text("\n".join(map(json.dumps, lines)), encoding="utf-8")
    a, b = find_jobs([folder / "list.jsonl"], tmp_path / "out", Options(), Outputs())
    assert (a.run.outputs.high, a.run.outputs.cage) == ((folder / "fine/a.obj",), "0.1")
    assert (a.run.options.cut, str(a.run.options.protect)) == (folder / "cuts/a.txt", "_weight")
    assert b.run.outputs.high == (folder / "a.obj",)


def test_a_changed_file_is_another_content(tmp_path: Path) -> None:
    assets, high = files(tmp_path / "assets", "a.obj"), files(tmp_path / "high", "a.obj")
    before = jobs_of(assets, high=(high,))["a.obj"].content()
    assert before not in ("", jobs_of(assets)["a.obj"].content())
    (high / "a.obj").write_text("another", encoding="utf-8")
    assert jobs_of(assets, high=(high,))["a.obj"].content() != before


def test_a_run_with_files_comes_through_json_as_it_was(tmp_path: Path) -> None:
    assets, high = files(tmp_path / "assets", "a.obj"), files(tmp_path / "high", "a.obj", "a.npy")
    run = jobs_of(assets, Options(importance=high, protect=high / "a.npy"), high=(high,))["a.obj"].run
    assert run.options.importance == high / "a.npy"
    assert run_of(json.loads(json.dumps(facts_of(run)))) == run


def test_a_batch_is_as_strict_and_as_forceful_as_asked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf 1 2 2\n", encoding="utf-8")
    given: list[Job] = []

    def worked_off(jobs: list[Job], *_: object) -> bool:
        given.extend(jobs)
        return True

    monkeypatch.setattr(commands, "done_by_crew", worked_off)
    words = ["batch", str(tmp_path / "a.obj"), "-o", str(tmp_path / "out"), "--maps", "none"]
    for more in ((), ("--strict", "--force")):
        assert main([*words, *more]) == 0
    plain, strict = (job.run for job in given)
    assert [(run.strict, run.force) for run in (plain, strict)] == [(False, False), (True, True)]
    assert given[0].asked("1") != given[1].asked("1")
    with pytest.raises(InputError, match="leave --strict out"):
        unwrap_one(strict)
