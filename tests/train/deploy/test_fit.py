"""Fitting: least squares against numpy, flat and round charts; a real mesh."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from numpy.typing import NDArray
from torch import Tensor, nn

from flexpara.runtime.mesh import Charts, Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FitConfig, NetConfig
from flexpara.train.deploy.fit import (
    PatchSamples,
    fit_networks,
    fit_unwrap,
    sample_patches,
    solve_last_layer,
)
from flexpara.train.learn.networks import AtlasNetworks
from flexpara.train.sampling import sample_surface

# No octaves for uv: the charts here are flat, and a smooth network fits those best.
NET = NetConfig(width=32, assign_width=48, assign_depth=2, octaves=4, unwrap_octaves=0)
QUICK = FitConfig(samples=12000, unwrap_steps=200, assign_steps=200, assign_batch=1024)

Cut = tuple[Surface, Charts]


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def silence(stage: str, step: int, steps: int, loss: float | None = None) -> None:
    """Progress that nobody watches."""


def charts_by(face_chart: NDArray[np.int64], corner_uv: NDArray[np.float64]) -> Charts:
    """Charts of one patch each."""
    count = int(face_chart.max()) + 1
    return Charts(face_chart, corner_uv, face_chart, np.arange(count), ("slim",) * count)


def fit_error(networks: AtlasNetworks, samples: PatchSamples) -> Tensor:
    """(p,) root mean square distance in uv, chart units."""
    with torch.no_grad():
        uv = networks.unwrap(networks.unwrap_features(samples.xyz))
    gap = uv.double() - (samples.uv * samples.scale + samples.centre).double()
    return (gap**2).sum(dim=-1).mean(dim=-1).sqrt()


def answers(networks: AtlasNetworks, surface: Surface, charts: Charts, count: int = 5000) -> tuple[float, float]:
    """At new surface points: share with the right chart, and rms uv error of the right patch in chart units."""
    samples = sample_surface(surface, count, rng(99))
    with torch.no_grad():
        logits, uv = networks(torch.from_numpy(samples.xyz.astype(np.float32)))
    patch = charts.face_patch[samples.face]
    chart = charts.patch_chart[logits.argmax(dim=1).numpy()]
    truth = np.einsum("nc,ncd->nd", samples.barycentric, charts.corner_uv[samples.face])
    gap = uv.numpy()[np.arange(count), patch] - truth
    return float((chart == charts.face_chart[samples.face]).mean()), float(np.sqrt((gap**2).sum(axis=1).mean()))


def texel(charts: Charts) -> float:
    """Side of a texel in chart units where all charts fill a 1024² atlas to 75 %."""
    edges = charts.corner_uv[:, 1:] - charts.corner_uv[:, :1]
    return float(np.sqrt(0.5 * np.abs(np.linalg.det(edges)).sum() / 0.75)) / 1024.0


def known_samples(patches: int = 2, count: int = 400, noise: float = 0.0) -> PatchSamples:
    """Random points of the ball with a smooth uv, far from the origin and not of unit size."""
    xyz = torch.rand(patches, count, 3, generator=seeded(1)) * 2.0 - 1.0
    uv = torch.stack([xyz[..., 0] * xyz[..., 1], torch.sin(2.0 * xyz[..., 2])], dim=-1)
    uv = uv + noise * torch.randn(uv.shape, generator=seeded(2))
    return PatchSamples(xyz, uv, torch.full((patches, 1, 2), 7.0), torch.full((patches, 1, 1), 3.0))


def hidden_layer(networks: AtlasNetworks, xyz: Tensor) -> Tensor:
    """(p, m, width + 1): what the last layer sees, and a one."""
    with torch.no_grad():
        hidden = networks.unwrap_features(xyz)
        for layer in list(networks.unwrap.layers)[:-1]:
            hidden = nn.functional.silu(layer(hidden))
    return torch.cat([hidden, torch.ones_like(hidden[..., :1])], dim=-1)


def in_chart_units(networks: AtlasNetworks, samples: PatchSamples) -> None:
    """Rescale the last layer as training leaves it to chart units, without solving for it."""
    weight, bias = networks.unwrap.layers[-1].parameters()
    with torch.no_grad():
        weight.mul_(samples.scale)
        bias.mul_(samples.scale).add_(samples.centre)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("noise", [0.0, 0.5])
def test_solving_for_the_last_layer_never_raises_the_error(seed: int, noise: float) -> None:
    samples = known_samples(noise=noise)
    networks = AtlasNetworks(2, NET, generator=seeded(seed))
    in_chart_units(networks, samples)
    before = fit_error(networks, samples)
    solve_last_layer(networks, samples)
    after = fit_error(networks, samples)
    assert (after <= before).all()
    again = after.clone()
    solve_last_layer(networks, samples)
    torch.testing.assert_close(fit_error(networks, samples), again, rtol=1e-3, atol=1e-6)


def test_the_last_layer_is_the_one_of_least_squares() -> None:
    samples = known_samples(noise=0.2)
    networks = AtlasNetworks(2, NET, generator=seeded())
    design = hidden_layer(networks, samples.xyz).double().numpy()
    target = (samples.uv * samples.scale + samples.centre).double().numpy()
    residual = [b - a @ np.linalg.lstsq(a, b)[0] for a, b in zip(design, target, strict=True)]
    best = np.sqrt([(r**2).sum(axis=1).mean() for r in residual])
    solve_last_layer(networks, samples)
    np.testing.assert_allclose(fit_error(networks, samples).numpy(), best, rtol=1e-3)


def test_uv_that_the_features_span_is_met() -> None:
    samples = known_samples()
    networks = AtlasNetworks(2, NET, generator=seeded())
    with torch.no_grad():
        own = networks.unwrap(networks.unwrap_features(samples.xyz))
    solve_last_layer(networks, samples._replace(uv=own))
    assert fit_error(networks, samples._replace(uv=own)).max().item() < 1e-3


def test_patches_are_solved_for_one_by_one() -> None:
    samples = known_samples()
    networks = AtlasNetworks(2, NET, generator=seeded())
    solve_last_layer(networks, samples)
    alone = fit_error(networks, samples)
    broken = samples._replace(uv=torch.stack([samples.uv[0], samples.uv[1].flip(0)]))
    solve_last_layer(networks, broken)
    assert fit_error(networks, broken)[0].item() == pytest.approx(alone[0].item(), rel=1e-3)
    assert fit_error(networks, broken)[1] > 2.0 * alone[1]


def test_a_flat_grid_of_two_charts_is_fitted_to_well_under_a_texel(two_halves: Cut) -> None:
    surface, charts = two_halves
    samples = sample_patches(surface, charts, 2000, rng())
    networks = AtlasNetworks(2, NET, generator=seeded())
    fit_unwrap(networks, samples, QUICK, seeded(), silence)
    assert fit_error(networks, samples).max().item() < 0.1 * texel(charts)


def test_only_the_unwrap_nets_learn_uv(two_halves: Cut) -> None:
    networks = AtlasNetworks(2, NET, generator=seeded())
    before = {name: weight.clone() for name, weight in networks.assign.state_dict().items()}
    fit_unwrap(networks, sample_patches(*two_halves, 500, rng()), replace(QUICK, unwrap_steps=5), seeded(), silence)
    assert all(torch.equal(before[name], weight) for name, weight in networks.assign.state_dict().items())


def test_the_networks_answer_for_a_cube(six_sides: Cut) -> None:
    surface, charts = six_sides
    networks = fit_networks(surface, charts, NET, QUICK, 0, silence)
    agreement, rms = answers(networks, surface, charts)
    assert agreement > 0.99
    assert rms < texel(charts)
    assert not networks.training


def test_one_chart_without_a_seam_can_be_fitted() -> None:
    vertices, faces = make_sample("cloth", resolution=24)
    surface = Surface(Frame.of(vertices).apply(vertices), faces)
    charts = charts_by(np.zeros(len(faces), np.int64), surface.triangles[..., :2].copy())
    networks = fit_networks(surface, charts, NET, QUICK, 0, silence)
    agreement, rms = answers(networks, surface, charts)
    assert agreement == 1.0
    assert rms < texel(charts)


def test_the_same_seed_gives_the_same_networks_bit_for_bit(two_halves: Cut) -> None:
    surface, charts = two_halves
    short = replace(QUICK, samples=1000, unwrap_steps=5, assign_steps=5)
    first = fit_networks(surface, charts, NET, short, 5, silence).state_dict()
    torch.manual_seed(123)
    again, other = (fit_networks(surface, charts, NET, short, seed, silence).state_dict() for seed in (5, 6))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not any(torch.equal(first[name], other[name]) for name in first if name.endswith("weight"))


def test_progress_tells_stage_step_and_loss(two_halves: Cut) -> None:
    told: list[tuple[str, int, int, float | None]] = []
    short = replace(QUICK, samples=1000, unwrap_steps=50, assign_steps=30)
    fit_networks(*two_halves, NET, short, 0, lambda *a, **k: told.append((*a, *k.values())))
    assert [row[:3] for row in told] == [
        ("fit uv", 0, 50),
        ("fit uv", 25, 50),
        ("fit charts", 0, 30),
        ("fit charts", 25, 30),
    ]
    assert all(loss is not None and np.isfinite(loss) for *_, loss in told)


def test_units_of_the_charts_scale_the_answer(two_halves: Cut) -> None:
    surface, charts = two_halves
    large = replace(charts, corner_uv=1000.0 * charts.corner_uv)
    short = replace(QUICK, samples=2000, assign_steps=5)
    errors = [answers(fit_networks(surface, c, NET, short, 0, silence), surface, c)[1] for c in (charts, large)]
    assert errors[1] == pytest.approx(1000.0 * errors[0], rel=0.2)
    assert errors[1] < 0.5 * texel(large)


def test_a_real_mesh_cut_by_direction_gets_the_right_charts(models: Path) -> None:
    mesh = trimesh.load_mesh(models / "spot.obj", process=False, skip_materials=True)
    vertices = np.asarray(mesh.vertices, dtype=np.float64)
    surface = Surface(Frame.of(vertices).apply(vertices), np.asarray(mesh.faces, dtype=np.int64))
    front = (surface.triangles[:, :, 0].mean(axis=1) > 0.0).astype(np.int64)
    charts = charts_by(front, surface.triangles[..., 1:].copy())
    agreement, rms = answers(fit_networks(surface, charts, NET, QUICK, 0, silence), surface, charts)
    assert agreement > 0.99
    assert rms < texel(charts)
