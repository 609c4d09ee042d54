"""The exported inverse: equal to the torch model, self-describing, and back where the forward map came from."""

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
import torch
from torch import Tensor, nn

from flexpara.export.metadata import Provenance
from flexpara.export.wrap import WrapSpec, build_inverse, export_wrap
from flexpara.export.wrapgraph import WrapGraph, WrapParitySpec, fold_placement, probe_uv, prove_inverse, ties_between
from flexpara.runtime.errors import FlexparaError, InputError, MissingFileError, ParityError, ShapeError
from flexpara.runtime.sessions.bundle import METADATA_KEY, BundleMetadata
from flexpara.runtime.sessions.wrapsession import WrapSession
from flexpara.train.config import WrapConfig
from flexpara.train.deploy.fit_wrap import AtlasWrap
from flexpara.train.paper.config import PaperNets
from flexpara.train.paper.networks import GlobalNetworks, MultiChartPaperNetworks

MapMaker = Callable[..., Any]
SMALL = WrapConfig(waves=24, assign_waves=20)
PATCHES = [(0,), (0, 0), (0, 1), (0, 1, 1, 2), (2, 0, 1), (2, 2, 0, 2, 1, 0)]


def random_inverse(patch_chart: tuple[int, ...]) -> AtlasWrap:
    """Sine networks that nobody fitted: xyz about 0.3, normals about 1, each patch of a chart best somewhere."""
    model = AtlasWrap(np.asarray(patch_chart), max(patch_chart) + 1, SMALL).requires_grad_(False)
    generator = torch.Generator().manual_seed(0)
    for nets in (model.surface, model.assign):
        for parameter in nets.parameters():
            parameter.copy_(torch.randn(parameter.shape, generator=generator))
        nets.slope.mul_(0.1)
    model.surface.last.mul_(0.1)
    model.surface.bias[..., :3] *= 0.1
    model.assign.bias.mul_(0.1)
    return model


@pytest.fixture
def make_inverse(make_map: MapMaker) -> MapMaker:
    """A map whose model is an inverse, whose atlas uv are spread over the square."""

    def make(patch_chart: tuple[int, ...] = (0, 1, 1, 2), *, model: nn.Module | None = None, **options: Any) -> Any:
        made = make_map(patch_chart, model=model or random_inverse(patch_chart), **options)
        uv = np.random.default_rng(3).random((300, 2)).astype(np.float32)
        return dataclasses.replace(made, atlas=dataclasses.replace(made.atlas, uv=uv))

    return make


def export(made: Any, path: Path, **options: Any) -> Any:
    return export_wrap(made.model, made.frame, made.atlas, made.charts, path, **options)


def run(path: Path, uv: np.ndarray, chart: np.ndarray) -> list[np.ndarray]:
    session = onnxruntime.InferenceSession(path, providers=["CPUExecutionProvider"])
    return [np.asarray(part) for part in session.run(["points", "normals"], {"uv": uv, "chart": chart})]


def truth(made: Any, uv: np.ndarray, chart: np.ndarray) -> list[np.ndarray]:
    with torch.no_grad():
        found = WrapGraph(made.model, made.metadata)(torch.from_numpy(uv), torch.from_numpy(chart))
    return [part.numpy() for part in found]


@pytest.mark.parametrize("patch_chart", PATCHES, ids=str)
@pytest.mark.parametrize("n", [1, 2, 65, 1000])
def test_the_file_gives_what_torch_gives(
    make_inverse: MapMaker, tmp_path: Path, patch_chart: tuple[int, ...], n: int
) -> None:
    made = make_inverse(patch_chart)
    export(made, tmp_path / "a.onnx")
    uv, chart = probe_uv(made.atlas, made.charts.face_patch, n, 99)
    found, expected = run(tmp_path / "a.onnx", uv, chart), truth(made, uv, chart)
    assert all((part.shape, part.dtype) == ((n, 3), np.float32) for part in found)
    assert np.abs(found[0] - expected[0]).max() < 2e-5 * made.frame.scale
    assert np.abs(found[1] - expected[1]).max() < 2e-4


class Plane(nn.Module):
    """The plane z = patch / 10 of the unit ball over chart coordinates; its normals have length 7."""

    def wrap(self, uv: Tensor, patch: Tensor) -> tuple[Tensor, Tensor]:
        height = torch.zeros_like(uv[:, :1]) + 0.1 * patch[:, None]
        return torch.cat([uv, height], dim=1), torch.cat([uv * 0.0, height * 0.0 + 7.0], dim=1)


def test_frame_and_placement_are_undone(make_inverse: MapMaker) -> None:
    made = make_inverse((0, 1), model=Plane())
    plane, chart = np.array([[0.2, -0.3], [0.5, 0.1]]), np.array([1, 0])
    placement = made.atlas.placement[chart]
    uv = np.einsum("nij,nj->ni", placement[:, :, :2], plane) + placement[:, :, 2]
    points, normals = truth(made, uv.astype(np.float32), chart)
    xyz = np.concatenate([plane, 0.1 * chart[:, None]], axis=1)
    assert np.abs(points - (xyz * made.frame.scale + np.asarray(made.frame.centre))).max() < 1e-5
    assert np.abs(normals - [0.0, 0.0, 1.0]).max() < 1e-6


