"""The proof itself: it has to find what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import onnx
import pytest
import torch
from onnx import numpy_helper
from torch import Tensor, nn

from flexpara.export.graph.parity import ParityReport, ParitySpec, probe_points, prove_parity
from flexpara.export.paper.torchfile import ExportSpec, build_model
from flexpara.export.paper.torchmodel import UnwrapGraph, truth_of
from flexpara.runtime.errors import ParityError

MapMaker = Callable[..., Any]


def prove(made: Any, content: bytes, spec: ParitySpec | None = None) -> ParityReport:
    spec = spec or ParitySpec()
    return prove_parity(truth_of(UnwrapGraph(made.model, made.metadata), spec.tie), content, made.probes(1000), spec)


def changed(content: bytes, name: str, change: Callable[[np.ndarray], np.ndarray]) -> bytes:
    model = onnx.load_from_string(content)
    (tensor,) = (tensor for tensor in model.graph.initializer if tensor.name == name)
    tensor.CopyFrom(numpy_helper.from_array(change(numpy_helper.to_array(tensor)), name))
    return model.SerializeToString()


def test_an_honest_graph_passes(make_map: MapMaker) -> None:
    made = make_map()
    report = prove(made, build_model(made.model, made.metadata, ExportSpec()))
    assert report.uv_error <= ParitySpec().uv_atol
    assert report.ties < 20


@pytest.mark.parametrize("name", ["centre", "centre_rest", "scale"])
def test_a_slightly_wrong_frame_is_found(make_map: MapMaker, name: str) -> None:
    made = make_map()
    wrong = changed(build_model(made.model, made.metadata, ExportSpec()), name, lambda value: value + np.float32(5e-3))
    with pytest.raises(ParityError, match="nothing was written"):
        prove(made, wrong)


def test_every_wrong_initializer_is_found(make_map: MapMaker) -> None:
    made = make_map((0, 1, 2, 1))
    content = build_model(made.model, made.metadata, ExportSpec())
    floats = [
        tensor.name
        for tensor in onnx.load_from_string(content).graph.initializer
        if tensor.data_type == onnx.TensorProto.FLOAT
    ]
    assert len(floats) > 15
    unnoticed: list[str] = []
    for name in floats:
        try:
            prove(made, changed(content, name, lambda value: value * np.float32(1.3) + np.float32(0.1)))
        except ParityError:
            continue
        unnoticed.append(name)
    assert unnoticed == floats[-2:]  # the bounds 0 and 1 of the clamp, which no point near this surface reaches


def test_a_frozen_axis_is_found(make_map: MapMaker) -> None:
    made = make_map()
    model = onnx.load_from_string(build_model(made.model, made.metadata, ExportSpec()))
    model.graph.input[0].type.tensor_type.shape.dim[0].dim_value = 1000
    with pytest.raises(ParityError, match="can't run the graph at n = 1"):
        prove(made, model.SerializeToString())


def test_a_broken_graph_is_found(make_map: MapMaker) -> None:
    made = make_map()
    model = onnx.load_from_string(build_model(made.model, made.metadata, ExportSpec()))
    del model.graph.node[0]
    with pytest.raises(ParityError, match="can't load the graph"):
        prove(made, model.SerializeToString())


def test_an_output_of_another_type_is_found(make_map: MapMaker) -> None:
    made = make_map()
    model = onnx.load_from_string(build_model(made.model, made.metadata, ExportSpec()))
    for node in model.graph.node:
        node.output[:] = ["score_32" if name == "score" else name for name in node.output]
    model.graph.node.append(onnx.helper.make_node("Cast", ["score_32"], ["score"], to=onnx.TensorProto.DOUBLE))
    model.graph.output[2].type.tensor_type.elem_type = onnx.TensorProto.DOUBLE
    with pytest.raises(ParityError, match="float64 from onnxruntime"):
        prove(made, model.SerializeToString())


class Undecided(nn.Module):
    """All patches equally probable everywhere."""

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        return xyz[:, :2] * 0.0, torch.stack([xyz[:, :2], xyz[:, 1:]], dim=1)


def test_a_model_that_never_decides_is_refused(make_map: MapMaker) -> None:
    decided, undecided = make_map((0, 1)), make_map((0, 1), model=Undecided())
    with pytest.raises(ParityError, match="ties between patches"):
        prove(undecided, build_model(decided.model, decided.metadata, ExportSpec()))


def test_probes_lie_on_the_surface_and_in_the_ball(make_map: MapMaker) -> None:
    made = make_map(centre=(5.0, 6.0, 7.0), radius=3.0)
    points = made.probes(400, seed=0)
    corner = made.atlas.positions[made.atlas.faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    height = np.abs(np.einsum("nfx,fx->nf", points[:, None] - corner[None, :, 0], normal)).min(axis=1)
    assert 200 <= (height < 1e-5).sum() <= 210
    assert (height < 0.02 * made.frame.scale).sum() >= 300
    assert (np.linalg.norm(points - np.asarray(made.frame.centre), axis=1) <= made.frame.scale * 1.02).all()


def test_probes_near_a_surface_are_no_ties_where_it_lies_in_the_plane_between_two_patches(make_map: MapMaker) -> None:
    made = make_map()
    flat = replace(made.atlas, positions=made.atlas.positions * [1.0, 1.0, 0.0])
    points = probe_points(flat, made.frame, np.zeros(len(flat.faces), np.int64), 1000, seed=0)
    assert 450 <= (np.abs(points[:, 2]) > 1e-4).sum() <= 500


def test_probes_visit_a_patch_of_a_single_face(make_map: MapMaker) -> None:
    made = make_map()
    face_patch = np.zeros(len(made.atlas.faces), np.int64)
    face_patch[17] = 5
    points = probe_points(made.atlas, made.frame, face_patch, 100, seed=0)
    corner = made.atlas.positions[made.atlas.faces[17]]
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    height = np.abs((points - corner[0]) @ normal / np.linalg.norm(normal))
    assert 20 <= (height < 1e-5).sum() <= 38


def test_probes_are_the_same_for_the_same_seed(make_map: MapMaker) -> None:
    made = make_map()
    first, second, other = (made.probes(10, seed) for seed in (1, 1, 2))
    assert np.array_equal(first, second)
    assert not np.array_equal(first, other)
