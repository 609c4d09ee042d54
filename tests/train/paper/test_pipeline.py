"""Preset paper as a whole: figures of two triangles by hand, analytic maps in the networks' place, a short training."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
import pytest
import torch

from flexpara.runtime.geometry.metrics import measure
from flexpara.runtime.mesh import Charts, Frame, Surface
from flexpara.runtime.process.progress import Stages
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FitConfig, TrainConfig
from flexpara.train.deploy.config import SampleConfig
from flexpara.train.paper.config import PaperConfig, PaperNets
from flexpara.train.paper.finishing import GlobalFinishConfig
from flexpara.train.paper.learnedseams import SeamConfig
from flexpara.train.paper.pipeline import (
    as_numpy,
    distortions,
    finish_learned,
    raw_charts,
    raw_global,
    side_by_side,
    train_paper_surface,
    vertex_normals,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    Learned = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]

SMALL = PaperNets(hidden=16, embedding=8)
DEPLOY = TrainConfig(fit=FitConfig(samples=SampleConfig(per_face=1, least=4000, beside=2000)))


def sample(name: str, resolution: int) -> Surface:
    vertices, faces = make_sample(name, resolution=resolution)
    return Surface(Frame.of(vertices).apply(vertices), faces)


def unroll(xyz: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A tube unrolled, with a steep band at the negative x axis."""
    angle = np.arctan2(xyz[:, 1], xyz[:, 0])
    u = np.hypot(xyz[:, 0], xyz[:, 1]).mean() * angle * np.tanh((np.pi - np.abs(angle)) / 0.1)
    return np.zeros((len(xyz), 1)), np.stack([u, xyz[:, 2]], axis=1)[:, None]