def test_probes_visit_all_patches_and_stay_in_the_square(make_inverse: MapMaker) -> None:
    made = make_inverse((0, 1, 1, 2))
    uv, chart = probe_uv(made.atlas, made.charts.face_patch, 400, 0)
    assert np.bincount(chart).tolist() == [100, 200, 100]
    assert (uv.min() >= 0.0, uv.max() <= 1.0, uv.dtype) == (True, True, np.float32)


@pytest.mark.parametrize("bad", [-1, -3, 3, 1 << 40])
def test_charts_that_do_not_exist_give_nan_and_leave_the_others_alone(
    make_inverse: MapMaker, tmp_path: Path, bad: int
) -> None:
    made = make_inverse()
    export(made, tmp_path / "a.onnx")
    uv, chart = probe_uv(made.atlas, made.charts.face_patch, 20, 0)
    whole, wrong = run(tmp_path / "a.onnx", uv, chart), chart.copy()
    wrong[[4, 7]] = bad
    found, expected = run(tmp_path / "a.onnx", uv, wrong), truth(made, uv, wrong)
    lost = np.isin(np.arange(20), [4, 7])
    for part, before, other in zip(found, whole, expected, strict=True):
        assert np.isnan(part[lost]).all()
        assert np.isnan(other[lost]).all()
        assert np.array_equal(part[~lost], before[~lost])


def test_only_unknown_charts_and_no_rows_at_all_are_no_error(make_inverse: MapMaker, tmp_path: Path) -> None:
    export(make_inverse(), tmp_path / "a.onnx")
    points, normals = run(tmp_path / "a.onnx", np.zeros((3, 2), np.float32), np.full(3, 9))
    assert np.isnan(points).all()
    points, normals = run(tmp_path / "a.onnx", np.zeros((0, 2), np.float32), np.zeros(0, np.int64))
    assert (points.shape, normals.shape) == ((0, 3), (0, 3))


def test_no_uv_leads_out_of_the_box_of_the_frame(make_inverse: MapMaker) -> None:
    made = make_inverse((0, 1), model=Plane())
    made = dataclasses.replace(made, atlas=dataclasses.replace(made.atlas, placement=made.atlas.placement * 1e-3))
    session_uv = np.random.default_rng(0).random((100, 2)).astype(np.float32)
    points, _ = truth(made, session_uv, np.zeros(100, np.int64))
    assert np.abs(points - np.asarray(made.frame.centre)).max() <= made.frame.scale * (1.0 + 1e-6)


def test_versions_names_types_and_axes_are_pinned(make_inverse: MapMaker, tmp_path: Path) -> None:
    export(make_inverse(), tmp_path / "a.onnx")
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
        "uv": ("FLOAT", ["n", 2]),
        "chart": ("INT64", ["n"]),
        "points": ("FLOAT", ["n", 3]),
        "normals": ("FLOAT", ["n", 3]),
    }
    assert not any(tensor.external_data for tensor in model.graph.initializer)
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]


def test_the_file_describes_itself(make_inverse: MapMaker, tmp_path: Path) -> None:
    made = make_inverse()
    provenance = Provenance("c0ffee", {"charts": 3}, {"isometric_mean": 0.001})
    export(made, tmp_path / "a.onnx", metadata=provenance)
    (entry,) = onnx.load(tmp_path / "a.onnx").metadata_props
    assert (entry.key, json.loads(entry.value)["kind"]) == (METADATA_KEY, "wrap")
    assert BundleMetadata.from_json(entry.value) == dataclasses.replace(
        made.metadata, source_sha256="c0ffee", settings=provenance.settings, metrics=provenance.metrics
    )


def test_the_same_model_gives_the_same_bytes(make_inverse: MapMaker, tmp_path: Path) -> None:
    export(make_inverse(), tmp_path / "a.onnx")
    export(make_inverse(), tmp_path / "b.onnx")
    assert (tmp_path / "a.onnx").read_bytes() == (tmp_path / "b.onnx").read_bytes()


def test_a_far_away_surface_keeps_its_precision_in_the_session(make_inverse: MapMaker, tmp_path: Path) -> None:
    far, near = make_inverse(centre=(70_000.3, -40_000.7, 12.1)), make_inverse(centre=(0.0, 0.0, 0.0))
    export(far, tmp_path / "far.onnx")
    export(near, tmp_path / "near.onnx")
    uv, chart = probe_uv(far.atlas, far.charts.face_patch, 500, 5)
    offset = np.asarray(far.frame.centre) - np.asarray(near.frame.centre)
    points = WrapSession(tmp_path / "far.onnx").wrap(uv, chart).points
    assert np.abs(points - WrapSession(tmp_path / "near.onnx").wrap(uv, chart).points - offset).max() < 1e-5


