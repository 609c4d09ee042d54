"""Blender's extension: what of it needs no Blender, and all of it inside Blender where there is one.

$BLENDER_PYTHON names a Python with bpy, or several with commas; `scripts/blender-environment` makes one.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import tomllib
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import flexpara
from flexpara.__main__ import main
from flexpara.runtime.io.meshfile import load_asset

ROOT = Path(__file__).resolve().parents[2]
EXTENSION = ROOT / "integrations" / "blender"
PYTHONS = [name for name in os.environ.get("BLENDER_PYTHON", "").split(",") if name]


def _module(name: str) -> Any:
    """A file of the extension, which is no part of the package."""
    spec = spec_from_file_location(f"blender_{name}", EXTENSION / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


WAITS = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
try:
    print("x", file=sys.stderr, flush=True)
    time.sleep(60)
except KeyboardInterrupt:
    print("best")
"""
exchange, child = _module("exchange"), _module("child")


@pytest.fixture
def house() -> Any:
    """A square with a pentagon above it, in the plane z = 0: seven vertices, the edge 2–3 between them."""
    positions = np.array([[0, 0], [1, 0], [1, 1], [0, 1], [0, 1.5], [0.5, 2], [1, 1.5]], float)
    corners = np.array([0, 1, 2, 3, 3, 2, 6, 5, 4], np.int32)
    return exchange.Mesh(np.column_stack([positions, np.zeros(7)]), corners, np.array([4, 5], np.int32))


def write_answer(path: Path, mesh: Any, charts: list[int], shift: float = 0.0) -> Path:
    """An npz file as flexpara writes it: fans from the last corner, winding the other way; uv are x and y.

    shift: added to u of chart 1.
    """
    fans = [(first + size - 1, first + k + 1, first + k) for first, size in ((0, 4), (4, 5)) for k in range(size - 2)]
    corner = np.array(fans).reshape(-1)
    positions = mesh.positions[mesh.loop_vertex[corner]]
    uv = positions[:, :2] + np.outer(np.repeat(charts, 3), (shift, 0.0))
    polygons = np.array([0, 0, 1, 1, 1])
    faces = np.arange(15).reshape(-1, 3)
    np.savez(path, faces=faces, uv=uv.astype(np.float32), charts=charts, polygons=polygons, positions=positions)
    return path


def test_flexpara_reads_the_polygons_and_uv_that_are_written(house: Any, tmp_path: Path) -> None:
    exchange.write_ply(house, tmp_path / "plain.ply")
    asset = load_asset(tmp_path / "plain.ply")
    assert asset.polygons is not None
    assert asset.polygons.size.tolist() == [4, 5]
    np.testing.assert_array_equal(asset.positions, house.positions)
    uv = np.arange(18.0).reshape(-1, 2)
    exchange.write_ply(exchange.Mesh(house.positions, house.loop_vertex, house.size, uv), tmp_path / "uv.ply")
    found = load_asset(tmp_path / "uv.ply")
    assert found.uv is not None
    assert found.polygons is not None
    np.testing.assert_array_equal(found.uv[found.faces], uv[found.polygons.corner])


def test_each_loop_gets_the_uv_of_its_corner_whatever_the_winding(house: Any, tmp_path: Path) -> None:
    answer = exchange.read_answer(write_answer(tmp_path / "a.npz", house, [0, 0, 1, 1, 1], 5.0), house)
    expected = house.positions[house.loop_vertex, :2] + np.repeat([[0, 0], [5, 0]], [4, 5], axis=0)
    np.testing.assert_allclose(answer.uv, expected)
    assert answer.chart.tolist() == [0, 1]
    assert answer.answered.all()
    assert answer.cut == 0


def test_a_polygon_with_a_seam_through_it_is_laid_out_whole(house: Any, tmp_path: Path) -> None:
    answer = exchange.read_answer(write_answer(tmp_path / "a.npz", house, [0, 0, 1, 0, 0], 5.0), house)
    np.testing.assert_allclose(answer.uv, house.positions[house.loop_vertex, :2], atol=1e-6)
    assert answer.cut == 1
    assert answer.answered.all()


