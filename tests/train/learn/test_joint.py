"""Joint training: the loss by hand, schedules and batches; then it learns on solids, bit for bit by the seed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor

from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import JointConfig, NetConfig, StartConfig, TrainConfig
from flexpara.train.learn.joint import SampleBank, fit_start, joint_loss, train_jointly
from flexpara.train.learn.networks import Cycle, MultiChartNetworks
from flexpara.train.learn.optimizer import one_cycle_rate
from flexpara.train.learn.start import cluster, plane_projection
from flexpara.train.sampling import Samples, sample_surface

CONFIG = TrainConfig(
    charts=4, net=NetConfig(width=24), start=StartConfig(fit_steps=60), joint=JointConfig(steps=60, batch=256)
)


def seeded(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def samples_of(name: str, count: int = 1500) -> Samples:
    vertices, faces = make_sample(name, resolution=24)
    return sample_surface(Surface(Frame.of(vertices).apply(vertices), faces), count, np.random.default_rng(0))


def silence(step: int, loss: float) -> None:
    """A report that nobody reads."""


def perfect(patches: int, count: int) -> tuple[Cycle, Tensor, Tensor]:
    """A cycle that makes no error, the points and the normals."""
    xyz, normal = torch.randn(count, 3, generator=seeded()), torch.tensor([0.0, 0.0, 1.0]).expand(count, 3)
    jacobian = torch.eye(2)[:, None, None].expand(2, patches, count, 2)
    logits = torch.randn(count, patches, generator=seeded(1))
    return (
        Cycle(logits, torch.zeros(patches, count, 2), jacobian, xyz.expand(patches, -1, -1), normal * 2.0),
        xyz,
        normal,
    )


def test_a_perfect_cycle_has_no_loss() -> None:
    cycle, xyz, normal = perfect(3, 10)
    assert joint_loss(cycle, xyz, normal, JointConfig()).item() == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(
    ("field", "value", "weights"),
    [
        ("jacobian", lambda x: 2.0 * x, (2.0, 0.0, 0.0)),
        ("xyz", lambda x: x + 0.1, (0.0, 0.3, 0.0)),
        ("normal", lambda x: -x, (0.0, 0.0, 2.0)),
    ],
)
def test_each_error_counts_by_its_weight(field: str, value: object, weights: tuple[float, float, float]) -> None:
    cycle, xyz, normal = perfect(3, 10)
    assert callable(value)
    wrong = cycle._replace(**{field: value(getattr(cycle, field))})
    for config in (JointConfig(), JointConfig(distortion_weight=7.0, cycle_weight=3.0, normal_weight=0.5)):
        expected = np.dot(weights, [config.distortion_weight, config.cycle_weight, config.normal_weight])
        assert joint_loss(wrong, xyz, normal, config).item() == pytest.approx(expected, rel=1e-4)


def test_an_error_on_one_patch_counts_by_its_probability() -> None:
    cycle, xyz, normal = perfect(2, 10)
    logits = torch.tensor([[0.0, float(np.log(3.0))]]).expand(10, 2)
    jacobian = cycle.jacobian * torch.tensor([2.0, 1.0])[:, None, None]
    loss = joint_loss(cycle._replace(logits=logits, jacobian=jacobian), xyz, normal, JointConfig())
    assert loss.item() == pytest.approx(0.25 * 2.0, rel=1e-4)


def test_the_rate_rises_to_its_peak_and_falls_to_nothing() -> None:
    rates = [one_cycle_rate(step, 100, 1e-2) for step in range(100)]
    assert max(rates) == pytest.approx(1e-2, rel=0.01)
    assert 10 <= int(np.argmax(rates)) <= 20
    assert rates[0] < 1e-3
    assert rates[-1] < 1e-5


def test_batches_are_drawn_from_the_bank_by_its_generator() -> None:
    samples = samples_of("cube", 50)
    first, again = (SampleBank(samples, seeded(2)).draw(1000) for _ in range(2))
    assert torch.equal(first, again)
    assert torch.equal(first.unique(), torch.arange(50))


def test_a_bank_holds_the_samples_with_right_handed_tangents() -> None:
    samples = samples_of("sphere", 50)
    bank = SampleBank(samples, seeded())
    assert bank.xyz.dtype == bank.normal.dtype == bank.tangents.dtype == torch.float32
    np.testing.assert_allclose(bank.xyz.numpy(), samples.xyz, atol=1e-7)
    np.testing.assert_allclose(torch.linalg.cross(*bank.tangents).numpy(), samples.normal, atol=1e-6)


def test_the_networks_learn_the_geometric_start() -> None:
    samples = samples_of("cube")
    networks = MultiChartNetworks(4, CONFIG.net, generator=seeded())
    label = cluster(samples.xyz, samples.normal, 4, CONFIG.start, np.random.default_rng(0))
    uv = plane_projection(samples.xyz, samples.normal, label, 4)
    bank = SampleBank(samples, seeded())
    config = replace(CONFIG, start=StartConfig(fit_steps=150), joint=JointConfig(batch=512))
    fit_start(networks, bank, torch.from_numpy(label), torch.from_numpy(uv.astype(np.float32)), config)
    with torch.no_grad():
        cycle = networks(bank.xyz, bank.tangents)
    own = label, np.arange(len(label))
    assert (cycle.logits.argmax(dim=1).numpy() == label).mean() > 0.9
    assert np.abs(cycle.uv.numpy()[own] - uv[own]).mean() < 0.05
    assert np.abs(cycle.xyz.numpy()[own] - samples.xyz).mean() < 0.1


@pytest.mark.parametrize("name", ["sphere", "cube"])
def test_the_loss_falls(name: str) -> None:
    losses: dict[int, float] = {}
    train_jointly(samples_of(name), CONFIG, 0, losses.__setitem__)
    assert list(losses) == [0, 20, 40, 59]
    assert losses[59] < 0.7 * losses[0]


def test_training_keeps_every_chart_in_use() -> None:
    samples = samples_of("sphere")
    networks = train_jointly(samples, CONFIG, 0, silence)
    with torch.no_grad():
        best = networks.scores(torch.from_numpy(samples.xyz.astype(np.float32))).argmax(dim=1)
    assert torch.bincount(best, minlength=4).min().item() > 0.05 * len(samples.xyz)


def test_the_same_seed_gives_the_same_weights_bit_for_bit() -> None:
    short = replace(CONFIG, start=StartConfig(fit_steps=8), joint=JointConfig(steps=8, batch=128))
    samples = samples_of("torus", 500)
    first = train_jointly(samples, short, 5, silence).state_dict()
    torch.manual_seed(123)
    again, other = (train_jointly(samples, short, seed, silence).state_dict() for seed in (5, 6))
    assert all(torch.equal(first[name], again[name]) for name in first)
    assert not any(torch.equal(first[name], other[name]) for name in first if name.endswith("weight"))


def test_one_chart_can_be_trained() -> None:
    losses: list[float] = []
    train_jointly(samples_of("cloth"), replace(CONFIG, charts=1), 0, lambda _, loss: losses.append(loss))
    assert np.isfinite(losses).all()
    assert losses[-1] < losses[0]
