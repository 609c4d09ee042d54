"""The paper's networks: its channels, forward = training path, jets against reverse mode, what is shipped."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest
import torch

from flexpara.train.paper.config import PaperNets
from flexpara.train.paper.networks import GlobalNetworks, LeakyPerceptron, MultiChartPaperNetworks, leaky_jet, plane_jet

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor, nn

SMALL = PaperNets(hidden=24, embedding=8)


def generator() -> torch.Generator:
    return torch.Generator().manual_seed(3)


def noise(*shape: int) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)


def channels(module: nn.Module) -> list[list[int]]:
    """Channels of each perceptron inside, in the order of the file."""
    found = [part for part in module.modules() if isinstance(part, LeakyPerceptron)]
    shapes = [[layer.weight.shape[-2:] for layer in part._affine()] for part in found]
    return [[shape[0][0], *(size[1] for size in shape)] for shape in shapes]


def weight_of(perceptron: LeakyPerceptron, layer: int) -> Tensor:
    return perceptron._affine()[layer].weight


def jacobian_by_reverse_mode(map_: Callable[[Tensor], Tensor], uv: Tensor) -> Tensor:
    """(2, n, 3): derivative of each coordinate by uv, one reverse pass each."""
    leaf = uv.clone().requires_grad_()
    xyz = map_(leaf)
    rows = [torch.autograd.grad(xyz[:, c].sum(), leaf, retain_graph=True)[0] for c in range(3)]
    return torch.stack(rows, dim=-1).permute(1, 0, 2)


def test_the_global_networks_have_the_papers_channels() -> None:
    networks = GlobalNetworks(PaperNets(), generator=generator())
    assert channels(networks.deform_net) == [[2, 512, 512, 512, 64], [66, 512, 512, 512, 2]]
    assert channels(networks.wrap_net) == [[2, 512, 512, 512, 64], [66, 512, 512, 512, 6]]
    assert channels(networks.cut_net) == [[3, 512, 512, 64], [67, 512, 512, 3]]
    assert channels(networks.unwrap_net) == [[3, 512, 512, 2]]


def test_the_multi_chart_networks_have_the_papers_channels() -> None:
    networks = MultiChartPaperNetworks(5, PaperNets(), generator=generator())
    assert channels(networks.embedding) == [[3, 512, 512]]
    assert channels(networks.assign) == [[512, 512, 5]]
    assert channels(networks.unwrap) == [[512, 512, 512, 2]]
    assert channels(networks.wrap_net) == [[2, 512, 512, 512, 6]]
    assert len(weight_of(networks.unwrap, 0)) == 5


def test_leaky_relu_of_a_jet_is_the_chain_rule_by_hand() -> None:
    jet = torch.tensor([[[3.0, -2.0]], [[1.0, 1.0]], [[-5.0, 10.0]]])
    assert leaky_jet(jet, 0.01).flatten(1).tolist() == [
        pytest.approx([3.0, -0.02]),
        pytest.approx([1.0, 0.01]),
        pytest.approx([-5.0, 0.1]),
    ]


def test_the_training_path_is_the_shipped_function() -> None:
    networks = GlobalNetworks(SMALL, generator=generator()).double()
    xyz = noise(9, 3)
    logits, uv = networks(xyz)
    assert logits.shape == (9, 1)
    assert not logits.any()
    torch.testing.assert_close(networks.flatten(xyz, torch.float64), uv[:, 0])
    position, normal = networks.wrap(uv[:, 0], torch.zeros(9, dtype=torch.int64))
    folded = networks.fold(uv[:, 0], torch.float64)
    torch.testing.assert_close(folded[:, :3], position)
    torch.testing.assert_close(torch.nn.functional.normalize(folded[:, 3:], dim=-1), normal)


def test_the_training_path_of_charts_is_the_shipped_function() -> None:
    networks = MultiChartPaperNetworks(3, SMALL, generator=generator()).double()
    xyz, patch = noise(9, 3), torch.arange(9) % 3
    logits, uv = networks(xyz)
    assert (logits.shape, uv.shape) == ((9, 3), (9, 3, 2))
    trained_logits, trained = networks.flatten(xyz, torch.float64)
    torch.testing.assert_close(trained_logits, logits)
    torch.testing.assert_close(trained.transpose(0, 1), uv)
    folded = networks.fold(trained, torch.float64)
    position, normal = networks.wrap(uv[torch.arange(9), patch], patch)
    torch.testing.assert_close(position, folded[patch, torch.arange(9), :3])
    torch.testing.assert_close(normal.norm(dim=-1), torch.ones(9).double())


def test_each_chart_is_a_network_of_its_own() -> None:
    networks = MultiChartPaperNetworks(3, SMALL, generator=generator()).double()
    xyz = noise(9, 3)
    before = networks(xyz)[1]
    with torch.no_grad():
        weight_of(networks.unwrap, 1)[1] += 1.0
    changed = (networks(xyz)[1] - before).abs().amax(dim=(0, 2)) > 0.0
    assert changed.tolist() == [False, True, False]


def test_spread_scores_have_the_deviation_asked_for() -> None:
    networks = MultiChartPaperNetworks(3, SMALL, generator=generator()).double()
    xyz = noise(50, 3)
    uv = networks(xyz)[1]
    networks.spread_scores(xyz, 4.0)
    logits, still = networks(xyz)
    torch.testing.assert_close(logits.mean(dim=0), torch.zeros(3).double(), rtol=0.0, atol=1e-9)
    torch.testing.assert_close(logits.std(dim=0), torch.full((3,), 4.0).double())
    assert torch.equal(uv, still)


def test_jets_of_the_wrap_net_equal_reverse_mode_in_value_and_gradient() -> None:
    networks = GlobalNetworks(SMALL, generator=generator()).double()
    uv = noise(9, 2)
    jet = networks.fold_jet(uv, torch.float64)
    torch.testing.assert_close(jet[0], networks.wrap_net(uv))
    torch.testing.assert_close(jet[1:, :, :3], jacobian_by_reverse_mode(lambda q: networks.wrap_net(q)[:, :3], uv))
    leaf = uv.clone().requires_grad_()
    xyz = networks.wrap_net(leaf)
    rows = [torch.autograd.grad(xyz[:, c].sum(), leaf, create_graph=True)[0] for c in range(3)]
    weight = weight_of(networks.wrap_net.code, 1)
    (slow,) = torch.autograd.grad((torch.stack(rows) ** 2).sum(), weight)
    (fast,) = torch.autograd.grad((jet[1:, :, :3] ** 2).sum(), weight)
    torch.testing.assert_close(fast, slow)


def test_jets_of_charts_equal_reverse_mode() -> None:
    networks = MultiChartPaperNetworks(2, SMALL, generator=generator()).double()
    uv = noise(2, 9, 2)
    jet = networks.fold_jet(uv, torch.float64)
    for k in range(2):

        def one(q: Tensor, k: int = k) -> Tensor:
            return networks.wrap_net(q)[k, :, :3]

        torch.testing.assert_close(jet[1:, k, :, :3], jacobian_by_reverse_mode(one, uv[k]))


def test_bfloat16_changes_the_maps_by_less_than_a_hundredth() -> None:
    networks = GlobalNetworks(PaperNets(hidden=128), generator=generator())
    xyz = noise(200, 3).float()
    exact, rounded = networks.flatten(xyz), networks.flatten(xyz, torch.bfloat16)
    assert rounded.dtype == torch.float32
    assert 0.0 < (exact - rounded).abs().max() < 0.01 * (exact.amax() - exact.amin())
    jet = networks.fold_jet(exact, torch.bfloat16)
    assert jet.dtype == torch.float32


def test_bfloat16_changes_gradients_by_less_than_a_twentieth() -> None:
    single = GlobalNetworks(PaperNets(hidden=128), generator=generator())
    several = MultiChartPaperNetworks(3, PaperNets(hidden=128), generator=generator())
    xyz, uv = noise(200, 3).float(), noise(3, 200, 2).float()
    maps: list[tuple[nn.Module, Callable[[torch.dtype], Tensor]]] = [
        (single, lambda dtype: single.flatten(xyz, dtype)),
        (single, lambda dtype: single.fold_jet(uv[0], dtype)),
        (several, lambda dtype: several.flatten(xyz, dtype)[1]),
        (several, lambda dtype: several.fold_jet(uv, dtype)),
    ]
    for networks, made in maps:
        parameters = list(networks.parameters())
        exact, rounded = (
            torch.cat(
                [
                    part.flatten()
                    for part in torch.autograd.grad((made(dtype) ** 2).sum(), parameters, allow_unused=True)
                    if part is not None
                ]
            )
            for dtype in (torch.float32, torch.bfloat16)
        )
        assert rounded.dtype == torch.float32
        assert 0.0 < (exact - rounded).norm() < 0.05 * exact.norm()


def test_blocks_of_points_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    single = GlobalNetworks(SMALL, generator=generator()).double()
    several = MultiChartPaperNetworks(3, SMALL, generator=generator(), bidirectional=True).double()
    xyz, uv = noise(11, 3), noise(3, 11, 2)

    def everything() -> list[Tensor]:
        exact = torch.float64
        made = [single.flatten(xyz, exact), single.deform(uv[0], exact), single.fold(uv[0], exact)]
        made += [single.fold_jet(uv[0], exact), *several.flatten(xyz, exact), *several.flatten(noise(3, 11, 3), exact)]
        return [*made, several.deform(uv[0], exact), several.fold(uv, exact), several.fold_jet(uv, exact)]

    whole = everything()
    monkeypatch.setattr("flexpara.train.paper.networks.BLOCK", 12)
    for first, second in zip(whole, everything(), strict=True):
        torch.testing.assert_close(first, second)


def test_a_plane_jet_carries_the_two_axes() -> None:
    jet = plane_jet(torch.tensor([[0.3, 0.7]]))
    assert jet.tolist() == [[[pytest.approx(0.3), pytest.approx(0.7)]], [[1.0, 0.0]], [[0.0, 1.0]]]


def test_the_same_seed_starts_the_same_networks() -> None:
    first, second = (GlobalNetworks(SMALL, generator=generator()).state_dict() for _ in range(2))
    assert all(torch.equal(first[name], second[name]) for name in first)