def test_seams_are_the_edges_where_uv_part(house: Any) -> None:
    uv = house.positions[house.loop_vertex, :2].astype(np.float32)
    loop_edge = np.array([0, 1, 2, 3, 2, 4, 5, 6, 7], np.int32)
    assert exchange.seam_edges(house, loop_edge, uv).tolist() == []
    uv[4:] += 3.0
    assert exchange.seam_edges(house, loop_edge, uv).tolist() == [2]


def test_some_polygons_and_several_meshes(house: Any) -> None:
    part = exchange.part_of(house, np.array([False, True]))
    assert part.loop_vertex.tolist() == [3, 2, 6, 5, 4]
    both = exchange.joined([house, part])
    assert both.size.tolist() == [4, 5, 5]
    assert both.loop_vertex[-1] == 4 + 7
    assert both.uv is None


def test_cuts_are_written_as_they_are_read(tmp_path: Path) -> None:
    ends = np.array([[[0.1, 0.0, 0.0], [1.0, 2.0, 1e-9]], [[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]])
    exchange.write_cuts(ends, tmp_path / "cuts.txt")
    np.testing.assert_array_equal(np.loadtxt(tmp_path / "cuts.txt").reshape(-1, 2, 3), ends)


def test_centres_of_fans_hold_those_of_each_triangle_that_a_polygon_may_be_cut_into(house: Any) -> None:
    square = exchange.part_of(house, np.array([True, False]))
    expected = {(2 / 3, 1 / 3), (1 / 3, 2 / 3), (1 / 3, 1 / 3), (2 / 3, 2 / 3)}
    found = exchange.fan_centres(square)
    assert {tuple(row) for row in np.round(found[:, :2], 9)} >= {tuple(np.round(row, 9)) for row in expected}
    nothing = exchange.part_of(house, np.zeros(2, bool))
    assert exchange.fan_centres(nothing).shape == (0, 3)
    assert len(exchange.fan_centres(house)) == 16 + 25


def test_a_process_is_watched_asked_and_its_error_is_told() -> None:
    talk = "import sys; print('flexpara: progress: charts 3/4', file=sys.stderr); print('done')"
    run = child.Run(sys.executable, ["-c", talk])
    assert run.result() == "done\n"
    assert run.stage == ("charts", pytest.approx(0.05 + 0.7 * 0.75))
    run = child.Run(sys.executable, ["-c", "import sys; sys.exit('flexpara: error: no mesh, expected one')"])
    with pytest.raises(child.FlexparaError, match=r"^no mesh, expected one$"):
        run.result()
    run = child.Run(sys.executable, ["-c", WAITS])
    while not run.notes:
        time.sleep(0.01)
    run.ask()
    assert run.result() == "best\n"


def test_the_bar_grows_from_stage_to_stage_without_a_gap() -> None:
    assert [begin for begin, _ in child.SPANS.values()] == [0.0, *(end for _, end in child.SPANS.values())][:-1]
    assert list(child.SPANS.values())[-1][1] == 1.0
    assert child.stage_of("normal", 1, 4) == ("normal", 0.25)


def test_the_bar_knows_the_stages_of_an_unwrap_in_their_order(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], house: Any
) -> None:
    exchange.write_ply(house, tmp_path / "house.ply")
    words = ["unwrap", str(tmp_path / "house.ply"), "-o", str(tmp_path / "out"), "--maps", "none", "--format", "npz"]
    assert main([*words, "--size", "64", "--progress-lines"]) == 0
    found = [child.PROGRESS.match(line) for line in capsys.readouterr().err.splitlines()]
    assert list(dict.fromkeys(each[1] for each in found if each)) == list(child.SPANS)


def test_a_program_that_is_not_there_is_told_with_a_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", "")
    with pytest.raises(child.FlexparaError, match="not found on PATH: install it"):
        child.find()
    with pytest.raises(child.FlexparaError, match="/no/such is no file"):
        child.find("/no/such")


