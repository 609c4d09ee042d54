"""The corpus runner: written files are judged as they are, runs resume, bars and comparisons say what they should."""

from __future__ import annotations

import json
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from benchmarks.corpus import tables
from benchmarks.corpus.__main__ import FILE_BARS, main, meshes
from benchmarks.corpus.judge import beside, judged, load_evaluator, read_layout, weighted_quantile
from benchmarks.corpus.judge import main as judge_files
from benchmarks.corpus.processes import run
from flexpara.runtime.errors import InputError
from flexpara.runtime.sessions.session import UnwrapSession

ROOT = Path(__file__).resolve().parents[2]
SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"
WHOLE = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
HALVES = SQUARE + "vt 0 0\nvt .5 0\nvt .5 .5\nvt .9 .9\nvt .4 .9\nvt .4 .4\nf 1/1 2/2 3/3\nf 1/6 3/4 4/5\n"
FLIPPED = SQUARE + "vt 0 0\nvt 1 0\nvt 1 1\nvt .9 .5\nf 1/1 2/2 3/3\nf 1/1 3/3 4/4\n"
EVALUATOR = """def evaluate(vertices, faces, uv, raster):
    return dict(charts=1, symdir=1.25, seam_len=2.0, flips_n=3, uv_degenerate_n=0, overlap=0.5)
"""


def text_file(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.parent.mkdir(exist_ok=True, parents=True)
    path.write_text(text, encoding="utf-8")
    return path


def row(**changes: object) -> tables.Row:
    good = {"file": "a/plane.obj", "tool": "flexpara", "status": "ok", "said": "", "seconds": 2.0, "peak_mb": 500.0}
    good |= dict.fromkeys(("collapsed", "flips", "degenerate", "overlap", "outside"), 0)
    return good | {"charts": 1, "stretch": 1.05, "seam": 1.0, "objective": 0.053} | changes


def test_a_square_laid_out_as_it_is_has_no_distortion_and_no_seam(tmp_path: Path) -> None:
    found = judged(*read_layout(text_file(tmp_path, "square.obj", WHOLE)))
    assert (found["charts"], found["parts"], found["faces"], found["flips"], found["outside"]) == (1, 1, 2, 0, 0)
    assert found["stretch"] == pytest.approx(1.0)
    assert found["packing"] == pytest.approx(1.0)
    assert (found["seam"], found["overlap"]) == (0.0, 0.0)
    assert found["objective"] == pytest.approx(0.0, abs=1e-12)


def test_corners_at_one_position_are_one_vertex_and_their_edge_a_seam(tmp_path: Path) -> None:
    found = judged(*read_layout(text_file(tmp_path, "square.obj", HALVES)))
    assert (found["charts"], found["charts_per_part"]) == (2, 2.0)
    assert found["seam"] == pytest.approx(2**0.5)
    assert found["objective"] == pytest.approx(0.003 * 2**0.5)


def test_defects_are_counted(tmp_path: Path) -> None:
    found = judged(*read_layout(text_file(tmp_path, "square.obj", FLIPPED)))
    assert found["flips"] == 1
    assert found["overlap"] > 0.0
    assert found["worst_chart"] > 1.1
    moved = judged(*read_layout(text_file(tmp_path, "moved.obj", WHOLE.replace("vt 1 1", "vt 1.5 1"))))
    assert moved["outside"] == 2
    collapsed = WHOLE + "v 0 0 0\nf 1/1 5/1 2/2\n"
    assert judged(*read_layout(text_file(tmp_path, "line.obj", collapsed)))["collapsed"] == 1


def test_a_file_without_uv_or_triangles_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="has no uv"):
        read_layout(text_file(tmp_path, "bare.obj", SQUARE + "f 1 2 3\n"))


def test_a_surface_that_came_back_smaller_is_seen(tmp_path: Path) -> None:
    source = text_file(tmp_path, "source.obj", SQUARE + "f 1 2 3 4\n")
    written = text_file(tmp_path, "written.obj", WHOLE.replace("f 1/1 3/3 4/4\n", ""))
    result = tmp_path / "judged.json"
    assert judge_files(str(result), "none", str(source), str(written)) == 0
    assert json.loads(result.read_text(encoding="utf-8"))["written.obj"]["area"] == pytest.approx(0.5)
    assert judge_files(str(result), "none", str(tmp_path / "absent.obj"), str(written)) == 0
    assert json.loads(result.read_text(encoding="utf-8"))["written.obj"]["area"] is None


