"""The paper's networks go through the same ONNX contract as the fitted ones: written only when onnxruntime agrees."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from flexpara.export.graph.metadata import PlacedCharts
from flexpara.export.paper.torchfile import export_onnx
from flexpara.runtime.mesh import Atlas, Charts, Frame
from flexpara.runtime.sessions.session import UnwrapSession
from flexpara.train.paper.config import PaperConfig, PaperNets
from flexpara.train.paper.training import make_networks

if TYPE_CHECKING:
    from pathlib import Path

NETS = PaperNets(hidden=24, embedding=8)


def placed(charts: int) -> tuple[Frame, Atlas, Charts]:
    """A sphere's points as an atlas of ``charts`` charts, each turned its own way into the unit square."""
    direction = np.random.default_rng(7).normal(size=(300, 3))
    positions = np.array([3.0, -2.0, 5.0]) + 2.5 * direction / np.linalg.norm(direction, axis=1, keepdims=True)
    faces = np.arange(300).reshape(-1, 3)
    label = np.arange(len(faces)) % charts
    turn = np.linspace(0.2, 1.2, charts)
    matrix = 0.2 * np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]).transpose(2, 0, 1)
    placement = np.concatenate([matrix, np.full((charts, 2, 1), 0.5)], axis=2)
    flat = np.zeros((300, 3), np.float32)
    atlas = Atlas(positions, faces, flat[:, :2], flat, label, np.arange(300), 1024, 4, placement)
    corner_uv = np.zeros((len(faces), 3, 2))
    return Frame.of(positions), atlas, Charts(label, corner_uv, label, np.arange(charts), ("slim",) * charts)


@pytest.mark.parametrize("charts", [1, 3])
def test_the_papers_networks_are_exported_and_answer_alike(charts: int, tmp_path: Path) -> None:
    config = PaperConfig("global" if charts == 1 else "multi-chart", charts, nets=NETS)
    networks = make_networks(config, torch.Generator().manual_seed(0))
    frame, atlas, shape = placed(charts)
    report = export_onnx(networks, PlacedCharts(frame, atlas, shape), tmp_path / "map.onnx")
    assert report is not None
    uv, chart, score = UnwrapSession(tmp_path / "map.onnx").unwrap(atlas.positions)
    with torch.no_grad():
        logits, every = networks(torch.from_numpy(frame.apply(atlas.positions)).float())
    patch = logits.argmax(dim=1).numpy()
    own = every.numpy()[np.arange(300), patch]
    assert atlas.placement is not None
    expected = np.einsum("nij,nj->ni", atlas.placement[patch, :, :2], own) + atlas.placement[patch, :, 2]
    np.testing.assert_array_equal(chart, patch)
    np.testing.assert_allclose(uv, np.clip(expected, 0.0, 1.0), atol=1e-5)
    assert np.ptp(expected) > 0.01
    np.testing.assert_allclose(score, torch.softmax(logits, dim=1).amax(dim=1).numpy(), atol=1e-5)
