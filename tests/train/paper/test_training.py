"""Training of preset paper: repeats bit for bit, goes on after a kill, and each ablation leaves its part out."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
import pytest
import torch
from torch._subclasses.fake_tensor import FakeTensorMode

from flexpara.runtime.errors import FlexparaError, InputError
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.paper import training
from flexpara.train.paper.batches import BatchSource, PaperInput
from flexpara.train.paper.checkpoint import Checkpoints
from flexpara.train.paper.config import Ablation, GlobalWeights, PaperConfig, PaperNets
from flexpara.train.paper.global_step import global_loss, global_terms
from flexpara.train.paper.multichart_step import chart_terms
from flexpara.train.paper.networks import GlobalNetworks, MultiChartPaperNetworks
from flexpara.train.paper.training import Training, train_paper

if TYPE_CHECKING:
    from pathlib import Path

SMALL = PaperConfig(steps=20, points=120, charts=3, device="cpu", nets=PaperNets(hidden=16, embedding=4))
CPU = torch.device("cpu")


def silent(step: int, loss: float) -> None:
    del step, loss


def surface_input(name: str, resolution: int) -> PaperInput:
    """A sample in the unit ball, with area-weighted vertex normals."""
    vertices, faces = make_sample(name, resolution=resolution)
    surface = Surface(Frame.of(vertices).apply(vertices), faces)
    normal = np.zeros_like(surface.vertices)
    np.add.at(normal, faces.ravel(), np.repeat(surface.face_cross(), 3, axis=0))
    return PaperInput(surface.vertices, normal / np.linalg.norm(normal, axis=1, keepdims=True), faces)


def weights(networks: torch.nn.Module) -> dict[str, torch.Tensor]:
    return dict(networks.named_parameters())


def assert_identical(first: torch.nn.Module, second: torch.nn.Module) -> None:
    for name, value in weights(first).items():
        assert torch.equal(value, weights(second)[name]), name


@pytest.fixture(params=["global", "multi-chart"])
def config(request: pytest.FixtureRequest) -> PaperConfig:
    return replace(SMALL, mode=request.param)


def test_the_same_seed_gives_the_same_weights(config: PaperConfig) -> None:
    samples = surface_input("tube", 16)
    first, second = (train_paper(samples, config, silent) for _ in range(2))
    assert_identical(first, second)
    other = train_paper(samples, replace(config, seed=1), silent)
    assert not all(torch.equal(value, weights(other)[name]) for name, value in weights(first).items())


@pytest.mark.parametrize("points", [120, 1000], ids=["drawn batches", "whole input"])
def test_ten_steps_and_ten_more_equal_twenty(
    config: PaperConfig, points: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    samples, config = surface_input("tube", 16), replace(config, points=points)
    straight = train_paper(samples, config, silent)
    save, saves = Checkpoints.save, list[int]()

    def save_and_die(self: Checkpoints, state: object, *rest: object) -> None:
        save(self, state, *rest)  # pyright: ignore[reportArgumentType]
        saves.append(1)
        raise KeyboardInterrupt

    monkeypatch.setattr(Checkpoints, "save", save_and_die)
    with pytest.raises(KeyboardInterrupt):
        train_paper(samples, config, silent, Checkpoints(tmp_path, 10))
    monkeypatch.undo()
    steps: list[int] = []
    resumed = train_paper(samples, config, lambda step, _: steps.append(step), Checkpoints(tmp_path, 10))
    assert len(saves) == 1
    assert steps == [20]
    assert_identical(straight, resumed)


def test_a_kill_between_the_two_files_changes_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from flexpara.train.paper import checkpoint

    samples = surface_input("tube", 16)
    straight = train_paper(samples, SMALL, silent)
    whole, written = checkpoint.replace_file, list[str]()

    def killed(path: Path, content: bytes) -> None:
        written.append(path.name)
        if len(written) == 4:  # the second checkpoint's JSON, its tensors are there
            raise KeyboardInterrupt
        whole(path, content)

    monkeypatch.setattr(checkpoint, "replace_file", killed)
    with pytest.raises(KeyboardInterrupt):
        train_paper(samples, SMALL, silent, Checkpoints(tmp_path, 7))
    monkeypatch.undo()
    assert (tmp_path / "checkpoint-00000014.safetensors").is_file()
    assert checkpoint.resume(tmp_path).state.step == 7
    assert_identical(straight, train_paper(samples, SMALL, silent, Checkpoints(tmp_path, 7)))


def test_a_finished_run_is_not_trained_again(tmp_path: Path) -> None:
    samples = surface_input("tube", 16)
    first = train_paper(samples, SMALL, silent, Checkpoints(tmp_path, 100))
    steps: list[int] = []
    assert_identical(first, train_paper(samples, SMALL, lambda step, _: steps.append(step), Checkpoints(tmp_path)))
    assert steps == []


def test_tensors_of_other_networks_are_refused() -> None:
    run, other = (
        Training.begin(each, surface_input("tube", 16), CPU)
        for each in (SMALL, replace(SMALL, nets=PaperNets(hidden=8)))
    )
    with pytest.raises(InputError, match="differ"):
        run.restore(other.state())


def test_progress_comes_every_twenty_steps_and_at_the_end() -> None:
    seen: list[tuple[int, float]] = []
    config = replace(SMALL, steps=50)
    train_paper(surface_input("tube", 16), config, lambda step, loss: seen.append((step, loss)))
    assert [step for step, _ in seen] == [20, 40, 50]
    assert seen[-1][1] < seen[0][1]


def test_a_rate_far_too_high_is_named() -> None:
    with pytest.raises(FlexparaError, match="lower rate"):
        train_paper(surface_input("tube", 16), replace(SMALL, rate=1e30, steps=60), silent)


def test_a_device_that_is_absent_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert training.choose_device(replace(SMALL, device="auto")).type == "cpu"
    with pytest.raises(InputError, match="choose device auto or cpu"):
        training.choose_device(replace(SMALL, device="cuda"))


@pytest.mark.parametrize(
    ("ablation", "names"),
    [
        (Ablation(), {"cycle", "unwrap", "triangle", "wrap", "differential"}),
        (Ablation(triangle=False), {"cycle", "unwrap", "wrap", "differential"}),
        (Ablation(differential=False), {"cycle", "unwrap", "triangle", "wrap"}),
        (Ablation(upper=False), {"cycle", "unwrap", "triangle", "differential"}),
        (Ablation(lower=False), {"cycle", "wrap", "differential"}),
    ],
)
def test_each_global_ablation_leaves_its_terms_out(ablation: Ablation, names: set[str]) -> None:
    config = replace(SMALL, ablation=ablation)
    samples = surface_input("tube", 16)
    run, source = Training.begin(config, samples, CPU), BatchSource(samples, config, CPU)
    assert isinstance(run.networks, GlobalNetworks)
    terms = global_terms(run.networks, source.draw(run.generator), config)
    assert set(terms) == names
    assert all(value.item() > 0.0 for value in terms.values())


@pytest.mark.parametrize(
    ("ablation", "names"),
    [
        (Ablation(), {"cycle", "unwrap", "triangle"}),
        (Ablation(chart_differential=True), {"cycle", "unwrap", "triangle", "differential"}),
        (Ablation(chart_bidirectional=True), {"cycle", "unwrap", "triangle", "wrap", "upper_cycle"}),
    ],
)
def test_each_multi_chart_ablation_adds_its_terms(ablation: Ablation, names: set[str]) -> None:
    config = replace(SMALL, mode="multi-chart", ablation=ablation)
    samples = surface_input("tube", 16)
    run, source = Training.begin(config, samples, CPU), BatchSource(samples, config, CPU)
    assert isinstance(run.networks, MultiChartPaperNetworks)
    terms = chart_terms(run.networks, source.draw(run.generator), config)
    assert set(terms) == names
    trained = train_paper(surface_input("tube", 16), replace(config, steps=2), silent)
    assert all(value.isfinite().all() for value in trained.parameters())


def test_weights_multiply_their_terms() -> None:
    config = replace(SMALL, global_weights=GlobalWeights(1.0, 10.0, 100.0, 1000.0, 10000.0))
    samples = surface_input("tube", 16)
    run, source = Training.begin(config, samples, CPU), BatchSource(samples, config, CPU)
    assert isinstance(run.networks, GlobalNetworks)
    batch = source.draw(run.generator)
    terms = global_terms(run.networks, batch, config)
    by_hand = sum(
        factor * terms[name].item()
        for name, factor in zip(
            ("unwrap", "wrap", "cycle", "differential", "triangle"), (1, 10, 100, 1e3, 1e4), strict=True
        )
    )
    assert global_loss(run.networks, batch, config).item() == pytest.approx(by_hand, rel=1e-5)


@pytest.mark.parametrize("oriented", [True, False])
def test_a_point_cloud_has_no_triangle_and_perhaps_no_normal_term(config: PaperConfig, oriented: bool) -> None:
    mesh = surface_input("tube", 16)
    cloud = PaperInput(mesh.points, mesh.normals if oriented else None)
    trained = train_paper(cloud, config, silent)
    run, source = Training.begin(config, cloud, CPU), BatchSource(cloud, config, CPU)
    batch = source.draw(run.generator)
    assert (batch.triangles is None, batch.normal is None) == (True, not oriented)
    if isinstance(run.networks, GlobalNetworks):
        assert "triangle" not in global_terms(run.networks, batch, config)
    logits, uv = trained(torch.from_numpy(cloud.points).float())
    assert torch.isfinite(logits).all()
    assert torch.isfinite(uv).all()


def test_compiled_parts_are_put_back(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch, "compile", lambda function, **_: lambda *inputs: function(*inputs) + 1.0)
    networks, xyz = Training.begin(SMALL, surface_input("tube", 16), CPU).networks, torch.zeros(2, 3)
    assert isinstance(networks, GlobalNetworks)
    plain = networks.flatten(xyz)
    training.compile_parts(networks)
    torch.testing.assert_close(networks.flatten(xyz), plain + 1.0)
    training.plain_parts(networks)
    assert torch.equal(networks.flatten(xyz), plain)


def test_training_on_the_cpu_imports_no_compiler() -> None:
    code = """