def test_the_bars_of_single_files_can_be_read() -> None:
    bars = json.loads(FILE_BARS.read_text(encoding="utf-8"))
    for name, texts in bars.items():
        assert "/" in name
        assert len(tables.missed(row(), texts)) <= len(texts)


def test_the_evaluator_from_outside_is_believed_in_defects_and_disagreement_is_named(tmp_path: Path) -> None:
    layout = read_layout(text_file(tmp_path, "square.obj", WHOLE))
    found = judged(*layout, load_evaluator(str(text_file(tmp_path, "evaluator.py", EVALUATOR))))
    assert (found["stretch"], found["seam"], found["flips"], found["overlap"]) == (1.25, 2.0, 3, 0.5)
    for name in ("stretch 1 / 1.25", "seam 0 / 2", "flips 0 / 3", "overlap 0 / 0.5"):
        assert name in found["disagreement"]
    assert "charts" not in found["disagreement"]
    same = {"charts": 1, "symdir": 1.0, "seam_len": 0.0, "flips_n": 0, "uv_degenerate_n": 0}
    own = judged(*layout)
    assert beside(own, same)["disagreement"] == ""
    broken = "def evaluate(*_, **__):\n    raise ValueError('no edges')\n"
    found = judged(*layout, load_evaluator(str(text_file(tmp_path, "broken.py", broken))))
    assert (found["evaluator_error"], found["stretch"]) == ("ValueError('no edges')", own["stretch"])
    assert load_evaluator("none") is None
    with pytest.raises(InputError, match="no evaluator at"):
        load_evaluator(str(tmp_path / "absent.py"))


def test_the_quantile_of_weighted_values() -> None:
    value, weight = np.array([3.0, 1.0, 2.0]), np.array([1.0, 90.0, 9.0])
    assert [weighted_quantile(value, weight, share) for share in (0.5, 0.95, 1.0)] == [1.0, 2.0, 3.0]


def watched(command: list[str]) -> float:
    """Peak MB of a command, watched by a process as small as the runner's."""
    code = f"from benchmarks.corpus.processes import run; print(run({command!r}, 60.0).peak_mb)"
    return float(subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, check=True).stdout)


def test_a_process_is_timed_and_ended_at_its_limit() -> None:
    done = run([sys.executable, "-S", "-c", "import sys; sys.exit('no\\n\\nmesh')"], 60.0)
    assert (done.code, done.said, done.lines) == (1, "mesh", 2)
    late = run([sys.executable, "-c", "import time; time.sleep(60)"], 0.5)
    assert late.code is None
    assert late.seconds >= 0.5
    busy = run([sys.executable, "-S", "-c", "import time\nwhile time.process_time() < 0.3: pass"], 60.0)
    assert 0.3 <= busy.cpu_seconds <= busy.seconds + 0.1


