"""The paper's networks as they were trained, in the file format of a finished map."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from flexpara.export.graph.metadata import Provenance
from flexpara.export.paper.raw import MARGIN, raw_atlas, raw_charts, raw_onnx
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.sessions.session import UnwrapSession
from flexpara.train.paper.config import PaperConfig, PaperNets
from flexpara.train.paper.training import make_networks

if TYPE_CHECKING:
    from pathlib import Path

SQUARE = Surface(
    np.array([[2.0, 2.0, 1.0], [6.0, 2.0, 1.0], [6.0, 4.0, 1.0], [2.0, 4.0, 1.0]]), np.array([[0, 1, 2], [0, 2, 3]])
)
NETS = PaperNets(hidden=16, embedding=8)


class Halves(nn.Module):
    """Chart 0 below the diagonal, chart 1 above; uv are x and y, chart 1 twice as large."""

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        side = xyz[:, 1] - 0.5 * xyz[:, 0]
        return torch.stack([-side, side], dim=1), torch.stack([xyz[:, :2], 2.0 * xyz[:, :2]], dim=1)


def test_a_face_takes_the_chart_of_its_centre_and_the_networks_own_uv() -> None:
    frame = Frame.of(SQUARE.vertices)
    charts = raw_charts(Halves(), SQUARE, frame)
    assert charts.face_chart.tolist() == [0, 1]
    flat = frame.apply(SQUARE.vertices)[:, :2]
    np.testing.assert_allclose(charts.corner_uv, [flat[[0, 1, 2]], 2.0 * flat[[0, 2, 3]]], atol=1e-6)


def test_charts_share_one_scale_and_stay_in_their_cells() -> None:
    charts = raw_charts(Halves(), SQUARE, Frame.of(SQUARE.vertices))
    atlas = raw_atlas(SQUARE, charts, 512)
    first, second = atlas.corner_uv
    assert first[:, 0].max() <= 0.5 - 0.5 * MARGIN < 0.5 + 0.5 * MARGIN <= second[:, 0].min() + 1e-6
    np.testing.assert_allclose(np.ptp(second, axis=0), 2.0 * np.ptp(first, axis=0), rtol=1e-5)
    np.testing.assert_array_equal(atlas.positions[atlas.faces], SQUARE.triangles)


@pytest.mark.parametrize("count", [1, 3])
def test_the_file_answers_as_the_networks_do(count: int, tmp_path: Path) -> None:
    config = PaperConfig("global" if count == 1 else "multi-chart", count, nets=NETS)
    model = make_networks(config, torch.Generator().manual_seed(4))
    frame = Frame.of(SQUARE.vertices)
    path = tmp_path / "square.paper.onnx"
    path.write_bytes(raw_onnx(model, SQUARE, frame, 512, Provenance("ab")))
    uv, chart, _ = UnwrapSession(path).unwrap(SQUARE.vertices)
    with torch.no_grad():
        logits, every = model(torch.from_numpy(frame.apply(SQUARE.vertices)).float())
    np.testing.assert_array_equal(chart, logits.argmax(dim=1).numpy())
    placement = raw_atlas(SQUARE, raw_charts(model, SQUARE, frame), 512).placement
    assert placement is not None
    own = every.numpy()[np.arange(4), chart]
    expected = np.einsum("nij,nj->ni", placement[chart, :, :2], own) + placement[chart, :, 2]
    np.testing.assert_allclose(uv, np.clip(expected, 0.0, 1.0), atol=1e-5)
