"""Output: whole files or none, never over a foreign file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from flexpara.runtime.errors import DiskFullError, ForeignFileError, InputError
from flexpara.runtime.files import OutputFolder, replace_file, write_whole


def text(content: str):  # noqa: ANN201
    return lambda path: path.write_text(content, encoding="utf-8")


def run(folder: Path, content: str = "one", *, force: bool = False) -> None:
    with OutputFolder(folder, "bunny", force=force) as output:
        output.check(["bunny.glb"])
        output.write("bunny.glb", text(content))
        output.write_report({"charts": 8})
        output.commit()


def test_files_appear_together_at_commit(tmp_path: Path) -> None:
    folder = tmp_path / "a" / "b"
    with OutputFolder(folder, "bunny") as output:
        output.write("bunny.glb", text("mesh"))
        assert not (folder / "bunny.glb").exists()
        assert output.commit() == (folder / "bunny.glb",)
    assert sorted(path.name for path in folder.iterdir()) == ["bunny.glb"]
    assert (folder / "bunny.glb").read_text() == "mesh"


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt])
def test_an_error_leaves_the_folder_as_it_was(tmp_path: Path, error: type[BaseException]) -> None:
    run(tmp_path)
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    def fail(path: Path) -> None:
        path.write_text("half", encoding="utf-8")
        raise error

    with pytest.raises(error), OutputFolder(tmp_path, "bunny") as output:
        output.write("bunny.glb", fail)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_an_error_takes_the_new_folder_away_again(tmp_path: Path) -> None:
    def fail(path: Path) -> None:
        path.write_text("half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"), OutputFolder(tmp_path / "out", "bunny") as output:
        output.write("bunny.glb", fail)
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_to_is_known_before_the_work() -> None:
    begun = False
    with (
        pytest.raises(InputError, match=r"can't write to /proc/none.*choose another -o"),
        OutputFolder(Path("/proc/none"), "bunny"),
    ):
        begun = True
    assert not begun


def test_folders_that_were_made_on_the_way_go_too(tmp_path: Path) -> None:
    with OutputFolder(tmp_path / "a" / "b" / "c", "bunny"):
        assert (tmp_path / "a" / "b").is_dir()
        assert list((tmp_path / "a" / "b" / "c").iterdir()) == []
    assert list(tmp_path.iterdir()) == []


def test_leaving_without_commit_writes_nothing(tmp_path: Path) -> None:
    with OutputFolder(tmp_path, "bunny") as output:
        output.write("bunny.glb", text("mesh"))
    assert list(tmp_path.iterdir()) == []


def test_a_second_run_replaces_the_files_of_the_first(tmp_path: Path) -> None:
    run(tmp_path, "one")
    run(tmp_path, "two")
    assert (tmp_path / "bunny.glb").read_text() == "two"
    report = json.loads((tmp_path / "bunny.report.json").read_text())
    assert report == {"producer": "flexpara", "charts": 8, "files": ["bunny.glb", "bunny.report.json"]}


def test_a_foreign_file_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "bunny.glb").write_text("mine")
    with OutputFolder(tmp_path, "bunny") as output, pytest.raises(ForeignFileError, match=r"bunny\.glb.*--force"):
        output.check(["bunny.onnx", "bunny.glb"])
    assert (tmp_path / "bunny.glb").read_text() == "mine"


def test_force_replaces_a_foreign_file(tmp_path: Path) -> None:
    (tmp_path / "bunny.glb").write_text("mine")
    run(tmp_path, "two", force=True)
    assert (tmp_path / "bunny.glb").read_text() == "two"


def test_a_foreign_file_that_appears_meanwhile_is_kept(tmp_path: Path) -> None:
    with OutputFolder(tmp_path, "bunny") as output:
        output.write("bunny.glb", text("two"))
        (tmp_path / "bunny.glb").write_text("mine")
        with pytest.raises(ForeignFileError):
            output.commit()
    assert (tmp_path / "bunny.glb").read_text() == "mine"


def test_files_that_a_writer_adds_are_checked_and_taken_too(tmp_path: Path) -> None:
    def writer(path: Path) -> None:
        path.write_text("mtllib bunny.mtl")
        path.with_suffix(".mtl").write_text("newmtl atlas")

    with OutputFolder(tmp_path, "bunny") as output:
        output.write("bunny.obj", writer)
        output.write_report({})
        output.commit()
    assert json.loads((tmp_path / "bunny.report.json").read_text())["files"] == [
        "bunny.mtl",
        "bunny.obj",
        "bunny.report.json",
    ]
    (tmp_path / "dog.mtl").write_text("mine")
    with OutputFolder(tmp_path, "dog") as output, pytest.raises(ForeignFileError, match=r"dog\.mtl"):
        output.write("dog.obj", writer)


def test_files_of_an_earlier_run_stay_ours(tmp_path: Path) -> None:
    run(tmp_path)
    with OutputFolder(tmp_path, "bunny") as output:
        output.write("bunny.onnx", text("graph"))
        output.write_report({})
        output.commit()
    run(tmp_path, "three")
    assert (tmp_path / "bunny.glb").read_text() == "three"


def test_two_reports_of_one_stem_own_their_files_together(tmp_path: Path) -> None:
    run(tmp_path)
    with OutputFolder(tmp_path, "bunny", report="bunny.bake.json") as output:
        output.write("bunny.glb", text("baked"))
        output.write_report({})
        output.commit()
    assert (tmp_path / "bunny.glb").read_text() == "baked"
    assert (tmp_path / "bunny.report.json").exists()


@pytest.mark.parametrize(
    "content",
    ["{not json", "[]", '{"files": ["bunny.glb"]}', '{"producer": "other", "files": ["bunny.glb"]}', "[" * 100_000],
)
def test_a_report_of_someone_else_owns_nothing(tmp_path: Path, content: str) -> None:
    (tmp_path / "bunny.glb").write_text("mine")
    (tmp_path / "bunny.report.json").write_text(content)
    with OutputFolder(tmp_path, "bunny") as output, pytest.raises(ForeignFileError):
        output.check(["bunny.glb"])


def test_a_report_owns_no_file_outside_its_folder(tmp_path: Path) -> None:
    (tmp_path / "precious").write_text("mine")
    folder = tmp_path / "out"
    folder.mkdir()
    (folder / "bunny.report.json").write_text('{"producer": "flexpara", "files": ["../precious"]}')
    with OutputFolder(folder, "bunny") as output, pytest.raises(InputError, match="plain file name"):
        output.write("../precious", text("two"))
    assert (tmp_path / "precious").read_text() == "mine"


@pytest.mark.parametrize("force", [False, True])
def test_the_input_file_is_never_overwritten(tmp_path: Path, force: bool) -> None:
    source = tmp_path / "bunny.obj"
    source.write_text("v 0 0 0")
    with (
        OutputFolder(tmp_path, "bunny", force=force, source=source) as output,
        pytest.raises(ForeignFileError, match="input"),
    ):
        output.write("bunny.obj", text("two"))
    assert source.read_text() == "v 0 0 0"


def test_a_folder_that_is_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with pytest.raises(InputError, match="is a file, expected a folder"):
        OutputFolder(tmp_path / "out" / "deeper", "bunny")


def test_a_folder_in_the_place_of_a_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "bunny.glb").mkdir()
    with OutputFolder(tmp_path, "bunny", force=True) as output, pytest.raises(InputError, match="is a folder"):
        output.check(["bunny.glb"])


def test_a_name_that_leaves_no_room_for_those_of_results_is_refused(tmp_path: Path) -> None:
    OutputFolder(tmp_path, "ü" * 110)
    with pytest.raises(InputError, match=r"has a name of 222 bytes, expected at most 220, .*; rename the input"):
        OutputFolder(tmp_path, "ü" * 111)


@pytest.mark.parametrize("name", ["", ".hidden", "a/b", "..", "a\nb", "a\\b"])
def test_only_plain_names_are_written(tmp_path: Path, name: str) -> None:
    with OutputFolder(tmp_path, "bunny") as output, pytest.raises(InputError, match="plain file name"):
        output.check([name])


def test_a_single_file_is_replaced_only_with_force(tmp_path: Path) -> None:
    path = tmp_path / "uv.npz"
    assert write_whole(path, text("one")) == path
    with pytest.raises(ForeignFileError):
        write_whole(path, text("two"))
    assert path.read_text() == "one"
    write_whole(path, text("two"), force=True)
    assert path.read_text() == "two"


def test_a_file_of_ours_is_replaced_whole_or_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "a.json"
    replace_file(path, b"one")
    replace_file(path, b"two")
    assert path.read_bytes() == b"two"

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("flexpara.runtime.files.os.fsync", full)
    with pytest.raises(DiskFullError, match=r"disk of .* is full"):
        replace_file(path, b"three")
    assert path.read_bytes() == b"two"
    assert [entry.name for entry in tmp_path.iterdir()] == ["a.json"]


def test_a_full_disk_is_bad_input_and_leaves_nothing(tmp_path: Path) -> None:
    def full(_: Path) -> None:
        raise OSError(28, "No space left on device")

    with pytest.raises(InputError, match=r"disk of .* is full .*choose another -o"):
        write_whole(tmp_path / "new" / "a.npz", full)
    assert list(tmp_path.iterdir()) == []
