"""The exported file: equal to the torch model, self-describing, reproducible, and absent when anything is wrong."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import onnxruntime
import pytest
import torch
from torch import Tensor, nn

from flexpara.export.graph.metadata import PlacedCharts, Provenance
from flexpara.export.graph.parity import ParitySpec
from flexpara.export.paper.torchfile import ExportSpec, export_onnx
from flexpara.export.paper.torchmodel import UnwrapGraph
from flexpara.runtime.errors import FlexparaError, InputError, MissingFileError, ParityError, ShapeError
from flexpara.runtime.sessions.bundle import METADATA_KEY, BundleMetadata

MapMaker = Callable[..., Any]
DENSE = ExportSpec(routed=False)


def export(made: Any, path: Path, **options: Any) -> Any:
    return export_onnx(made.model, PlacedCharts(made.frame, made.atlas, made.charts), path, **options)


def run(path: Path, points: np.ndarray) -> list[np.ndarray]:
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return [np.asarray(output) for output in session.run(["uv", "chart", "score"], {"points": points})]


@pytest.mark.parametrize("patch_chart", [(0,), (0, 0), (0, 1), (0, 1, 1, 2), (2, 0, 1)], ids=str)
@pytest.mark.parametrize("spec", [ExportSpec(), DENSE], ids=["routed", "dense"])
@pytest.mark.parametrize("n", [1, 2, 65, 1000])
def test_the_file_gives_what_torch_gives(
    make_map: MapMaker, tmp_path: Path, patch_chart: tuple[int, ...], spec: ExportSpec, n: int
) -> None:
    made = make_map(patch_chart)
    export(made, tmp_path / "a.onnx", spec=spec)
    points = made.probes(n, seed=99)
    with torch.no_grad():
        truth = UnwrapGraph(made.model, made.metadata)(torch.from_numpy(points))
    uv, chart, score = run(tmp_path / "a.onnx", points)
    assert (uv.shape, uv.dtype, chart.dtype, score.shape, score.dtype) == ((n, 2), "float32", "int64", (n,), "float32")
    assert np.array_equal(chart, truth[1].numpy())
    assert np.abs(uv - truth[0].numpy()).max() < 2e-6
    assert np.abs(score - truth[2].numpy()).max() < 2e-6


def test_probes_reach_every_patch_so_that_the_proof_means_something(make_map: MapMaker, tmp_path: Path) -> None:
    made = make_map((0, 1, 2, 3))
    report = export(made, tmp_path / "a.onnx")
    uv, chart, _ = run(tmp_path / "a.onnx", made.probes(1000))
    assert np.bincount(chart, minlength=4).min() >= 10
    assert ((uv > 0.0) & (uv < 1.0)).all(axis=1).mean() > 0.9
    assert (report.sizes, report.compared + report.ties, report.patches) == ((1, 2, 1000), 1003, 4)
    assert 0.0 <= report.uv_error < 2e-6


def test_a_far_away_surface_keeps_its_precision(make_map: MapMaker, tmp_path: Path) -> None:
    far, near = make_map((0, 1), centre=(70_000.3, -40_000.7, 12.1)), make_map((0, 1), centre=(0.0, 0.0, 0.0))
    export(far, tmp_path / "far.onnx")
    export(near, tmp_path / "near.onnx")
    points = far.probes(500, seed=5)
    centred = (points.astype(np.float64) - np.asarray(far.frame.centre) + np.asarray(near.frame.centre)).astype(
        np.float32
    )
    assert np.abs(run(tmp_path / "far.onnx", points)[0] - run(tmp_path / "near.onnx", centred)[0]).max() < 2e-5


@pytest.mark.parametrize("spec", [ExportSpec(), DENSE], ids=["routed", "dense"])
def test_points_off_the_surface_still_get_a_texel(make_map: MapMaker, tmp_path: Path, spec: ExportSpec) -> None:
    made = make_map()
    export(made, tmp_path / "a.onnx", spec=spec)
    points = (np.random.default_rng(0).normal(size=(500, 3)) * 100.0).astype(np.float32)
    uv, _, score = run(tmp_path / "a.onnx", points)
    with torch.no_grad():
        truth = UnwrapGraph(made.model, made.metadata)(torch.from_numpy(points))[0].numpy()
    assert (uv.min(), uv.max()) == (0.0, 1.0)
    assert np.abs(uv - truth).max() < 1e-4
    assert ((score >= 0.0) & (score <= 1.0 + 1e-6)).all()


def test_no_points_are_no_error(make_map: MapMaker, tmp_path: Path) -> None:
    export(make_map(), tmp_path / "a.onnx")
    uv, chart, score = run(tmp_path / "a.onnx", np.zeros((0, 3), np.float32))
    assert (uv.shape, chart.shape, score.shape) == ((0, 2), (0,), (0,))


def test_versions_names_types_and_axes_are_pinned(make_map: MapMaker, tmp_path: Path) -> None:
    export(make_map(), tmp_path / "a.onnx")
    model = onnx.load(tmp_path / "a.onnx")
    assert (model.ir_version, [(entry.domain, entry.version) for entry in model.opset_import]) == (8, [("", 18)])
    ends = {
        end.name: (
            onnx.TensorProto.DataType.Name(end.type.tensor_type.elem_type),
            [axis.dim_param or axis.dim_value for axis in end.type.tensor_type.shape.dim],
        )
        for end in (*model.graph.input, *model.graph.output)
    }
    assert ends == {
        "points": ("FLOAT", ["n", 3]),
        "uv": ("FLOAT", ["n", 2]),
        "chart": ("INT64", ["n"]),
        "score": ("FLOAT", ["n"]),
    }
    assert not any(tensor.external_data for tensor in model.graph.initializer)
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]


def test_the_file_describes_itself(make_map: MapMaker, tmp_path: Path) -> None:
    made = make_map()
    provenance = Provenance("c0ffee", {"charts": 3, "net": {"width": 64}}, {"isometric_mean": 0.001})
    export(made, tmp_path / "a.onnx", metadata=provenance)
    (entry,) = onnx.load(tmp_path / "a.onnx").metadata_props
    facts = BundleMetadata.from_json(entry.value)
    assert entry.key == METADATA_KEY
    assert facts == dataclasses.replace(
        made.metadata, source_sha256="c0ffee", settings=provenance.settings, metrics=provenance.metrics
    )


def test_the_same_model_gives_the_same_bytes(make_map: MapMaker, tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    export(make_map(), tmp_path / "a.onnx")
    export(make_map(), tmp_path / "elsewhere" / "b.onnx")
    assert (tmp_path / "a.onnx").read_bytes() == (tmp_path / "elsewhere" / "b.onnx").read_bytes()


def test_nothing_of_the_machine_is_in_the_file(make_map: MapMaker, tmp_path: Path) -> None:
    export(make_map(), tmp_path / "a.onnx")
    content = (tmp_path / "a.onnx").read_bytes()
    for trace in (b".py", b"/", b"PlainNetworks", str(tmp_path).encode()):
        weights_removed = onnx.load_from_string(content)
        del weights_removed.graph.initializer[:]
        names = [
            *(prop.key for prop in weights_removed.metadata_props),
            *(node.name for node in weights_removed.graph.node),
        ]
        del weights_removed.metadata_props[:]
        assert trace not in weights_removed.SerializeToString()
        assert not any(trace.decode() in name for name in names)
    assert not any(node.metadata_props or node.doc_string for node in onnx.load_from_string(content).graph.node)


def test_export_is_silent(make_map: MapMaker, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        export(make_map(), tmp_path / "a.onnx")
    assert (caught, *capfd.readouterr()) == ([], "", "")


def test_the_model_is_left_as_it_was(make_map: MapMaker, tmp_path: Path) -> None:
    model = make_map().model.double().train()
    before = {name: weight.clone() for name, weight in model.state_dict().items()}
    export(make_map(model=model), tmp_path / "a.onnx")
    assert model.training
    assert all(parameter.requires_grad for parameter in model.parameters())
    assert all(torch.equal(weight, before[name]) for name, weight in model.state_dict().items())


class MixedPatches(nn.Module):
    """Each patch's uv depends on the weights of all patches: cut to one patch, it is another function."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.linspace(-1.0, 1.0, 18).reshape(3, 3, 2))

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        everything = torch.einsum("nc,qcu->nu", xyz, self.weight)
        return xyz * 3.0, (xyz @ self.weight).transpose(0, 1) + everything.unsqueeze(1)