def test_the_commands_that_install_are_known_before_they_run(tmp_path: Path) -> None:
    first, second = child.install_commands(tmp_path, "python3", "/checkouts/flexpara/")
    assert first == ["python3", "-m", "venv", str(tmp_path)]
    assert second[-3:] == ["pip", "install", "/checkouts/flexpara[unwrap,bake]"]
    assert child.install_commands(tmp_path, "python3", "git+https://example.org/flexpara")[1][-1] == (
        "flexpara[unwrap,bake] @ git+https://example.org/flexpara"
    )
    with pytest.raises(child.FlexparaError, match="no source is named"):
        child.install_commands(tmp_path, "python3", "")


def test_progress_is_told_in_lines_for_programs(
    tmp_path: Path, instant_training: list[Any], capsys: pytest.CaptureFixture[str], house: Any
) -> None:
    exchange.write_ply(house, tmp_path / "house.ply")
    words = ["unwrap", str(tmp_path / "house.ply"), "-o", str(tmp_path / "out"), "--maps", "none", "--format", "npz"]
    assert main([*words, "--size", "64", "--progress-lines"]) == 0
    assert len(instant_training) == 1
    assert "flexpara: progress: train 1/1\n" in capsys.readouterr().err
    answer = exchange.read_answer(tmp_path / "out" / "house.npz", house)
    assert answer.answered.all()
    assert answer.cut == 0
    flat = (answer.uv - answer.uv[0]) @ (1.0, 1.0j)  # turned and scaled it is the house
    np.testing.assert_allclose(flat / flat[1], house.positions[house.loop_vertex, :2] @ (1.0, 1.0j), atol=1e-5)


def test_evaluate_writes_what_is_true_of_each_triangle(tmp_path: Path, house: Any) -> None:
    uv = house.positions[house.loop_vertex, :2] * (1.0, 0.5)
    exchange.write_ply(exchange.Mesh(house.positions, house.loop_vertex, house.size, uv), tmp_path / "house.ply")
    assert main(["evaluate", str(tmp_path / "house.ply"), "--json", "--faces", str(tmp_path / "faces.npz")]) == 0
    with np.load(tmp_path / "faces.npz") as found:
        assert found["polygons"].tolist() == [0, 0, 1, 1, 1]
        assert found["charts"].tolist() == [0] * 5
        np.testing.assert_allclose(found["distortion"], 1.25, rtol=1e-5)


def test_the_manifest_has_the_version_of_the_package_and_each_file_its_licence() -> None:
    manifest = tomllib.loads((EXTENSION / "blender_manifest.toml").read_text(encoding="utf-8"))
    assert manifest["version"] == flexpara.__version__
    assert manifest["license"] == ["SPDX:GPL-3.0-or-later"]
    assert len(manifest["tagline"]) <= 64
    assert not manifest["tagline"].endswith(".")
    first = {path.name: path.read_text(encoding="utf-8").splitlines()[0] for path in EXTENSION.glob("*.py")}
    assert set(first.values()) == {"# SPDX-License-Identifier: GPL-3.0-or-later"}
    assert "GNU GENERAL PUBLIC LICENSE" in (EXTENSION / "LICENSE").read_text(encoding="utf-8")


@pytest.mark.skipif(not PYTHONS, reason="no Python with bpy: scripts/blender-environment, name it in $BLENDER_PYTHON")
@pytest.mark.parametrize("python", PYTHONS)
def test_in_blender(python: str, tmp_path: Path) -> None:
    """Cube, Suzanne with n-gons, modifiers, several objects, selected faces, evaluation, maps, refusals."""
    program = tmp_path / "flexpara"
    path = os.environ.get("PYTHONPATH", "")
    program.write_text(f'#!/bin/sh\nPYTHONPATH="{path}" exec "{sys.executable}" -m flexpara "$@"\n', encoding="utf-8")
    program.chmod(0o755)
    folder = tmp_path / "flexpara_extension"
    folder.symlink_to(EXTENSION)
    script = Path(__file__).with_name("in_blender.py")
    done = subprocess.run(
        [python, str(script), str(folder), str(program)], capture_output=True, text=True, env=child.clean_environment()
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert set(json.loads(done.stdout.splitlines()[-1])["seconds"]) >= {"flexpara", "smart_project"}
