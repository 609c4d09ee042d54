"""The deployed map in torch, against arithmetic by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from flexpara.export.graph.frames import fold_frame
from flexpara.export.paper.torchmodel import UnwrapGraph, chart_membership
from flexpara.runtime.mesh import Frame
from flexpara.runtime.sessions.bundle import BundleMetadata

TWO_CHARTS = BundleMetadata(
    chart_count=2,
    patch_count=3,
    frame=Frame(centre=(10.0, 20.0, 30.0), scale=2.0),
    placement=(((0.5, 0.0, 0.25), (0.0, 0.5, 0.5)), ((0.0, -0.25, 0.5), (0.25, 0.0, 0.75))),
    patch_chart=(0, 1, 1),
    size=256,
    padding=2,
    source_sha256="",
    settings={},
    metrics={},
    producer_name="flexpara",
    producer_version="0",
)


class FixedLogits(nn.Module):
    """The same logits everywhere; patch j maps (x, y, z) to (x + j, y)."""

    def __init__(self, *logits: float) -> None:
        super().__init__()
        self.logits = torch.tensor(logits)

    def forward(self, xyz: Tensor) -> tuple[Tensor, Tensor]:
        shift = torch.arange(len(self.logits))[None, :, None] * torch.tensor([1.0, 0.0])
        return self.logits.expand(len(xyz), -1), xyz[:, None, :2] + shift


def answer(model: nn.Module, points: list[list[float]], metadata: BundleMetadata = TWO_CHARTS) -> list[Tensor]:
    return list(UnwrapGraph(model, metadata)(torch.tensor(points)))


def test_frame_and_placement_of_the_first_patch_by_hand() -> None:
    uv, chart, _ = answer(FixedLogits(1.0, 0.0, 0.0), [[10.0, 20.0, 30.0], [11.0, 19.0, 30.0]])
    assert uv.tolist() == [[0.25, 0.5], [0.5, 0.25]]
    assert chart.tolist() == [0, 0]


def test_the_last_patch_answers_with_its_own_uv_and_its_charts_placement() -> None:
    uv, chart, _ = answer(FixedLogits(0.0, 0.0, 1.0), [[10.0, 21.0, 30.0]])
    assert uv.tolist() == [[0.5 - 0.25 * 0.5, 1.0]]  # chart uv (2, ½): v = ¼ · 2 + ¾ is clamped
    assert chart.tolist() == [1]


def test_score_sums_the_patches_of_a_chart() -> None:
    logits = [math.log(weight) for weight in (3.0, 4.0, 1.0)]
    *_, score = answer(FixedLogits(*logits), [[10.0, 20.0, 30.0]])
    assert score.item() == pytest.approx(5.0 / 8.0)


def test_the_largest_patch_wins_even_where_another_chart_is_more_probable() -> None:
    logits = [math.log(weight) for weight in (4.0, 3.0, 3.0)]
    _, chart, score = answer(FixedLogits(*logits), [[10.0, 20.0, 30.0]])
    assert (chart.item(), score.item()) == (0, pytest.approx(0.4))


def test_membership_rows_are_one_hot() -> None:
    assert chart_membership(TWO_CHARTS).tolist() == [[1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]


def test_a_folded_frame_is_exact_far_from_the_origin() -> None:
    frame = Frame(centre=(123456.789012, -987654.321098, 1e-3), scale=0.37)
    folded = fold_frame(dataclasses.replace(TWO_CHARTS, frame=frame))
    total = folded.centre.astype(np.float64) + folded.centre_rest.astype(np.float64)
    assert np.abs(total - frame.centre).max() < 1e-9
    assert np.abs(folded.centre - np.asarray(frame.centre)).max() > 1e-3


def test_float32_points_far_from_the_origin_lose_nothing_in_the_frame() -> None:
    frame = Frame(centre=(123456.789012, -987654.321098, 4242.424242), scale=0.75)
    points = (np.asarray(frame.centre) + np.random.default_rng(0).uniform(-0.4, 0.4, (100, 3))).astype(np.float32)
    metadata = dataclasses.replace(TWO_CHARTS, frame=frame)
    _, patch_uv = UnwrapGraph(FixedLogits(1.0, 0.0, 0.0), metadata).logits_and_uv(torch.from_numpy(points))
    exact = frame.apply(points.astype(np.float64))
    assert np.abs(patch_uv[:, 0].numpy() - exact[:, :2]).max() < 2e-7