import sys
import numpy as np
from flexpara.train.paper.batches import PaperInput
from flexpara.train.paper.config import PaperConfig, PaperNets
from flexpara.train.paper.training import train_paper
config = PaperConfig(steps=2, nets=PaperNets(hidden=8), device="cpu")
train_paper(PaperInput(np.random.default_rng(0).normal(size=(40, 3))), config, lambda step, loss: None)
assert "torch._dynamo" not in sys.modules and "torch._inductor" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


def test_bfloat16_trains_too(config: PaperConfig) -> None:
    losses: list[float] = []
    config = replace(config, dtype="bfloat16", steps=60)
    train_paper(surface_input("tube", 16), config, lambda _, loss: losses.append(loss))
    assert losses[-1] < losses[0]


@pytest.mark.parametrize("dtype", ["float32", "bfloat16"])
@pytest.mark.parametrize("points", [120, 1000], ids=["drawn batches", "whole input"])
def test_a_step_keeps_to_its_device(
    config: PaperConfig, points: int, dtype: Literal["float32", "bfloat16"], monkeypatch: pytest.MonkeyPatch
) -> None:
    """No CUDA here: torch's device "meta" computes shapes only, and fake tensors refuse to mix it with the CPU."""
    monkeypatch.setattr("flexpara.train.paper.neighbours._finite", lambda points: points)  # asks for values
    extras = Ablation(chart_bidirectional=True, chart_differential=True)
    config = replace(config, points=points, dtype=dtype, ablation=extras)
    device, generator = torch.device("meta"), torch.Generator().manual_seed(0)
    networks = training.make_networks(config, generator).to(device)
    batch = BatchSource(surface_input("tube", 16), config, device).draw(generator)
    terms = global_terms if config.mode == "global" else chart_terms
    with FakeTensorMode(allow_non_fake_inputs=True):
        loss = torch.stack(list(terms(networks, batch, config).values())).sum()  # pyright: ignore[reportArgumentType]
        gradients = torch.autograd.grad(loss, list(networks.parameters()), allow_unused=True)
    assert {gradient.device for gradient in gradients if gradient is not None} == {device}


@pytest.mark.filterwarnings("ignore:.*should not be instantiated:DeprecationWarning")  # torch 2.13 of itself
@pytest.mark.parametrize("name", ["flatten", "fold", "fold_jet"])
def test_the_maps_can_be_compiled_whole(config: PaperConfig, name: str) -> None:
    networks = training.make_networks(config, torch.Generator().manual_seed(0))
    charts = () if config.mode == "global" else (config.charts,)
    x = torch.rand(*(() if name == "flatten" else charts), 50, 3 if name == "flatten" else 2)
    plain = getattr(networks, name)
    whole = torch.compile(plain, dynamic=False, fullgraph=True, backend="aot_eager")
    torch.testing.assert_close(whole(x, torch.bfloat16), plain(x, torch.bfloat16))