def two_sides(xyz: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Three charts: y > 0 and y < 0 seen along y, each its own way round, and one that nobody takes."""
    logits = np.stack([20.0 * xyz[:, 1], -20.0 * xyz[:, 1], np.full(len(xyz), -50.0)], axis=1)
    angle = np.arctan2(np.abs(xyz[:, 1]), xyz[:, 0])
    flat = np.stack([0.45 * angle, xyz[:, 2]], axis=1)
    uv = np.stack([flat, 2.0 * flat, 0.0 * flat], axis=1)
    return logits - np.log(np.exp(logits).sum(axis=1, keepdims=True)), uv


def test_a_similarity_has_no_distortion_and_a_flip_is_counted() -> None:
    triangles = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0], [0, 1, 0]]])
    uv = 7.0 * triangles[..., :2]
    assert distortions(triangles, uv) == {
        "faces": 2,
        "conformal_mean": pytest.approx(0.0, abs=1e-12),
        "equiareal_mean": pytest.approx(0.0, abs=1e-12),
        "isometric_mean": pytest.approx(0.0, abs=1e-12),
        "flipped": 0.0,
    }
    uv[1] = uv[1, ::-1]
    assert distortions(triangles, uv)["flipped"] == 0.5


def test_a_known_stretch_has_known_figures() -> None:
    """The right triangle of sides 1, 1 stretched to 2, ½: area kept, angles atan ¼ and atan 4 for 45° twice."""
    triangles = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    found = distortions(triangles, triangles[..., :2] * [2.0, 0.5])
    assert found["conformal_mean"] == pytest.approx(2.0 * (np.pi / 4.0 - np.arctan(0.25)) / 3.0)
    assert found["equiareal_mean"] == pytest.approx(0.0)
    assert found["isometric_mean"] == pytest.approx((1.0 + 0.5 + np.sqrt(4.25) - np.sqrt(2.0)) / 3.0)


def test_a_map_onto_a_line_has_no_figures() -> None:
    triangles = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    assert distortions(triangles, triangles[..., :2] * [1.0, 0.0])["conformal_mean"] is None
    assert distortions(triangles[:0], np.zeros((0, 3, 2)))["flipped"] is None


def test_normals_of_a_sphere_point_outwards_and_those_that_cancel_out_upwards() -> None:
    sphere = sample("sphere", 40)
    assert (vertex_normals(sphere) * sphere.vertices).sum(axis=1).min() > 0.995
    sheet = Surface(np.array([[0.0, 0, 0], [0, 0, 1], [1, 0, 0]]), np.array([[0, 1, 2], [0, 2, 1]]))
    assert vertex_normals(sheet).tolist() == [[0.0, 0.0, 1.0]] * 3


def test_charts_stand_side_by_side() -> None:
    uv = np.array([[[0.0, 0], [1, 0], [0, 1]], [[0, 0], [3, 0], [0, 1]], [[5, 5], [6, 5], [5, 6]]])
    charts = Charts(np.array([0, 1, 1]), uv, np.array([0, 1, 1]), np.arange(2), ("slim", "slim"))
    moved = side_by_side(charts)
    assert moved[0, :, 0].max() < moved[1:, :, 0].min()
    assert np.diff(moved[1:], axis=0) == pytest.approx(np.diff(uv[1:], axis=0))


def test_raw_figures_tell_the_seam_from_the_rest() -> None:
    tube = sample("tube", 48)
    raw = raw_global(tube, unroll, PaperConfig(), SeamConfig())
    assert raw["off_seam"]["conformal_mean"] < 0.02
    assert raw["off_seam"]["flipped"] < raw["all"]["flipped"] < 0.1  # where the band turns back, it is not steep yet
    assert raw["all"]["conformal_mean"] > 2.0 * raw["off_seam"]["conformal_mean"]
    assert raw["all"]["faces"] == len(tube.faces)
    # the band is about 0.2 of 2π wide; the paper's threshold marks its steep part
    assert 0.0 < raw["cut_points"] < raw["seam_faces"] < 0.1


def test_a_map_without_a_seam_has_no_cut_points() -> None:
    sheet = sample("cloth", 32)
    raw = raw_global(sheet, lambda xyz: (np.zeros((len(xyz), 1)), xyz[:, None, :2]), PaperConfig(), SeamConfig())
    assert raw["cut_points"] < 0.002  # of random samples, a few have their third neighbour 2 % of the box away
    assert raw["seam_faces"] == 0.0


def test_raw_figures_are_those_of_the_seam_numbers_in_force() -> None:
    tube = sample("tube", 48)
    shares = [raw_global(tube, unroll, PaperConfig(), SeamConfig(torn=torn))["seam_faces"] for torn in (3.0, 1e9)]
    assert shares[0] > 0.0
    assert shares[1] == 0.0


def test_raw_figures_of_charts_leave_out_the_faces_between_them() -> None:
    tube = sample("tube", 48)
    raw = raw_charts(tube, *two_sides(tube.vertices))
    assert [row["chart"] for row in raw["charts"]] == [0, 1]
    assert 0.0 < raw["seam_faces"] < 0.1
    assert sum(row["area"] for row in raw["charts"]) + raw["seam_faces"] == pytest.approx(1.0)
    assert all(row["conformal_mean"] < 0.01 for row in raw["charts"])
    # each chart is isometric at its own scale; at one scale for both, the second is twice too large
    assert raw["all"]["isometric_mean"] > 10.0 * raw["charts"][0]["isometric_mean"]


def test_charts_that_nobody_takes_are_not_made() -> None:
    tube = sample("tube", 48)
    found, report = finish_learned(
        tube, two_sides, PaperConfig(mode="multi-chart", charts=3), Stages(), GlobalFinishConfig()
    )
    assert len(found.pieces) <= 2
    assert len(report["raw"]["charts"]) == 2
    assert np.array_equal(np.sort(np.concatenate([piece.ids for piece in found.pieces])), np.arange(len(tube.faces)))


def test_a_learned_tube_is_one_chart_whose_report_has_both() -> None:
    tube = sample("tube", 48)
    found, report = finish_learned(tube, unroll, PaperConfig(), Stages(), GlobalFinishConfig())
    assert len(found.pieces) == 1
    assert report["components"][0]["charts"] == 1
    assert report["raw"]["off_seam"]["conformal_mean"] > 0.0
    uv = found.pieces[0].flat.uv[found.pieces[0].flat.surface.faces]
    assert measure(tube, uv).conformal_mean < 1e-4


def test_networks_answer_in_chunks_as_at_once() -> None:
    from flexpara.train.paper.networks import MultiChartPaperNetworks

    networks = MultiChartPaperNetworks(3, SMALL, generator=torch.Generator().manual_seed(0))
    xyz = np.random.default_rng(0).normal(size=(50, 3))
    score, uv = as_numpy(networks, chunk=7)(xyz)
    assert score.shape == (50, 3)
    assert uv.shape == (50, 3, 2)
    assert np.exp(score).sum(axis=1) == pytest.approx(1.0)
    whole = as_numpy(networks)(xyz)
    assert score == pytest.approx(whole[0], abs=1e-5)
    assert uv == pytest.approx(whole[1], abs=1e-5)


@pytest.mark.parametrize("mode", ["global", "multi-chart"])
def test_hardly_trained_networks_still_give_valid_charts_in_source_units(mode: str) -> None:
    vertices, faces = make_sample("torus", resolution=20)
    torus = Surface(10.0 * vertices + np.array([5.0, 0.0, 0.0]), faces)
    stages: list[str] = []

    def note(stage: str, step: int, steps: int, loss: float | None = None) -> None:
        del step, steps, loss
        stages.append(stage)

    config = PaperConfig(
        mode="global" if mode == "global" else "multi-chart", charts=4, steps=20, points=64, nets=SMALL
    )
    result = train_paper_surface(torus, config, note, deploy=DEPLOY)
    assert stages[0] == "train"
    assert stages[-1] == "exact check"
    charts = result.charts
    metrics = measure(torus, side_by_side(charts), charts.face_chart)
    assert (metrics.flipped_faces, metrics.overlap_fraction) == (0, 0.0)
    assert metrics.charts == (1 if mode == "global" else len(charts.method)) <= 4
    first, second = (charts.corner_uv[:, i] - charts.corner_uv[:, 0] for i in (1, 2))
    area = 0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]).sum()
    assert area == pytest.approx(torus.face_areas().sum(), rel=0.3)
    assert json.loads(json.dumps(result.report))["finished"]["charts"] == metrics.charts
    assert json.loads(json.dumps(result.settings))["mode"] == mode
    assert set(result.report) >= {"raw", "finished"}
    corner = result.frame.apply(torus.triangles[:, 0]).astype(np.float32)
    gap = np.linalg.norm(result.networks(corner).value - charts.corner_uv[:, 0], axis=1)
    assert np.median(gap) < 1e-2 * np.sqrt(area)
