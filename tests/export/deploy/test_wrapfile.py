"""The exported inverse: equal to its numpy twin, self-describing, and NaN where there is no chart."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from numpy.typing import NDArray

from flexpara.export.deploy.wrapfile import (
    Inverse,
    WrapParitySpec,
    WrapSpec,
    build_inverse,
    export_wrap,
    probe_uv,
    prove_inverse,
)
from flexpara.export.graph.metadata import PlacedCharts, Provenance
from flexpara.export.graph.proven import FileKind
from flexpara.runtime.errors import MissingFileError, ParityError, ShapeError
from flexpara.runtime.sessions.bundle import METADATA_KEY, BundleMetadata
from flexpara.runtime.sessions.wrapsession import WrapSession
from flexpara.train.deploy.config import GrowConfig
from flexpara.train.deploy.experts import Lesson
from flexpara.train.deploy.fit_wrap import above_layer, on_layers
from flexpara.train.deploy.gated import GatedExperts
from flexpara.train.deploy.grow import grow

MapMaker = Callable[..., Any]


def inverse_of(charts: int) -> GatedExperts:
    """Every chart covers the square, bent and turned in a way of its own."""
    rng = np.random.default_rng(0)
    uv, chart = rng.random((20_000, 2)), rng.integers(charts, size=20_000)
    xyz = 0.6 * np.stack([np.sin(3.0 * uv[:, 0]), np.cos(3.0 * uv[:, 1]), uv[:, 0] - chart / charts], axis=1)
    y = np.concatenate([xyz, np.tile([0.0, 0.6, 0.8], (len(uv), 1))], axis=1)
    x = on_layers(uv, chart, charts)
    lesson = Lesson(x, y, chart, np.zeros((len(uv), 6, 3)), above_layer(chart, charts))
    return grow(lesson, GrowConfig(), 0.02, rng)


@pytest.fixture
def make_inverse(make_map: MapMaker) -> MapMaker:
    """A map whose model is an inverse, whose atlas uv are spread over the square."""

    def make(charts: int = 3, **options: Any) -> Any:
        made = make_map(tuple(range(charts)), model=inverse_of(charts), **options)
        uv = np.random.default_rng(3).random((300, 2)).astype(np.float32)
        return dataclasses.replace(made, atlas=dataclasses.replace(made.atlas, uv=uv))

    return make


def export(made: Any, path: Path, **options: Any) -> Any:
    return export_wrap(made.model, PlacedCharts(made.frame, made.atlas, made.charts), path, **options)


def run(path: Path, uv: NDArray[np.float32], chart: NDArray[np.int64]) -> list[NDArray[Any]]:
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return [np.asarray(part) for part in session.run(["points", "normals"], {"uv": uv, "chart": chart})]


@pytest.mark.parametrize("charts", [1, 2, 5])
@pytest.mark.parametrize("n", [0, 1, 2, 65, 1000])
def test_the_file_gives_what_the_networks_give(make_inverse: MapMaker, tmp_path: Path, charts: int, n: int) -> None:
    made = make_inverse(charts)
    export(made, tmp_path / "a.onnx")
    probes = probe_uv(made.atlas, 1000, 5)
    uv, chart = probes[0][:n], probes[1][:n]
    found, truth = run(tmp_path / "a.onnx", uv, chart), Inverse(made.model, made.metadata)(uv, chart)
    for one, other in zip(found, truth, strict=True):
        assert one.shape == other.shape == (n, 3)
        assert np.abs(one - other).max(initial=0.0) < 1e-5
    assert np.abs(np.linalg.norm(found[1], axis=1) - 1.0).max(initial=0.0) < 1e-6


def test_charts_that_lie_over_each_other_are_told_apart(make_inverse: MapMaker) -> None:
    made = make_inverse(4)
    uv = np.random.default_rng(1).uniform(0.02, 0.98, (400, 2)).astype(np.float32)
    chart = np.arange(400) % 4
    points, _ = Inverse(made.model, made.metadata)(uv, chart)
    height = (points[:, 2] - made.frame.centre[2]) / made.frame.scale
    right = np.abs(height - 0.6 * (uv[:, 0] - chart / 4)) < 0.03
    assert right.mean() > 0.98  # a cell without a sample of a chart does not know of it


def test_probes_visit_all_charts_and_stay_in_the_square(make_inverse: MapMaker) -> None:
    uv, chart = probe_uv(make_inverse(5).atlas, 100, 0)
    assert np.bincount(chart, minlength=5).tolist() == [20] * 5
    assert ((uv >= 0.0) & (uv <= 1.0)).all()


@pytest.mark.parametrize("bad", [-1, -3, 3, 1 << 40])
def test_charts_that_do_not_exist_give_nan_and_leave_the_others_alone(
    make_inverse: MapMaker, tmp_path: Path, bad: int
) -> None:
    made = make_inverse(3)
    export(made, tmp_path / "a.onnx")
    uv, chart = probe_uv(made.atlas, 50, 1)
    truth = run(tmp_path / "a.onnx", uv, chart)
    wrong = chart.copy()
    wrong[::7] = bad
    for found, right in zip(run(tmp_path / "a.onnx", uv, wrong), truth, strict=True):
        assert np.isnan(found[::7]).all()
        known = wrong != bad
        assert np.array_equal(found[known], right[known])


def test_no_uv_leads_out_of_the_box_of_the_frame(make_inverse: MapMaker) -> None:
    made = make_inverse()
    far = np.random.default_rng(0).normal(scale=50.0, size=(500, 2)).astype(np.float32)
    points, _ = Inverse(made.model, made.metadata)(far, np.arange(500) % 3)
    assert (np.abs(points - np.asarray(made.frame.centre)) <= made.frame.scale * 1.0001).all()


def test_versions_names_types_and_axes_are_pinned(make_inverse: MapMaker, tmp_path: Path) -> None:
    export(make_inverse(), tmp_path / "a.onnx")
    model = onnx.load(tmp_path / "a.onnx")
    assert [(entry.domain, entry.version) for entry in model.opset_import] == [("", 18)]
    assert model.ir_version == 8
    assert [value.name for value in model.graph.input] == ["uv", "chart"]
    assert [value.name for value in model.graph.output] == ["points", "normals"]
    assert {"centre", "centre_rest", "scale"} <= {tensor.name for tensor in model.graph.initializer}


def test_the_file_describes_itself(make_inverse: MapMaker, tmp_path: Path) -> None:
    made = make_inverse()
    export(made, tmp_path / "a.onnx", metadata=Provenance("cd" * 32, {"charts": 3}, {}))
    text = {entry.key: entry.value for entry in onnx.load(tmp_path / "a.onnx").metadata_props}[METADATA_KEY]
    assert json.loads(text)["kind"] == "wrap"
    assert BundleMetadata.from_json(text).source_sha256 == "cd" * 32


def test_the_same_networks_give_the_same_bytes(make_inverse: MapMaker, tmp_path: Path) -> None:
    for name in ("a", "b"):
        export(make_inverse(), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_far_away_surface_keeps_its_precision_in_the_session(make_inverse: MapMaker, tmp_path: Path) -> None:
    far, near = make_inverse(centre=(70_000.3, -40_000.7, 12.1)), make_inverse(centre=(0.0, 0.0, 0.0))
    for name, made in (("far", far), ("near", near)):
        export(made, tmp_path / name)
    uv, chart = probe_uv(near.atlas, 200, 2)
    relative = [
        (WrapSession(tmp_path / name).wrap(uv, chart).points - np.asarray(made.frame.centre)) / made.frame.scale
        for name, made in (("far", far), ("near", near))
    ]
    assert np.abs(relative[0] - relative[1]).max() < 1e-6


def test_wrong_numbers_are_found(make_inverse: MapMaker) -> None:
    made = make_inverse()
    inverse = Inverse(made.model, made.metadata)
    content, probes = build_inverse(inverse, FileKind()), probe_uv(made.atlas, 1000, 0)
    prove_inverse(inverse, content, probes, WrapParitySpec())
    other = dataclasses.replace(made.model, weights=made.model.weights * np.float32(1.01))
    with pytest.raises(ParityError, match="points at n = "):
        prove_inverse(Inverse(other, made.metadata), content, probes, WrapParitySpec())


def test_disagreement_leaves_nothing_and_an_older_file_alone(make_inverse: MapMaker, tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"older")
    with pytest.raises(ParityError, match="ties between gates"):
        export(make_inverse(), tmp_path / "a.onnx", spec=WrapSpec(parity=WrapParitySpec(tie=1e9)))
    assert (tmp_path / "a.onnx").read_bytes() == b"older"
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]


def test_networks_of_other_outputs_are_refused(make_inverse: MapMaker, tmp_path: Path) -> None:
    made = make_inverse()
    narrow = dataclasses.replace(made.model, weights=made.model.weights[:, :2])
    with pytest.raises(ShapeError, match=r"expected \(e, 6, 4\)"):
        export(dataclasses.replace(made, model=narrow), tmp_path / "a.onnx")


def test_a_missing_folder_is_named(make_inverse: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such folder"):
        export(make_inverse(), tmp_path / "none" / "a.onnx")