def test_every_wrong_initializer_is_found(make_inverse: MapMaker) -> None:
    made = make_inverse((0, 1, 2, 1))
    content = build_inverse(made.model, made.metadata, WrapSpec())
    probes = probe_uv(made.atlas, made.charts.face_patch, 1000, 0)
    graph = WrapGraph(made.model, made.metadata)
    assert prove_inverse(graph, content, probes, WrapParitySpec()).ties < 20
    floats = [t for t in onnx.load_from_string(content).graph.initializer if t.data_type == onnx.TensorProto.FLOAT]
    assert len(floats) > 20
    unnoticed: list[float] = []
    for tensor in floats:
        model = onnx.load_from_string(content)
        (wrong,) = (t for t in model.graph.initializer if t.name == tensor.name)
        changed = onnx.numpy_helper.to_array(tensor) * np.float32(-1.3) + np.float32(0.1)
        wrong.CopyFrom(onnx.numpy_helper.from_array(changed, tensor.name))
        try:
            prove_inverse(graph, model.SerializeToString(), probes, WrapParitySpec())
        except ParityError:
            continue
        unnoticed.append(float(onnx.numpy_helper.to_array(tensor).reshape(-1)[0]))
    # the least length of a normal, which none comes near; and NaN, for rows of no chart, which no probe is
    assert sorted(unnoticed, key=np.isnan) == pytest.approx([1e-12, np.nan], nan_ok=True)


def test_missing_patches_are_no_ties() -> None:
    scores = torch.tensor([[0.5, 0.5, 0.0], [0.5, -torch.inf, -torch.inf], [0.5, 0.6, -torch.inf]])
    assert ties_between(scores, 1e-4).tolist() == [True, False, False]
    assert ties_between(scores[:, :1], 1e-4).tolist() == [False, False, False]


def test_disagreement_leaves_nothing_and_an_older_file_alone(make_inverse: MapMaker, tmp_path: Path) -> None:
    (tmp_path / "a.onnx").write_bytes(b"older")
    spec = WrapSpec(parity=WrapParitySpec(sizes=(1000,), normals_atol=1e-12))
    with pytest.raises(ParityError, match=r"normals at n = 1000: max \|Δ\| = .* expected at most 1e-12"):
        export(make_inverse(), tmp_path / "a.onnx", spec=spec)
    assert (tmp_path / "a.onnx").read_bytes() == b"older"
    assert [path.name for path in tmp_path.iterdir()] == ["a.onnx"]


@pytest.mark.parametrize("patch_chart", [(0, 1, 2), (0, 1, 1)], ids=str)
def test_charts_of_another_fit_are_refused(
    make_inverse: MapMaker, tmp_path: Path, patch_chart: tuple[int, ...]
) -> None:
    made = make_inverse(patch_chart, model=random_inverse((0, 1)))
    with pytest.raises(ShapeError, match=r"expected xyz \(3, 3\) .* pass the charts it was fitted to"):
        export(made, tmp_path / "a.onnx")
    assert list(tmp_path.iterdir()) == []


def test_a_model_that_cannot_choose_between_patches_is_refused(make_inverse: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(ShapeError, match=r"no attribute 'patch_scores'.* and patch_scores \(3, 2\)"):
        export(make_inverse((0, 0), model=Plane()), tmp_path / "a.onnx")


def test_a_placement_without_an_inverse_is_refused(make_inverse: MapMaker) -> None:
    made = make_inverse()
    made.atlas.placement[1, 1, :2] = 2.0 * made.atlas.placement[1, 0, :2]
    with pytest.raises(InputError, match="placement of chart 1 has determinant"):
        fold_placement(made.metadata)


def test_a_missing_folder_is_named(make_inverse: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(MissingFileError, match="nowhere: no such folder"):
        export(make_inverse(), tmp_path / "nowhere" / "a.onnx")


class Sorted(Plane):
    """Uses an operation without a twin."""

    def wrap(self, uv: Tensor, patch: Tensor) -> tuple[Tensor, Tensor]:
        xyz, normal = super().wrap(uv.sort(dim=0).values, patch)
        return xyz, normal


def test_an_unknown_operation_is_named(make_inverse: MapMaker, tmp_path: Path) -> None:
    with pytest.raises(FlexparaError, match="sort"):
        export(make_inverse((0,), model=Sorted()), tmp_path / "a.onnx")


@pytest.mark.parametrize("patch_chart", [(0,), (0, 1, 2)], ids=str)
def test_the_networks_of_the_paper_can_be_exported(
    make_inverse: MapMaker, tmp_path: Path, patch_chart: tuple[int, ...]
) -> None:
    nets, generator = PaperNets(hidden=32), torch.Generator().manual_seed(0)
    many = len(patch_chart) > 1
    model = MultiChartPaperNetworks(3, nets, generator=generator) if many else GlobalNetworks(nets, generator=generator)
    made = make_inverse(patch_chart, model=model)
    report = export(made, tmp_path / "a.onnx")
    assert (report.compared, report.ties) == (1003, 0)
    uv, chart = probe_uv(made.atlas, made.charts.face_patch, 50, 0)
    expected, found = truth(made, uv, chart), WrapSession(tmp_path / "a.onnx").wrap(uv, chart)
    assert np.abs(found.points - expected[0]).max() < 1e-4
    assert np.abs(found.normals - expected[1]).max() < 1e-4
