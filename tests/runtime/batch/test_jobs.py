"""The assets of a batch: found in folders, listed in files, shared between machines."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

from flexpara.runtime.batch.jobs import Job, find_jobs, shard
from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.options.unwrap import Options, Outputs

TRIANGLE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


def mesh(path: Path) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(TRIANGLE, encoding="utf-8")
    return path


def jobs_of(*assets: Path) -> list[Job]:
    return find_jobs(assets, Path("/out"), Options(), Outputs())


def test_folders_are_searched_to_the_bottom_and_each_asset_has_a_folder_of_its_own(tmp_path: Path) -> None:
    for name in ("b.obj", "deep/a.obj", "deep/notes.txt"):
        mesh(tmp_path / name)
    found = jobs_of(tmp_path)
    assert [job.name for job in found] == ["b.obj", "deep/a.obj"]
    assert [job.run.output for job in found] == [Path("/out/b"), Path("/out/deep/a")]


def test_two_files_of_one_stem_keep_their_endings(tmp_path: Path) -> None:
    for name in ("a.obj", "a.off"):
        mesh(tmp_path / name)
    assert [job.run.output for job in jobs_of(tmp_path)] == [Path("/out/a.obj"), Path("/out/a.off")]


def test_a_list_gives_options_to_single_files(tmp_path: Path) -> None:
    lines = [{"file": "x/a.obj", "options": {"charts": 3, "maps": "ao"}}, {"file": "b.obj"}]
    listed = tmp_path / "assets.jsonl"
    listed.write_text("\n".join(json.dumps(line) for line in lines), encoding="utf-8")
    second, first = jobs_of(listed)
    assert (first.name, first.run.mesh) == ("x/a.obj", tmp_path / "x/a.obj")
    assert (first.run.options.charts, first.run.outputs.maps) == (3, ("ao",))
    assert (second.run.options, second.run.outputs) == (Options(), Outputs())


def test_a_list_cannot_name_an_output_outside(tmp_path: Path) -> None:
    listed = tmp_path / "assets.jsonl"
    listed.write_text('{"file": "../../etc/a.obj"}\n{"file": "/etc/b.obj"}', encoding="utf-8")
    assert {job.run.output for job in jobs_of(listed)} == {Path("/out/a"), Path("/out/b")}


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{", "no JSON"),
        ("[]", "names no file"),
        ('{"file": 3}', "names no file"),
        ('{"file": "a.obj", "options": 3}', "no object"),
        ('{"file": "a.obj", "options": {"chart": 3}}', "pass charts"),
        ('{"file": "a.obj", "options": {"charts": 0}}', "expected 1 or more"),
        ("[" * 50000, "no JSON"),
    ],
)
def test_a_damaged_list_is_refused(line: str, said: str, tmp_path: Path) -> None:
    listed = tmp_path / "assets.jsonl"
    listed.write_text(line, encoding="utf-8")
    with pytest.raises(InputError, match=said):
        jobs_of(listed)


def test_what_is_not_there_or_empty_is_refused(tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="is not there"):
        jobs_of(tmp_path / "absent")
    with pytest.raises(MissingFileError, match="holds no mesh"):
        jobs_of(tmp_path)


def test_results_in_the_folder_that_is_searched_are_no_assets(tmp_path: Path) -> None:
    for name in ("a.obj", "out/a/a.obj"):
        mesh(tmp_path / name)
    assert [job.name for job in find_jobs([tmp_path], tmp_path / "out", Options(), Outputs())] == ["a.obj"]


def reported(folder: Path, name: str, *files: str) -> None:
    """A report of flexpara that lists files."""
    facts = {"producer": "flexpara 0.1", "files": [name, *files]}
    (folder / name).write_text(json.dumps(facts), encoding="utf-8")


def test_results_that_a_report_beside_them_lists_are_no_assets_and_that_is_said(tmp_path: Path) -> None:
    for name in ("a.obj", "earlier/a.glb", "earlier/b.obj", "a.glb"):
        mesh(tmp_path / name)
    reported(tmp_path, "a.report.json", "a.glb", "a.onnx")
    reported(tmp_path / "earlier", "page.json", "a.glb")
    said: list[str] = []
    found = find_jobs([tmp_path], tmp_path / "out", Options(), Outputs(), said.append)
    assert [job.name for job in found] == ["a.obj", "earlier/b.obj"]
    assert len(said) == 1
    assert "2 meshes are results of flexpara" in said[0]


def test_hidden_files_are_no_assets_and_formats_that_are_not_read_are_named_with_the_way_out(tmp_path: Path) -> None:
    for name in ("a.obj", "._a.obj", ".git/b.obj", "scene.fbx", "x/scene.fbx", "m.blend"):
        mesh(tmp_path / name)
    said: list[str] = []
    found = find_jobs([tmp_path], tmp_path / "out", Options(), Outputs(), said.append)
    assert [job.name for job in found] == ["a.obj"]
    assert sorted(said)[0].startswith(f"{tmp_path}: 1 .blend passed over; Blender's own files are not read")
    assert sorted(said)[1].startswith(f"{tmp_path}: 2 .fbx passed over; FBX, a format without")


def test_a_folder_that_holds_itself_is_searched_once(tmp_path: Path) -> None:
    mesh(tmp_path / "deep/a.obj")
    (tmp_path / "deep" / "up").symlink_to(tmp_path)
    (tmp_path / "self.obj").symlink_to(tmp_path / "self.obj")
    assert [job.name for job in jobs_of(tmp_path)] == ["deep/a.obj"]


def test_assets_of_one_name_from_two_places_get_two_folders(tmp_path: Path) -> None:
    for name in ("x/a.obj", "y/a.obj", "y/b.obj"):
        mesh(tmp_path / name)
    listed = tmp_path / "assets.jsonl"
    listed.write_text('{"file": "/q/a.obj"}', encoding="utf-8")
    found = {job.name: job.run.output for job in jobs_of(tmp_path / "x", tmp_path / "y", listed)}
    assert set(found) == {"b.obj", "q/a.obj", "x/a.obj", "y/a.obj"}
    assert len(set(found.values())) == 4


def test_the_output_may_be_the_folder_itself_or_lie_in_it_by_another_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a.obj", "out/a/a.obj"):
        mesh(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    for place, output, names in (
        (Path(), Path(), ["a.obj", "out/a/a.obj"]),
        (Path(), Path("../") / tmp_path.name / "out", ["a.obj"]),
        (tmp_path, Path("out"), ["a.obj"]),
    ):
        assert [job.name for job in find_jobs([place], output, Options(), Outputs())] == names


def test_a_result_that_is_named_or_listed_is_an_asset(tmp_path: Path) -> None:
    result = mesh(tmp_path / "a.glb")
    reported(tmp_path, "a.report.json", "a.glb")
    listed = tmp_path / "assets.jsonl"
    listed.write_text('{"file": "a.glb"}', encoding="utf-8")
    assert [job.run.mesh for job in jobs_of(result)] == [job.run.mesh for job in jobs_of(listed)] == [result]
    with pytest.raises(MissingFileError, match="no mesh but results of flexpara"):
        jobs_of(tmp_path)


@pytest.mark.parametrize("text", ["{", "[]", '{"files": ["a.obj"]}', '{"producer": "other", "files": ["a.obj"]}'])
def test_reports_of_others_hide_no_asset(text: str, tmp_path: Path) -> None:
    mesh(tmp_path / "a.obj")
    (tmp_path / "a.report.json").write_text(text, encoding="utf-8")
    assert [job.name for job in jobs_of(tmp_path)] == ["a.obj"]


def test_names_that_are_no_text_are_spelled_out(tmp_path: Path) -> None:
    for name in (b"\xff.obj", b"a\x1b[2J\n.obj", "ü.obj".encode()):
        mesh(tmp_path / os.fsdecode(name))
    assert sorted(job.name for job in jobs_of(tmp_path)) == ["\\udcff.obj", "a\\x1b[2J\\n.obj", "ü.obj"]


def test_a_device_has_no_fingerprint(tmp_path: Path) -> None:
    listed = tmp_path / "assets.jsonl"
    listed.write_text('{"file": "/dev/zero"}', encoding="utf-8")
    assert jobs_of(listed)[0].content() == ""


def test_shards_share_all_assets(tmp_path: Path) -> None:
    for number in range(7):
        mesh(tmp_path / f"{number}.obj")
    jobs = jobs_of(tmp_path)
    parts = [[job.name for job in shard(jobs, (number, 3))] for number in (1, 2, 3)]
    assert parts[0] == ["0.obj", "3.obj", "6.obj"]
    assert sorted(name for part in parts for name in part) == [job.name for job in jobs]


@pytest.mark.parametrize(
    ("name", "text", "beside"),
    [
        ("a.obj", f"mtllib a b.mtl\n{TRIANGLE}", {"a b.mtl": "newmtl m\nmap_Kd -s 1 1 1 x.png\n", "x.png": ""}),
        ("a.gltf", '{"buffers": [{"uri": "a%20b.bin"}], "images": [{"uri": "x.png"}]}', {"a b.bin": "", "x.png": ""}),
    ],
)
def test_a_file_that_an_asset_names_is_part_of_its_content(
    name: str, text: str, beside: dict[str, str], tmp_path: Path
) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    (job,) = jobs_of(tmp_path / name)
    seen = {job.content()}
    for other, content in beside.items():
        (tmp_path / other).write_text(content, encoding="utf-8")
        seen.add(job.content())
    (tmp_path / "x.png").write_text("other", encoding="utf-8")
    seen.add(job.content())
    assert len(seen) == 4


@pytest.mark.parametrize("text", ["[" * 50_000, "[]", '{"buffers": 3}', '{"images": [3, {"uri": 4}]}', "\xff"])
def test_what_names_nothing_has_a_content_all_the_same(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(text, encoding="latin-1")
    assert jobs_of(tmp_path / "a.gltf")[0].content() != ""


def test_options_and_content_have_fingerprints(tmp_path: Path) -> None:
    path = mesh(tmp_path / "a.obj")
    (one,) = jobs_of(path)
    (other,) = find_jobs([path], Path("/out"), Options(charts=3), Outputs())
    assert one.asked("1") == jobs_of(path)[0].asked("1")
    assert len({one.asked("1"), one.asked("2"), other.asked("1")}) == 3
    before = one.content()
    path.write_text(TRIANGLE + "\n", encoding="utf-8")
    assert one.content() not in (before, "")
    path.unlink()
    assert one.content() == ""