def test_an_interrupted_run_leaves_no_process_behind(tmp_path: Path) -> None:
    alive = tmp_path / "alive"
    child = f"import pathlib, time; time.sleep(3); pathlib.Path({str(alive)!r}).touch()"
    code = f"""import sys
from benchmarks.corpus.processes import run
print("ready", flush=True)
run([sys.executable, "-S", "-c", {child!r}], 60.0)"""
    with subprocess.Popen([sys.executable, "-c", code], cwd=ROOT, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(0.5)
        process.terminate()
        assert process.wait() == 143
    time.sleep(3.0)
    assert not alive.exists()


def test_peak_memory_is_that_of_all_its_processes() -> None:
    assert 80.0 < watched([sys.executable, "-S", "-c", "x = bytearray(80_000_000)"]) < 110.0
    child = "x = bytearray(b'1') * 60_000_000; import time; time.sleep(1)"
    start = f"subprocess.Popen([sys.executable, '-S', '-c', {child!r}])"
    code = f"import subprocess, sys; [process.wait() for process in [{start} for _ in 'ab']]"
    assert 120.0 < watched([sys.executable, "-c", code]) < 200.0


@pytest.mark.parametrize(
    ("change", "fails"),
    [
        ({}, ""),
        ({"flips": 1}, "flips<=0 (is 1)"),
        ({"overlap": 1e-12}, "overlap<=0 (is 1e-12)"),
        ({"outside": 2}, "outside<=0 (is 2)"),
        ({"stretch": 1.2}, "stretch<=1.1 (is 1.2)"),
        ({"charts": 2}, "charts<=1 (is 2)"),
        ({"charts": 2, "file": "b/other.obj"}, ""),
        ({"seconds": None}, "seconds<=60 (is absent)"),
        ({"status": "timeout"}, "timeout"),
        ({"status": "exit 1", "said": "boom"}, "exit 1 boom"),
        ({"status": "refused"}, "refused"),
        ({"status": "refused", "file": "b/other.obj"}, ""),
        ({"tool": "xatlas", "flips": 1}, ""),
    ],
)
def test_each_bar_that_is_missed_is_named(change: tables.Row, fails: str) -> None:
    found = tables.violations([row(**change)], ["seconds<=60", "stretch<=1.1"], {"a/plane.*": ["charts<=1"]})
    assert found == ([f"{change.get('file', 'a/plane.obj')}: {fails}"] if fails else [])


def test_a_bar_that_cannot_be_read_is_an_error() -> None:
    with pytest.raises(ValueError, match="'stretch=1' cannot be read"):
        tables.missed(row(), ["stretch=1"])


def test_the_summary_counts_what_ended_well() -> None:
    rows = [row(), row(file="b", stretch=1.2), row(file="c", flips=1), row(file="d", status="timeout"), row(tool="x")]
    mine, other = tables.summary(rows)
    assert mine.startswith("flexpara: 4 files · exit 0 3 · refused 0 · out of time 1 · valid 2 · usable")
    assert "stretch ≤ 1.1) 1 · stretch mean 1.1000 worst 1.2000 (b)" in mine
    assert other.startswith("x: 1 files")


def test_two_runs_are_compared_file_by_file() -> None:
    before = [row(), row(file="b", flips=1), row(file="gone")]
    after = [row(objective=0.0265, charts=2), row(file="b", objective=0.106), row(file="new")]
    lines = tables.compare(before, after)
    assert "| a/plane.obj | flexpara | ok | 1 → 2 |" in lines[2]
    assert "| 0.0530 → 0.0265 | 0.501 |" in lines[2]
    assert "2 rows in both · objective ratio 1.0" in lines[-1]
    assert "better 1, worse 1 · newly valid 1, no longer valid 0" in lines[-1]


def test_a_line_cut_short_is_left_out_and_the_last_of_a_file_counts(tmp_path: Path) -> None:
    lines = [json.dumps(row(stretch=value)) + "\n" for value in (1.0, 2.0)]
    path = text_file(tmp_path, "results.jsonl", "".join(lines) + '{"file": "b"')
    assert [found["stretch"] for found in tables.read_rows(path)] == [2.0]
    assert tables.read_rows(tmp_path / "absent") == []


def test_files_are_named_by_their_folder_however_they_are_given(tmp_path: Path) -> None:
    square = text_file(tmp_path / "simple", "square.obj", WHOLE)
    text_file(tmp_path / "simple", "read.me", "no mesh")
    assert meshes(tmp_path) == meshes(tmp_path / "simple") == meshes(square) == [(square, "simple/square.obj")]


def test_meshes_are_unwrapped_judged_and_not_unwrapped_again(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("torch")
    text_file(tmp_path / "in", "square.obj", SQUARE + "f 1 2 3 4\n")
    text_file(tmp_path / "in", "empty.obj", "v 0 0 0\n")
    argv = [str(tmp_path / "in"), "-o", str(tmp_path / "out"), "--peers", "xatlas", "--evaluator", "none", "--keep"]
    assert main(argv) == 0
    rows = {(found["file"], found["tool"]): found for found in tables.read_rows(tmp_path / "out" / "results.jsonl")}
    done, refused = rows["in/square.obj", "flexpara"], rows["in/empty.obj", "flexpara"]
    assert tables.is_valid(done)
    assert done["stretch"] == pytest.approx(1.0, abs=1e-4)
    assert done["faces_written"] == {"square.glb": 2, "square.obj": 2}
    assert tables.is_valid(rows["in/square.obj", "xatlas"])
    assert (refused["status"], rows["in/empty.obj", "xatlas"]["status"]) == ("refused", "refused")
    assert refused["said"] != ""
    capsys.readouterr()
    assert main([*argv, "--compare", str(tmp_path / "out" / "results.jsonl")]) == 0
    assert "4 rows are there from before" in capsys.readouterr().out
    assert len((tmp_path / "out" / "results.jsonl").read_text(encoding="utf-8").splitlines()) == 4
    assert "| in/square.obj | flexpara | ok |" in (tmp_path / "out" / "results.md").read_text(encoding="utf-8")
    session = UnwrapSession(tmp_path / "out" / "files" / "in" / "square.obj" / "out" / "square.onnx")
    assert session.unwrap(np.array([[0.5, 0.25, 0.0]]))[0].shape == (1, 2)
