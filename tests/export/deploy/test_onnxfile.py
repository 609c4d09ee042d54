"""The exported networks: equal to their numpy twin, self-describing, reproducible, small, and absent when wrong."""

from __future__ import annotations

import dataclasses
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
from numpy.typing import NDArray
from onnx import numpy_helper

from flexpara.export.deploy.onnxfile import NetworkSpec, NetworkTruth, build_networks, export_networks, place
from flexpara.export.graph.metadata import PlacedCharts, Provenance, bundle_metadata
from flexpara.export.graph.parity import ParityReport, ParitySpec, prove_parity
from flexpara.export.graph.proven import FileKind
from flexpara.runtime.errors import InputError, MissingFileError, ParityError, ShapeError
from flexpara.runtime.sessions.bundle import METADATA_KEY, BundleMetadata
from flexpara.runtime.sessions.session import UnwrapSession
from flexpara.train.deploy.config import GrowConfig
from flexpara.train.deploy.experts import Lesson
from flexpara.train.deploy.gated import GatedExperts
from flexpara.train.deploy.grow import grow

MapMaker = Callable[..., Any]


def networks_of(charts: int, *, bend: float = 3.0, config: GrowConfig | None = None, seed: int = 0) -> GatedExperts:
    """Octants and more of the unit ball as charts; uv are sines of the position, so that experts are many."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, (20_000, 3))
    label = (np.arctan2(x[:, 1], x[:, 0]) / (2.0 * np.pi) * charts).astype(np.int64) % charts
    y = np.sin(bend * x[:, :2] + label[:, None])
    slope = np.zeros((len(x), 2, 3))
    return grow(Lesson(x, y, label, slope, np.full((len(x), 4), np.nan)), config or GrowConfig(), 0.05, rng)


@pytest.fixture
def make_networks(make_map: MapMaker) -> MapMaker:
    """A map whose model are gated networks."""

    def make(charts: int = 3, *, model: GatedExperts | None = None, **options: Any) -> Any:
        return make_map(tuple(range(charts)), model=model or networks_of(charts), **options)

    return make


def export(made: Any, path: Path, **options: Any) -> ParityReport:
    return export_networks(made.model, PlacedCharts(made.frame, made.atlas, made.charts), path, **options)


def run(path: Path, points: NDArray[np.float32]) -> list[NDArray[Any]]:
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return [np.asarray(part) for part in session.run(["uv", "chart", "score"], {"points": points})]


@pytest.mark.parametrize("charts", [1, 2, 7])
@pytest.mark.parametrize("n", [0, 1, 2, 65, 1000])
def test_the_file_gives_what_the_networks_give(make_networks: MapMaker, tmp_path: Path, charts: int, n: int) -> None:
    made = make_networks(charts)
    export(made, tmp_path / "a.onnx")
    points = made.probes(1000)[:n]
    uv, chart, score = run(tmp_path / "a.onnx", points)
    truth = NetworkTruth(place(made.model, made.metadata), made.metadata, 1e-6)(points)
    assert np.abs(uv - truth.uv).max(initial=0.0) < 1e-6
    assert np.array_equal(chart, truth.chart)
    assert np.abs(score - truth.score).max(initial=0.0) < 1e-5
    assert (uv.shape, uv.dtype, chart.dtype, score.dtype) == ((n, 2), np.float32, np.int64, np.float32)


def test_networks_without_a_gate_and_with_a_single_cell_can_be_exported(
    make_networks: MapMaker, tmp_path: Path
) -> None:
    flat = networks_of(1, bend=1e-6, config=GrowConfig(coarsest=1, cells=1))
    assert (len(flat.gates), len(flat.label), flat.grid.count) == (0, 1, 1)
    report = export(make_networks(1, model=flat), tmp_path / "a.onnx")
    assert report.uv_error < 1e-6


def test_frame_and_placement_are_folded_in_by_hand(make_networks: MapMaker) -> None:
    made = make_networks(3)
    placed, points = place(made.model, made.metadata), made.probes(100)
    truth = NetworkTruth(placed, made.metadata, 1e-6)(points)
    plain = made.model(made.frame.apply(points.astype(np.float64)).astype(np.float32))
    turn = made.metadata.placement_array()[plain.label]
    uv = np.einsum("nij,nj->ni", turn[:, :, :2], plain.value) + turn[:, :, 2]
    assert np.array_equal(truth.chart, plain.label)
    assert np.abs(truth.uv - uv.clip(0.0, 1.0)).max() < 1e-5


def test_the_graph_grows_with_the_ways_and_not_with_the_experts(make_networks: MapMaker, tmp_path: Path) -> None:
    nodes = []
    for config in (GrowConfig(deepest=2, cells=64), GrowConfig(deepest=2, cells=8000)):
        export(make_networks(3, model=networks_of(3, config=config)), tmp_path / "a.onnx")
        nodes.append(len(onnx.load(tmp_path / "a.onnx").graph.node))
    assert nodes[0] == nodes[1] < 150


def test_versions_names_types_and_axes_are_pinned(make_networks: MapMaker, tmp_path: Path) -> None:
    export(make_networks(), tmp_path / "a.onnx", spec=NetworkSpec(kind=FileKind(opset=18, ir_version=8)))
    model = onnx.load(tmp_path / "a.onnx")
    assert [(entry.domain, entry.version) for entry in model.opset_import] == [("", 18)]
    assert model.ir_version == 8
    assert {node.domain for node in model.graph.node} == {""}
    assert [value.name for value in model.graph.input] == ["points"]
    assert [value.name for value in model.graph.output] == ["uv", "chart", "score"]


def test_the_file_describes_itself(make_networks: MapMaker, tmp_path: Path) -> None:
    made = make_networks()
    export(made, tmp_path / "a.onnx", metadata=Provenance("ab" * 32, {"charts": 3}, {"charts": 3}))
    text = {entry.key: entry.value for entry in onnx.load(tmp_path / "a.onnx").metadata_props}[METADATA_KEY]
    facts = BundleMetadata.from_json(text)
    assert (facts.chart_count, facts.frame, facts.source_sha256) == (3, made.frame, "ab" * 32)


def test_the_same_networks_give_the_same_bytes(make_networks: MapMaker, tmp_path: Path) -> None:
    for name in ("a", "b"):
        export(make_networks(), tmp_path / name)
    assert (tmp_path / "a").read_bytes() == (tmp_path / "b").read_bytes()


def test_a_far_away_surface_keeps_its_precision_in_the_session(make_networks: MapMaker, tmp_path: Path) -> None:
    far = make_networks(centre=(70_000.3, -40_000.7, 12.1))
    export(far, tmp_path / "a.onnx")
    xyz = np.random.default_rng(0).uniform(-0.5, 0.5, (300, 3))
    points = xyz * far.frame.scale + np.asarray(far.frame.centre)
    answer = UnwrapSession(tmp_path / "a.onnx").unwrap(points)
    truth = place(far.model, far.metadata)(xyz.astype(np.float32))
    same = answer.chart == truth.label
    assert same.mean() > 0.99
    assert np.percentile(np.abs(answer.uv - truth.value.clip(0.0, 1.0))[same], 99) < 1e-5


def changed(content: bytes, name: str) -> bytes:
    model = onnx.load_from_string(content)
    (tensor,) = (tensor for tensor in model.graph.initializer if tensor.name == name)
    value = numpy_helper.to_array(tensor)
    wrong = value * np.float32(1.3) + np.float32(0.1) if value.dtype == np.float32 else value[::-1].copy()
    tensor.CopyFrom(numpy_helper.from_array(wrong, name))
    return model.SerializeToString()


def test_wrong_numbers_are_found(make_networks: MapMaker) -> None:
    """All that are larger than a handful: the frame, the table of experts, gates, sides, start."""
    made = make_networks()
    placed = place(made.model, made.metadata)
    content = build_networks(placed, made.metadata, FileKind())
    model = NetworkTruth(placed, made.metadata, 1e-6)
    prove_parity(model, content, made.probes(1000), ParitySpec())
    sizes = {t.name: int(np.prod(t.dims)) for t in onnx.load_from_string(content).graph.initializer}
    large = [name for name, size in sizes.items() if size > 20 or name in ("centre", "scale")]
    assert len(large) >= 6
    for name in large:
        with pytest.raises(ParityError):
            prove_parity(model, changed(content, name), made.probes(1000), ParitySpec())


def test_a_failed_proof_leaves_an_older_file_alone(make_networks: MapMaker, tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"older")
    nothing_is_clear = NetworkSpec(parity=ParitySpec(tie=1e9))
    with pytest.raises(ParityError, match="ties"):
        export(make_networks(), tmp_path / "a.onnx", spec=nothing_is_clear)
    assert (tmp_path / "a.onnx").read_bytes() == b"older"
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]


def test_networks_of_other_charts_are_refused(make_networks: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match="charts below 2"):
        export(make_networks(2, model=networks_of(3)), tmp_path / "a.onnx")


def test_networks_of_other_outputs_are_refused(make_networks: MapMaker, tmp_path: Path) -> None:
    made = make_networks()
    wide = dataclasses.replace(made.model, weights=np.repeat(made.model.weights, 3, axis=1))
    with pytest.raises(ShapeError, match=r"expected \(e, 2, 4\)"):
        export(dataclasses.replace(made, model=wide), tmp_path / "a.onnx")


def test_a_missing_folder_is_named(make_networks: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="no such folder"):
        export(make_networks(), tmp_path / "none" / "a.onnx")


def test_metrics_that_json_cannot_hold_are_refused(make_networks: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="metadata"):
        export(make_networks(), tmp_path / "a.onnx", metadata=Provenance(metrics={"x": float("nan")}))


def test_fitting_and_exporting_need_no_torch() -> None:
    code = """
import importlib.abc, sys
class Blocked(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] == "torch":
            raise ModuleNotFoundError("torch is not installed here")
sys.meta_path.insert(0, Blocked())
import flexpara.export.deploy.onnxfile, flexpara.export.deploy.wrapfile
import flexpara.train.deploy.fit, flexpara.train.deploy.fit_wrap
import flexpara.train.deploy.config
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_bundle_metadata_is_what_the_session_reads(make_networks: MapMaker, tmp_path: Path) -> None:
    made = make_networks()
    export(made, tmp_path / "a.onnx")
    written = bundle_metadata(PlacedCharts(made.frame, made.atlas, made.charts), Provenance())
    assert UnwrapSession(tmp_path / "a.onnx").metadata == written