class NotAPatchAxis(nn.Module):
    """A parameter (3, 3, 2) whose first axis is x, y, z: it can't be cut."""

    def __init__(self) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.linspace(-1.0, 1.0, 18).reshape(3, 3, 2))

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        return xyz * 3.0, torch.einsum("nc,cpu->npu", xyz, self.weight)


@pytest.mark.parametrize(
    ("model", "error", "message"),
    [(MixedPatches(), ParityError, "nothing was written"), (NotAPatchAxis(), FlexparaError, "routed=False")],
    ids=["another function", "another shape"],
)
def test_a_model_that_cannot_be_cut_is_an_error_and_leaves_no_file(
    make_map: MapMaker, tmp_path: Path, model: nn.Module, error: type[FlexparaError], message: str
) -> None:
    made = make_map((0, 1, 2), model=model)
    with pytest.raises(error, match=message) as caught:
        export(made, tmp_path / "a.onnx")
    assert "\n" not in str(caught.value)
    assert list(tmp_path.iterdir()) == []
    assert export(made, tmp_path / "a.onnx", spec=DENSE).patches == 3


def test_a_failed_export_leaves_an_older_file_alone(make_map: MapMaker, tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"older")
    with pytest.raises(ParityError, match=r"uv at n = 1000: max \|Δ\| = .* expected at most 1e-12"):
        export(make_map(), tmp_path / "a.onnx", spec=ExportSpec(parity=ParitySpec(sizes=(1000,), uv_atol=1e-12)))
    assert (tmp_path / "a.onnx").read_bytes() == b"older"
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]


@pytest.mark.parametrize("patches", [1, 3])
def test_charts_of_another_fit_are_refused(make_map: MapMaker, tmp_path: Path, patches: int) -> None:
    made = make_map((0,) * patches, model=make_map((0, 0)).model)
    with pytest.raises(ShapeError, match=rf"logits \(3, 2\) .* expected p = {patches} patches"):
        export(made, tmp_path / "a.onnx")
    assert list(tmp_path.iterdir()) == []


def test_a_missing_folder_is_named(make_map: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="nowhere: no such folder"):
        export(make_map(), tmp_path / "nowhere" / "a.onnx")


@pytest.mark.parametrize("bad", [float("nan"), np.float32(1.0), Path("x")], ids=["nan", "numpy", "path"])
def test_metrics_that_json_cannot_hold_are_refused(make_map: MapMaker, tmp_path: Path, bad: object) -> None:
    with pytest.raises(InputError, match="convert them first"):
        export(make_map(), tmp_path / "a.onnx", metadata=Provenance(metrics={"value": bad}))
    assert list(tmp_path.iterdir()) == []
