"""Fitting the inverse: sines by hand, least squares against numpy, flat and round charts, borders between patches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray
from torch import Tensor

from flexpara.runtime.errors import InputError
from flexpara.runtime.mesh import Charts, Surface
from flexpara.train.config import WrapConfig
from flexpara.train.deploy.fit_wrap import (
    AtlasWrap,
    SineNets,
    draw_waves,
    fit_wrap,
    patch_table,
    sample_sheets,
    solve,
)

QUICK = WrapConfig(samples=6000, waves=160, assign_waves=128)

Cut = tuple[Surface, Charts]


def silence(stage: str, step: int, steps: int, loss: float | None = None) -> None:
    """Progress that nobody watches."""


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def half_pipe(patches: int, *, rows: int = 30) -> Cut:
    """Half a cylinder of radius ½ about z, unrolled to (angle / 2, z) as one chart, parted into patches by angle."""
    corner = np.arange((rows + 1) ** 2).reshape(rows + 1, rows + 1)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    angle, z = np.meshgrid(np.linspace(0.0, np.pi, rows + 1), np.linspace(-0.8, 0.8, rows + 1), indexing="ij")
    uv = np.stack([0.5 * angle.ravel(), z.ravel()], axis=1)
    surface = Surface(on_the_pipe(uv), faces)
    part = np.minimum(uv[faces][:, :, 0].mean(axis=1) / (0.5 * np.pi) * patches, patches - 1).astype(np.int64)
    none = np.zeros(len(faces), np.int64)
    return surface, Charts(none, uv[faces], part, np.zeros(patches, np.int64), ("slim",))


def on_the_pipe(uv: NDArray[np.float64]) -> NDArray[np.float64]:
    """Points of the pipe at uv (n, 2); their x and y, doubled, are the normal."""
    return np.stack([0.5 * np.cos(2.0 * uv[:, 0]), 0.5 * np.sin(2.0 * uv[:, 0]), uv[:, 1]], axis=1)


def answers(model: AtlasWrap, uv: NDArray[np.float64], chart: NDArray[np.int64]) -> tuple[Tensor, Tensor, Tensor]:
    """The patch chosen (n,), and its point and normal (n, 3), each."""
    plane, table = torch.from_numpy(uv.astype(np.float32)), torch.from_numpy(model.table[chart])
    scores = model.patch_scores(plane, torch.from_numpy(chart)).masked_fill(table < 0, -torch.inf)
    patch = table.gather(1, scores.argmax(dim=1, keepdim=True))[:, 0]
    return patch, *model.wrap(plane, patch)


def random_nets(copies: int = 3, waves: int = 8, outputs: int = 4) -> SineNets:
    nets = SineNets(copies, waves, outputs).requires_grad_(False)
    for parameter in nets.parameters():
        parameter.copy_(torch.randn(parameter.shape, generator=seeded(len(parameter.shape) + parameter.numel())))
    return nets


def test_one_sine_by_hand() -> None:
    nets = SineNets(1, 1, 1).requires_grad_(False)
    nets.centre[0, 0] = torch.tensor([1.0, 2.0])
    nets.frequency[0, :, 0] = torch.tensor([3.0, 0.5])
    nets.phase[0], nets.last[0], nets.bias[0] = 0.25, 2.0, 7.0
    nets.slope[0, :, 0] = torch.tensor([10.0, 100.0])
    found = nets(torch.tensor([[1.5, 1.0]]), torch.tensor([0]))
    assert found.item() == pytest.approx(2.0 * np.sin(0.5 * 3.0 - 1.0 * 0.5 + 0.25) + 5.0 - 100.0 + 7.0, rel=1e-6)


def test_each_row_is_answered_by_the_network_it_names() -> None:
    nets, uv, index = random_nets(), torch.randn((20, 2), generator=seeded()), torch.arange(20) % 3
    alone = [nets(uv[i : i + 1], index[i : i + 1]) for i in range(20)]
    assert torch.allclose(nets(uv, index), torch.cat(alone), atol=1e-5)


def test_one_index_answers_for_all_rows() -> None:
    nets, uv = random_nets(), torch.randn((20, 2), generator=seeded())
    assert torch.allclose(nets(uv, torch.tensor([2])), nets(uv, torch.full((20,), 2)), atol=1e-5)


def test_the_outputs_are_the_design_times_the_last_layer() -> None:
    nets, uv = random_nets(), torch.randn((20, 2), generator=seeded())
    assert torch.allclose(nets.design(1, uv) @ nets.last_layer(1), nets(uv, torch.tensor([1])).double(), atol=1e-4)


def test_patches_are_listed_by_chart() -> None:
    table = patch_table(np.array([1, 0, 1, 3, 1]), 4)
    assert table.tolist() == [[1, -1, -1], [0, 2, 4], [-1, -1, -1], [3, -1, -1]]


@pytest.mark.parametrize("area", [1e-6, 1.0, 1e8])
def test_frequencies_end_where_the_sines_run_out(area: float) -> None:
    nets = SineNets(2, 500, 1).requires_grad_(False)
    draw_waves(nets, 1, torch.tensor([[1.0, 2.0], [3.0, 6.0]], dtype=torch.float64), area, 0.5, seeded())
    radius = nets.frequency[1].norm(dim=0) / np.sqrt(4.0 * np.pi * 500 / area)
    assert 0.49 < float(radius.max()) <= 0.5 + 1e-6
    assert nets.centre[1].tolist() == [[2.0, 4.0]]
    assert nets.frequency[0].abs().max() == 0.0


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e3])
def test_a_plane_is_found_exactly_in_any_unit(unit: float) -> None:
    nets, uv = SineNets(1, 16, 2).requires_grad_(False), torch.rand((400, 2), generator=seeded()).double()
    target = uv @ torch.tensor([[1.0, 2.0], [-3.0, 0.5]]).double() + 4.0
    draw_waves(nets, 0, uv * unit, unit**2, 0.7, seeded())
    solve(nets, 0, uv * unit, target, torch.full((400,), 1.0 / 400).double(), 1e-12)
    assert (nets((uv * unit).float(), torch.tensor([0])) - target).abs().max() < 2e-5


def test_the_last_layer_is_that_of_weighted_least_squares() -> None:
    rng = np.random.default_rng(0)
    nets, uv = SineNets(1, 12, 3).requires_grad_(False), torch.from_numpy(rng.random((300, 2)))
    target, weight = rng.normal(size=(300, 2)), rng.random(300)
    weight /= weight.sum()
    draw_waves(nets, 0, uv, 1.0, 0.7, seeded())
    solve(nets, 0, uv, torch.from_numpy(target), torch.from_numpy(weight), 1e-14)
    design, root = nets.design(0, uv).numpy(), np.sqrt(weight)[:, None]
    truth = np.linalg.lstsq(design * root, target * root, rcond=None)[0]
    assert np.abs(nets.last_layer(0).numpy()[:, :2] - truth).max() < 1e-4 * np.abs(truth).max()
    assert nets.last[0, :, 2].abs().max() == 0.0


def test_samples_lie_on_the_surface_at_their_uv() -> None:
    surface, charts = half_pipe(2, rows=200)
    samples = sample_sheets(surface, charts, 300, np.random.default_rng(0))
    truth = on_the_pipe(samples.uv)
    assert np.abs(samples.xyz - truth).max() < 1e-4
    assert np.abs(samples.normal - truth * [2.0, 2.0, 0.0]).max() < 0.01  # half a face at the rim
    assert np.bincount(samples.patch).tolist() == [300, 300]
    assert samples.area.sum() == pytest.approx(0.5 * np.pi * 1.6)


def test_a_flat_chart_comes_back_flat(two_halves: Cut) -> None:
    surface, charts = two_halves
    samples = sample_sheets(surface, charts, 1000, np.random.default_rng(1))
    patch, xyz, normal = answers(fit_wrap(surface, charts, QUICK, progress=silence), samples.uv, samples.chart)
    assert np.array_equal(patch.numpy(), samples.patch)
    assert np.abs(xyz.numpy() - samples.xyz).max() < 2e-5
    assert np.abs(normal.numpy() - [0.0, 0.0, 1.0]).max() < 2e-5


@pytest.mark.parametrize("patches", [1, 2, 5])
def test_a_round_chart_comes_back_round(patches: int) -> None:
    surface, charts = half_pipe(patches, rows=80)
    uv = np.random.default_rng(0).random((2000, 2)) * [0.5 * np.pi, 1.6] - [0.0, 0.8]
    patch, xyz, normal = answers(fit_wrap(surface, charts, QUICK, progress=silence), uv, np.zeros(2000, np.int64))
    truth = on_the_pipe(uv)
    assert np.linalg.norm(xyz.numpy() - truth, axis=1).max() < 2e-3
    assert np.abs(normal.numpy() - truth * [2.0, 2.0, 0.0]).max() < 0.05
    expected = np.minimum(uv[:, 0] / (0.5 * np.pi) * patches, patches - 1).astype(np.int64)
    assert (patch.numpy() == expected).mean() > 0.97


def test_patches_of_a_chart_agree_beyond_their_border() -> None:
    surface, charts = half_pipe(2, rows=60)
    border = 0.25 * np.pi
    uv = np.random.default_rng(0).random((500, 2)) * [0.02, 1.4] + [border - 0.01, -0.7]
    plane = torch.from_numpy(uv.astype(np.float32))
    gaps = []
    for shared in (QUICK.shared, 2.0):  # no score is 2: each patch learns from its own samples alone
        model = fit_wrap(surface, charts, replace(QUICK, shared=shared), progress=silence)
        (first, _), (second, _) = (model.wrap(plane, torch.tensor([patch])) for patch in (0, 1))
        gaps.append(float((first - second).norm(dim=1).max()))
    assert gaps[0] < 1e-3
    assert gaps[0] < 0.5 * gaps[1]


def test_the_unit_and_place_of_the_charts_do_not_matter() -> None:
    surface, charts = half_pipe(2)
    moved = replace(charts, corner_uv=1000.0 * charts.corner_uv + [5000.0, -300.0])
    uv = np.random.default_rng(0).random((500, 2)) * [0.5 * np.pi, 1.6] - [0.0, 0.8]
    none = np.zeros(500, np.int64)
    here = answers(fit_wrap(surface, charts, QUICK, progress=silence), uv, none)
    there = answers(fit_wrap(surface, moved, QUICK, progress=silence), 1000.0 * uv + [5000.0, -300.0], none)
    assert (here[1] - there[1]).norm(dim=1).max() < 1e-3


def test_each_patch_of_a_solid_is_right(six_sides: Cut) -> None:
    surface, charts = six_sides
    samples = sample_sheets(surface, charts, 200, np.random.default_rng(1))
    _, xyz, normal = answers(fit_wrap(surface, charts, QUICK, progress=silence), samples.uv, samples.chart)
    assert np.abs(xyz.numpy() - samples.xyz).max() < 1e-4
    assert np.abs(normal.numpy() - samples.normal).max() < 1e-4


def test_the_same_seed_gives_the_same_networks_bit_for_bit() -> None:
    surface, charts = half_pipe(2)
    first = fit_wrap(surface, charts, QUICK, seed=5, progress=silence).state_dict()
    torch.manual_seed(123)
    again, other = (fit_wrap(surface, charts, QUICK, seed=seed, progress=silence).state_dict() for seed in (5, 6))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not any(torch.equal(first[name], other[name]) for name in first)


def test_progress_ends_with_the_last_step(two_halves: Cut) -> None:
    told: list[tuple[str, int, int]] = []
    fit_wrap(*two_halves, QUICK, progress=lambda *a, **_: told.append(a))
    assert told == [("fit points", step, 2) for step in range(3)]


def test_charts_of_no_face_are_refused() -> None:
    empty = Charts(np.zeros(0, np.int64), np.zeros((0, 3, 2)), np.zeros(0, np.int64), np.zeros(1, np.int64), ("slim",))
    with pytest.raises(InputError, match="charts of 0 faces"):
        fit_wrap(Surface(np.zeros((0, 3)), np.zeros((0, 3), np.int64)), empty, QUICK, progress=silence)
