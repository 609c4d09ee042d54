"""The Python API: what unwrap takes and gives, what save writes.  Training is replaced: this tests the wiring."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
import trimesh

import flexpara
from flexpara.runtime.errors import ForeignFileError, InputError

if TYPE_CHECKING:
    from pathlib import Path

    from flexpara.runtime.mesh import Surface

VERTICES = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
FACES = np.array([[0, 1, 2], [0, 2, 3]])

pytestmark = pytest.mark.usefixtures("instant_training")


def unwrapped(*, charts: int = 8, padding: int | None = None, seed: int = 0) -> flexpara.UnwrapResult:
    return flexpara.unwrap((VERTICES, FACES), size=64, charts=charts, padding=padding, seed=seed)


def test_arrays_a_trimesh_and_a_file_give_the_same_atlas(tmp_path: Path) -> None:
    mesh = trimesh.Trimesh(VERTICES, FACES, process=False)
    mesh.export(tmp_path / "card.ply")
    results = [unwrapped(), flexpara.unwrap(mesh, size=64), flexpara.unwrap(str(tmp_path / "card.ply"), size=64)]
    for result in results:
        np.testing.assert_array_equal(result.atlas.uv, results[0].atlas.uv)
        np.testing.assert_array_equal(result.atlas.faces, results[0].atlas.faces)


def test_the_same_seed_gives_the_same_bytes() -> None:
    first, second = unwrapped(seed=3), unwrapped(seed=3)
    assert first.onnx == second.onnx
    np.testing.assert_array_equal(first.atlas.uv, second.atlas.uv)


def test_the_report_holds_settings_metrics_and_agreement() -> None:
    report = unwrapped(charts=5, padding=1).report
    assert report["settings"]["charts"] == 5
    assert report["settings"]["padding"] == 1
    assert report["metrics"]["flipped_faces"] == 0
    assert report["metrics"]["symmetric_dirichlet_mean"] == pytest.approx(1.0)
    assert set(report["network"]) == {"rms_texels", "p99_texels", "chart_agreement", "seam_agreement", "points"}
    assert set(report["seconds"]) == {"train", "pack", "measure", "fit", "export"}
    json.dumps(report, allow_nan=False)


def test_a_result_is_a_trimesh_with_its_uv_and_tensors_for_torch() -> None:
    result = unwrapped()
    mesh, tensors = result.to_trimesh(), result.to_torch()
    visual: Any = mesh.visual
    np.testing.assert_array_equal(visual.uv, result.atlas.uv)
    np.testing.assert_array_equal(mesh.faces, result.atlas.faces)
    np.testing.assert_array_equal(mesh.vertices, result.atlas.positions)
    assert {name: str(value.dtype) for name, value in tensors._asdict().items()} == {
        "positions": "torch.float32",
        "faces": "torch.int32",
        "uv": "torch.float32",
        "normals": "torch.float32",
        "source_vertex": "torch.int64",
    }
    np.testing.assert_array_equal(tensors.uv[tensors.faces.long()].numpy(), result.atlas.corner_uv)


def test_save_writes_what_it_names_and_the_session_reads_it(tmp_path: Path) -> None:
    result = unwrapped()
    paths = result.save(tmp_path / "out", maps=(), preview=False, formats=("glb", "obj", "ply"))
    names = {path.name for path in paths}
    assert names == {"mesh.glb", "mesh.obj", "mesh.ply", "mesh.onnx", "mesh.report.json"}
    assert {path.name for path in (tmp_path / "out").iterdir()} == names
    report = json.loads((tmp_path / "out" / "mesh.report.json").read_text(encoding="utf-8"))
    assert report["files"] == sorted(names)
    assert report["outputs"]["formats"] == ["glb", "obj", "ply"]
    assert report["outputs"]["rays"] == 64
    session = flexpara.runtime.UnwrapSession(tmp_path / "out" / "mesh.onnx")
    uv, chart, score = session.unwrap(VERTICES)
    assert uv.shape == (4, 2)
    assert chart.tolist() == [0, 0, 0, 0]
    assert score.tolist() == [1.0, 1.0, 1.0, 1.0]


@pytest.mark.parametrize("kind", ["glb", "obj", "ply"])
def test_each_format_gives_the_triangles_back_in_their_order(kind: str, tmp_path: Path) -> None:
    result = unwrapped()
    result.save(tmp_path, maps=(), preview=False, formats=(kind,))
    back = flexpara.load(tmp_path / f"mesh.{kind}")
    np.testing.assert_array_equal(back.surface.triangles, VERTICES[FACES])
    assert back.uv is not None
    np.testing.assert_allclose(back.uv[back.faces], result.atlas.corner_uv, atol=1e-6)


def test_saving_again_replaces_its_own_files_and_no_others(tmp_path: Path) -> None:
    result = unwrapped()
    result.save(tmp_path, maps=(), preview=False)
    result.save(tmp_path, maps=(), preview=False)
    (tmp_path / "mesh.obj").write_text("mine", encoding="utf-8")
    with pytest.raises(ForeignFileError, match=r"mesh\.obj.*--force"):
        result.save(tmp_path, maps=(), preview=False, formats=("obj",))
    assert (tmp_path / "mesh.obj").read_text(encoding="utf-8") == "mine"
    result.save(tmp_path, maps=(), preview=False, formats=("obj",), force=True)
    assert (tmp_path / "mesh.obj").read_text(encoding="utf-8") != "mine"


def test_progress_sees_every_stage_of_unwrapping_and_saving(tmp_path: Path) -> None:
    stages: list[str] = []

    def progress(stage: str, step: int, steps: int, loss: float | None = None) -> None:
        assert 0 <= step <= steps
        assert loss is None or stage == "train"
        stages.append(stage)

    result = flexpara.unwrap((VERTICES, FACES), size=64, progress=progress)
    result.save(tmp_path, maps=(), preview=False, progress=progress)
    assert list(dict.fromkeys(stages)) == ["train", "pack", "measure", "fit", "export", "write"]


def test_options_are_checked_before_anything_is_read(tmp_path: Path, instant_training: list[Surface]) -> None:
    with pytest.raises(InputError, match="charts is 0"):
        flexpara.unwrap(tmp_path / "absent.obj", charts=0)
    with pytest.raises(InputError, match="unknown map"):
        unwrapped().save(tmp_path / "out", maps=("shiny",))
    assert not (tmp_path / "out").exists()
    assert len(instant_training) == 1


def test_options_are_made_once_or_given_as_keywords() -> None:
    made = flexpara.Options(charts=5, size=64, padding=1)
    plain = flexpara.unwrap((VERTICES, FACES), charts=5, size=64, padding=1)
    both = flexpara.unwrap((VERTICES, FACES), flexpara.Options(charts=3, size=64), charts=5, padding=1)
    settings = [flexpara.unwrap((VERTICES, FACES), made).report["settings"], plain.report["settings"]]
    assert settings[0] == settings[1] == both.report["settings"]
    assert settings[0]["charts"] == 5


def test_outputs_are_made_once_or_given_as_keywords(tmp_path: Path) -> None:
    made = flexpara.Outputs(maps=("chart", "position"), formats=("obj",), preview=False)
    first = unwrapped().save(tmp_path / "made", made)
    second = unwrapped().save(tmp_path / "keywords", maps="chart,position", formats=["obj"], preview=False)
    assert [path.name for path in first] == [path.name for path in second]
    assert "mesh_chart.png" in {path.name for path in first}


def test_an_unknown_keyword_is_refused_with_the_name_meant(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"chart is no option, expected some of .*; pass charts"):
        flexpara.unwrap((VERTICES, FACES), chart=5)
    with pytest.raises(InputError, match=r"colour is no option, expected some of .*; leave it out"):
        unwrapped().save(tmp_path / "out", colour=1)
    assert not (tmp_path / "out").exists()


def test_a_roof_without_normals_is_sharp_above_the_crease_angle_and_its_uv_stay() -> None:
    vertices = [[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1], [2, 0, 1]]
    faces = [[0, 1, 2], [0, 2, 3], [1, 0, 4], [1, 4, 5]]
    sharp, smooth = (flexpara.unwrap((vertices, faces), size=64, crease_angle=angle) for angle in (89, 91))
    np.testing.assert_array_equal(sharp.atlas.corner_uv, smooth.atlas.corner_uv)
    assert sharp.onnx == smooth.onnx
    assert len(sharp.atlas.uv) == len(smooth.atlas.uv) + 2
    flat = np.repeat([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]], 6, axis=0)
    np.testing.assert_allclose(sharp.atlas.normals[sharp.atlas.faces].reshape(-1, 3), flat, atol=1e-6)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(smooth.atlas.normals[smooth.atlas.faces[:2, 0]], [[0.0, half, half]] * 2, atol=1e-6)


def test_atlas_vertices_name_vertices_of_the_file_where_normals_split_them() -> None:
    vertices = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0], [0, 0, 1], [2, 0, 1]], float)
    result = flexpara.unwrap((vertices, [[0, 1, 2], [0, 2, 3], [1, 0, 4], [1, 4, 5]]), size=64)
    assert len(result.asset.positions) == 8
    np.testing.assert_array_equal(vertices[result.atlas.source_vertex], result.atlas.positions)
    np.testing.assert_array_equal(result.asset.positions[: len(vertices)], vertices)
