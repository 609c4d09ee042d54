"""The report says what is true of each face, shows nothing from outside its folder, and asks for nothing."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Callable
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from flexpara.__main__ import main
from flexpara.bake.colors.heat import signed_distortion
from flexpara.bake.report.gather import ReportSettings, read_report, results_in, told_apart
from flexpara.bake.report.page import html_of, packed
from flexpara.bake.report.pictures import picture_file
from flexpara.bake.report.shape import FLIPPED, OVERLAPPING, Shape, face_facts
from flexpara.bake.report.words import LINES, table
from flexpara.runtime.errors import InputError, MissingFileError
from flexpara.runtime.geometry.metrics import Metrics, face_distortion
from flexpara.runtime.mesh import Asset, Atlas

EVIL = "</script><img src=x onerror=hacked=1><b>"
"""Stands wherever the folder of these tests can hold it."""
Pair = tuple[Atlas, Asset]


def test_stretch_of_a_square_laid_out_twice_as_wide_as_high(pair: Callable[..., Pair]) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    facts = face_facts(Shape.of_atlas(*pair(corners, [[0, 1, 2], [0, 2, 3]], corners[:, :2] * [1.0, 0.5])))
    np.testing.assert_allclose(facts.stretch, [[np.sqrt(2.0), np.sqrt(0.5)]] * 2, rtol=1e-6)
    assert facts.flags.tolist() == [0, 0]
    assert len(facts.seams) == 0


def test_flips_and_overlaps_are_told_by_face(pair: Callable[..., Pair]) -> None:
    corners = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    folded = [[0, 0], [1, 0], [1, 1], [0.9, 0.4]]
    facts = face_facts(Shape.of_atlas(*pair(corners, [[0, 1, 2], [0, 2, 3]], folded)))
    assert facts.flags.tolist() == [OVERLAPPING, FLIPPED | OVERLAPPING]


def test_heat_is_that_of_the_preview(sphere: Pair) -> None:
    atlas, asset = sphere
    facts = face_facts(Shape.of_atlas(atlas, asset))
    energy = face_distortion(asset.surface, atlas.corner_uv)
    np.testing.assert_allclose(facts.heat(facts.top), signed_distortion(atlas, energy, facts.top), atol=1e-12)


def test_a_seam_is_told_once_for_each_side(folder: Path) -> None:
    (result,) = results_in([folder])
    assert result.facts.chart.tolist() == [0, 0, 1, 1]
    ends = result.shape.positions[result.facts.seams]
    assert ends.shape == (2, 2, 3)
    assert np.unique(ends[..., 0]).tolist() == [0.0]


def test_numbers_of_a_foreign_report_are_taken_only_where_they_are_numbers(folder: Path) -> None:
    (result,) = results_in([folder])
    assert result.metrics["rms_texels"] == 0.25
    assert result.metrics["charts"] == 2
    assert "chart_agreement" not in result.metrics
    assert list(result.seconds.values()) == [1.5]
    assert (result.page, result.notes[1]) == ((64, 64), "2 faces turned to agree with the others around")


def test_pictures_outside_the_folder_are_not_shown(folder: Path) -> None:
    Image.new("RGB", (4, 4)).save(folder.parent / "secret.png")
    (folder / "link.png").symlink_to(folder.parent / "secret.png")
    (result,) = results_in([folder])
    assert len(result.pictures) == 1
    assert "../secret.png is no file of the folder" in result.notes[-1]
    for name in ("link.png", "../secret.png", str(folder.parent / "secret.png"), "", "a\0b"):
        with pytest.raises(InputError, match="no file of the folder"):
            picture_file(folder, name, 64)
    (folder / "text.png").write_text("no picture", encoding="utf-8")
    with pytest.raises(InputError, match="no picture that is read"):
        picture_file(folder, "text.png", 64)


def test_pictures_are_scaled_down(folder: Path) -> None:
    kind, content = picture_file(folder, "halves.png", 16).split(";base64,")
    assert kind == "data:image/webp"
    path = folder / "small.webp"
    path.write_bytes(base64.b64decode(content))
    with Image.open(path) as image:
        assert image.size == (16, 16)


@pytest.mark.parametrize("text", ["[]", "{", "[" * 100_000, "\udcff"])
def test_a_file_that_is_no_report_is_refused(text: str, folder: Path) -> None:
    path = folder / "card.report.json"
    path.write_bytes(text.encode("utf-8", "surrogateescape"))
    with pytest.raises(InputError, match=r"card\.report\.json"):
        read_report(path)


def test_what_is_no_result_is_refused_with_a_remedy(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="does not exist"):
        results_in([tmp_path / "nothing"])
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match=r"holds no STEM\.report\.json"):
        results_in([tmp_path / "empty"])
    with pytest.raises(InputError, match="at most 2"):
        results_in([folder] * 3, ReportSettings(most=2))
    with pytest.raises(InputError, match="8 faces, expected at most 7"):
        results_in([folder] * 2, ReportSettings(faces=7))


def test_a_mesh_of_any_tool_stands_beside_a_result(folder: Path) -> None:
    first, second = results_in([folder, folder / "card.obj"])
    assert (first.title, second.title) == ("card", "card.obj")
    assert second.metrics["charts"] == 2


def test_titles_are_the_ends_of_paths_that_tell_results_apart() -> None:
    places = [Path(place) for place in ("/x/cow/cow", "/x/planar.obj", "/a/bunny", "/b/bunny", "/b/bunny/bunny.glb")]
    assert told_apart(places) == ["cow", "planar.obj", "a/bunny", "b/bunny", "bunny.glb"]
    assert told_apart([Path("/x/a"), Path("/x/a")]) == ["x/a", "x/a"]


def test_the_page_names_no_address_but_data(folder: Path) -> None:
    page = html_of(results_in([folder]), "card")
    outside = re.sub(r"data:[a-z/]+;base64,[A-Za-z0-9+/=]+", "", page).replace(EVIL.replace("<", "\\u003c"), "")
    assert re.findall(r"(?:src|href|url)\s*[=(]", outside.replace(escape(EVIL), "")) == []
    assert "://" not in outside
    assert "\\u003c/script>" in page
    assert "</script><img" not in page
    assert len(page) < 3 << 20


def test_the_same_results_give_the_same_page(folder: Path) -> None:
    assert html_of(results_in([folder]), "a") == html_of(results_in([folder]), "a")


def test_arrays_of_the_page_come_back() -> None:
    values = np.array([[1, 2], [3, 70_000]], np.uint32)
    found = packed(values)
    assert found["type"] == "uint32"
    np.testing.assert_array_equal(
        np.frombuffer(zlib.decompress(base64.b64decode(found["bytes"])), "<u4"), values.reshape(-1)
    )


def test_words_for_numbers_and_which_is_ahead() -> None:
    rows = {row.name: row for row in table([{"charts": 4, "packing_efficiency": 0.5}, {"charts": 9}])}
    assert rows["Charts"].values == ("4", "9")
    assert rows["Charts"].best == (True, False)
    assert rows["Use of the square"].values == ("50.0 %", "–")
    assert not any(row.best[0] for row in table([{"charts": 4}, {"charts": 9}], ranked=False))


def test_every_line_is_of_a_number_that_is_measured() -> None:
    known = {*Metrics.__dataclass_fields__, "rms_texels", "chart_agreement"}
    assert [line.key for line in LINES if line.key not in known] == []


def test_the_command_writes_beside_the_result_and_only_over_its_own(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", str(folder)]) == 0
    page = folder / "card.report.html"
    assert capsys.readouterr().out.strip() == str(page)
    assert main(["report", str(folder), "--quiet"]) == 0
    page.write_text("mine", encoding="utf-8")
    assert main(["report", str(folder)]) == 2
    assert page.read_text(encoding="utf-8") == "mine"
    assert main(["report", str(folder), str(folder / "card.obj")]) == 2
    assert "-o compare.html" in capsys.readouterr().err
    assert main(["report"]) == 2


def test_a_folder_of_two_results_gets_one_page_of_both(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("card.report.json", "card.obj"):
        (folder / name.replace("card", "twin")).write_bytes((folder / name).read_bytes())
    assert main(["report", str(folder)]) == 0
    page = folder / "results.report.html"
    assert capsys.readouterr().out.strip() == str(page)
    text = page.read_text(encoding="utf-8")
    assert "<title>card · twin" in text


def test_three_js_is_the_version_it_is_said_to_be_with_its_licence() -> None:
    three = files("flexpara.bake.report") / "site" / "three"
    note = (three / "README.md").read_text(encoding="utf-8")
    version = re.search(r"three\.js 0\.(\d+)\.0", note)
    assert version is not None
    core = (three / "three.core.min.js").read_text(encoding="utf-8")
    assert f'"{version[1]}"' in core
    assert "SPDX-License-Identifier: MIT" in core
    assert "Copyright ©" in (three / "LICENSE").read_text(encoding="utf-8")


def test_the_uv_that_a_mesh_came_with_stand_before_the_new_ones(
    tmp_path: Path, instant_training: list[Any], capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "card.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 0\nvt 0.5 1\nf 1/1 2/2 3/3\n", encoding="utf-8"
    )
    out = tmp_path / "out"
    words = ["unwrap", str(tmp_path / "card.obj"), "-o", str(out), "--size", "64", "--maps", "none", "--report"]
    assert main(words) == 0
    assert len(instant_training) == 1
    assert "card.report.html" in capsys.readouterr().out
    assert "card.report.html" in json.loads((out / "card.report.json").read_text(encoding="utf-8"))["files"]
    text = (out / "card.report.html").read_text(encoding="utf-8")
    assert '<th scope="col">before</th><th scope="col">card</th>' in text
    assert [result.title for result in results_in([out])] == ["before", "card"]
