"""The paper's losses: triangles by hand, closed forms, and each equation written out once more over single elements.

The slow twins loop over points in float64 and share no line with the sources; value and gradient must agree.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import pytest
import torch

from flexpara.train.paper.gaps import cosine_gap, position_gap, weighted_mean
from flexpara.train.paper.losses import (
    angle_gap,
    box_side,
    corner_angles,
    edge_gap,
    edge_score,
    eigenvalue_gap,
    nearest_gap,
    repulsion,
    weighted_total,
)

if TYPE_CHECKING:
    from collections.abc import Callable

    from torch import Tensor

POINTS, CHARTS, NEAR = 17, 3, 4


def noise(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def indices(*shape: int, below: int, seed: int = 1) -> Tensor:
    return torch.randint(below, shape, generator=torch.Generator().manual_seed(seed))


def scores() -> Tensor:
    """(p, n) probabilities."""
    return torch.softmax(2.0 * noise(CHARTS, POINTS, seed=7), dim=0)


def one_hot() -> Tensor:
    """(p, n): chart 1 gets the first six points, chart 0 the rest, chart 2 none."""
    chart = (torch.arange(POINTS) < 6).long()
    return torch.nn.functional.one_hot(chart, CHARTS).T.double()


def agree(fast: Callable[..., Tensor], slow: Callable[..., Tensor], *inputs: Tensor) -> None:
    """Same scalar and the same gradient by every floating input."""
    leaves = [value.clone().requires_grad_(value.is_floating_point()) for value in inputs]
    wanted = [leaf for leaf in leaves if leaf.requires_grad]
    results = [function(*leaves) for function in (fast, slow)]
    torch.testing.assert_close(results[0], results[1], rtol=1e-6, atol=1e-9)
    first, second = (torch.autograd.grad(value, wanted, materialize_grads=True) for value in results)
    assert any(part.abs().max() > 0.0 for part in first)
    for a, b in zip(first, second, strict=True):
        torch.testing.assert_close(a, b, rtol=1e-5, atol=1e-8)


def length(vector: Tensor) -> Tensor:
    return torch.stack([vector[i] * vector[i] for i in range(len(vector))]).sum().sqrt()


def total(values: list[Tensor]) -> Tensor:
    return torch.stack(values).sum()


def angle_at(a: Tensor, b: Tensor, c: Tensor) -> Tensor:
    return torch.acos(((b - a) @ (c - a)) / (length(b - a) * length(c - a)))


# ── by hand and closed forms ──────────────────────────────────────────────────────────────────────────────────────────


def test_the_corners_of_a_right_triangle_by_hand() -> None:
    triangle = torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.0, math.sqrt(3.0)]], dtype=torch.float64)
    expected = [math.pi / 2.0, math.pi / 3.0, math.pi / 6.0]
    assert corner_angles(triangle).tolist() == pytest.approx(expected, abs=1e-6)


def test_corner_angles_are_the_same_in_space_and_plane() -> None:
    flat = noise(30, 3, 2)
    frame, _ = torch.linalg.qr(noise(3, 3, seed=3))
    torch.testing.assert_close(corner_angles(flat @ frame[:2]), corner_angles(flat), rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 40.0])
def test_a_similarity_has_no_angle_gap(scale: float) -> None:
    flat = noise(30, 3, 2)
    turn = torch.tensor([[math.cos(1.0), math.sin(1.0)], [-math.sin(1.0), math.cos(1.0)]], dtype=torch.float64)
    assert angle_gap(scale * flat @ turn, corner_angles(flat)).max().item() == pytest.approx(0.0, abs=1e-7)


def test_a_collapsed_triangle_has_a_finite_gradient() -> None:
    for points in ([[0.0, 0.0]] * 3, [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]], [[0.0, 0.0], [0.0, 0.0], [1.0, 0.0]]):
        for dtype in (torch.float32, torch.float64):
            uv = torch.tensor([points], dtype=dtype, requires_grad=True)
            angle_gap(uv, torch.full((1, 3), math.pi / 3.0, dtype=dtype)).sum().backward()
            assert uv.grad is not None
            assert torch.isfinite(uv.grad).all()


def test_a_similarity_has_no_conformal_error() -> None:
    frame, _ = torch.linalg.qr(noise(3, 3))
    assert eigenvalue_gap(5.0 * frame[:2, None]).item() == pytest.approx(0.0, abs=1e-6)


def test_a_stretch_by_two_has_eigenvalues_three_apart() -> None:
    jacobian = torch.tensor([[[2.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]]], dtype=torch.float64)
    assert eigenvalue_gap(jacobian).item() == pytest.approx(3.0)


def test_the_conformal_error_has_a_finite_gradient_at_the_optimum() -> None:
    for start in (torch.eye(2, 3), torch.zeros(2, 3)):
        jacobian = start[:, None].double().requires_grad_()
        eigenvalue_gap(jacobian).sum().backward()
        assert jacobian.grad is not None
        assert torch.isfinite(jacobian.grad).all()


def test_the_conformal_error_is_that_of_the_eigenvalues() -> None:
    jacobian = noise(2, 50, 3)
    metric = torch.einsum("inc,jnc->nij", jacobian, jacobian)
    low, high = torch.linalg.eigvalsh(metric).unbind(-1)
    torch.testing.assert_close(eigenvalue_gap(jacobian), high - low, rtol=0.0, atol=1e-7)


def test_the_box_is_as_wide_as_the_wider_side() -> None:
    uv = torch.tensor([[[0.0, 0.0], [2.0, 1.0]], [[-1.0, 0.0], [0.0, 3.0]]], requires_grad=True)
    side = box_side(uv)
    assert side.tolist() == [2.0, 3.0]
    assert not side.requires_grad


def test_neighbours_beyond_epsilon_are_not_repelled() -> None:
    uv = torch.tensor([[0.0, 0.0], [0.3, 0.4], [9.0, 0.0]], dtype=torch.float64)
    near = torch.tensor([[1], [0], [0]])
    value = repulsion(uv, near, torch.tensor(0.6, dtype=torch.float64))
    assert value[:, 0].tolist() == pytest.approx([0.1, 0.1, 0.0])


def test_coincident_neighbours_have_a_finite_gradient() -> None:
    uv = torch.zeros(2, 2, requires_grad=True)
    repulsion(uv, torch.tensor([[1], [0]]), torch.tensor(0.1)).sum().backward()
    assert uv.grad is not None
    assert torch.isfinite(uv.grad).all()


# ── each equation, written out once more ──────────────────────────────────────────────────────────────────────────────


def test_the_unwrapping_loss_equals_its_equation() -> None:
    near, epsilon = indices(POINTS, NEAR, below=POINTS), 1.3

    def slow(uv: Tensor) -> Tensor:
        terms = []
        for i in range(POINTS):
            for j in near[i].tolist():
                gap = epsilon - (length(uv[i] - uv[j]) if i != j else 0.0)
                terms.append(torch.as_tensor(gap, dtype=torch.float64).clamp(min=0.0))
        return total(terms)

    agree(lambda uv: repulsion(uv, near, torch.tensor(epsilon).double()).sum(), slow, noise(POINTS, 2))


def test_the_unwrapping_loss_of_charts_equals_its_equation() -> None:
    near, epsilon = indices(CHARTS, POINTS, NEAR, below=POINTS), noise(CHARTS, seed=4).abs() + 0.2

    def slow(uv: Tensor, score: Tensor) -> Tensor:
        terms = []
        for k in range(CHARTS):
            for i in range(POINTS):
                for j in near[k, i].tolist():
                    gap = length((uv[k, i] - uv[k, j]) * score[k, i]) if i != j else torch.zeros(())
                    terms.append((epsilon[k] - gap).clamp(min=0.0))
        return total(terms)

    agree(lambda uv, s: repulsion(uv, near, epsilon, s).sum(), slow, noise(CHARTS, POINTS, 2), scores())


def test_the_wrapping_loss_equals_its_equation() -> None:
    target = noise(POINTS, 3, seed=2)

    def fast(made: Tensor) -> Tensor:
        distance = torch.cdist(made, target).detach()
        there, back = nearest_gap(made, target, distance.argmin(1)), nearest_gap(target, made, distance.argmin(0))
        return weighted_mean(there, torch.ones(1)) + weighted_mean(back, torch.ones(1))

    def slow(made: Tensor) -> Tensor:
        there = [torch.stack([length(p - q) ** 2 for q in target]).min() for p in made]
        back = [torch.stack([length(p - q) ** 2 for q in made]).min() for p in target]
        return total(there) / len(made) + total(back) / len(target)

    agree(fast, slow, noise(POINTS + 3, 3))


def test_the_cycle_loss_equals_its_equation() -> None:
    xyz, normal = noise(POINTS, 3, seed=2), torch.nn.functional.normalize(noise(POINTS, 3, seed=3), dim=-1)
    hat = noise(POINTS, 2, seed=4)

    def fast(cycle: Tensor, hat_cycle: Tensor) -> Tensor:
        points = position_gap(cycle[:, :3], xyz) + cosine_gap(cycle[:, 3:], normal)
        return (points + position_gap(hat_cycle, hat)).sum()

    def slow(cycle: Tensor, hat_cycle: Tensor) -> Tensor:
        terms = []
        for i in range(POINTS):
            terms += [abs(xyz[i, c] - cycle[i, c]) for c in range(3)]
            terms += [abs(hat[i, c] - hat_cycle[i, c]) for c in range(2)]
            terms.append(1.0 - (cycle[i, 3:] @ normal[i]) / length(cycle[i, 3:]))
        return total(terms)

    agree(fast, slow, noise(POINTS, 6), noise(POINTS, 2, seed=5))


@pytest.mark.parametrize("weights", [scores(), one_hot()], ids=["scores", "one-hot"])
def test_the_cycle_loss_of_charts_equals_its_equation(weights: Tensor) -> None:
    xyz, normal = noise(POINTS, 3, seed=2), torch.nn.functional.normalize(noise(POINTS, 3, seed=3), dim=-1)

    def fast(cycle: Tensor, score: Tensor) -> Tensor:
        return weighted_mean(position_gap(cycle[..., :3], xyz) + cosine_gap(cycle[..., 3:], normal), score)

    def slow(cycle: Tensor, score: Tensor) -> Tensor:
        terms = []
        for k in range(CHARTS):
            for i in range(POINTS):
                terms += [abs(xyz[i, c] - cycle[k, i, c]) * score[k, i] for c in range(3)]
                cosine = (cycle[k, i, 3:] @ normal[i]) / length(cycle[k, i, 3:])
                terms.append((1.0 - cosine) * score[k, i])
        return total(terms) / POINTS

    agree(fast, slow, noise(CHARTS, POINTS, 6), weights)


def test_the_differential_distortion_equals_its_equation() -> None:
    def slow(jacobian: Tensor) -> Tensor:
        terms = []
        for i in range(POINTS):
            e, g = jacobian[0, i] @ jacobian[0, i], jacobian[1, i] @ jacobian[1, i]
            f = jacobian[0, i] @ jacobian[1, i]
            root = ((e + g) ** 2 / 4.0 - (e * g - f * f)).sqrt()  # eigenvalues of a 2 × 2 matrix by trace, determinant
            terms.append(abs(((e + g) / 2.0 + root) - ((e + g) / 2.0 - root)))
        return total(terms)

    agree(lambda jacobian: eigenvalue_gap(jacobian).sum(), slow, noise(2, POINTS, 3))


def test_the_triangle_distortion_equals_its_equation() -> None:
    solid = noise(POINTS, 3, 3, seed=2)

    def slow(flat: Tensor) -> Tensor:
        terms = []
        for t in range(POINTS):
            for i in range(3):
                a, b, c = i, (i + 1) % 3, (i + 2) % 3
                theta, beta = (angle_at(side[a], side[b], side[c]) for side in (solid[t], flat[t]))
                terms.append(abs(theta - beta))
        return total(terms)

    agree(lambda flat: angle_gap(flat, corner_angles(solid)).sum(), slow, noise(POINTS, 3, 2))


@pytest.mark.parametrize("weights", [scores(), one_hot()], ids=["scores", "one-hot"])
def test_the_isometric_loss_of_charts_equals_its_equation(weights: Tensor) -> None:
    xyz, triangles = noise(POINTS, 3, seed=2), torch.stack([torch.arange(3) + i for i in range(POINTS - 2)])
    edges = torch.cat([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    lengths = (xyz[edges[:, 0]] - xyz[edges[:, 1]]).norm(dim=1)

    def slow(uv: Tensor, score: Tensor) -> Tensor:
        terms = []
        for k in range(CHARTS):
            for triangle in triangles.tolist():
                for a, b in ((0, 1), (1, 2), (2, 0)):
                    i, j = triangle[a], triangle[b]
                    gap = length(xyz[i] - xyz[j]) - length(uv[k, i] - uv[k, j])
                    terms.append((score[k, i] + score[k, j]) / 2.0 * gap**2)
        return total(terms)

    def fast(uv: Tensor, score: Tensor) -> Tensor:
        return len(edges) * weighted_mean(edge_gap(uv, edges, lengths), edge_score(score, edges))

    agree(fast, slow, noise(CHARTS, POINTS, 2), weights)


# ── one-hot scores ────────────────────────────────────────────────────────────────────────────────────────────────────


def test_a_one_hot_score_repels_as_the_subset_does() -> None:
    """Beyond the subset the equation leaves the constant ε a neighbour, which moves nothing."""
    score, epsilon = one_hot()[1], torch.tensor(1.5).double()
    near = indices(6, NEAR, below=6)
    padded = torch.cat([near, indices(POINTS - 6, NEAR, below=POINTS)])
    whole, part = (noise(POINTS, 2)[:count].clone().requires_grad_() for count in (POINTS, 6))
    value = repulsion(whole, padded, epsilon, score)
    own = repulsion(part, near, epsilon)
    torch.testing.assert_close(value[:6], own)
    torch.testing.assert_close(value[6:], torch.full_like(value[6:], 1.5), atol=1e-5, rtol=0.0)
    (gradient,), (expected,) = torch.autograd.grad(value.sum(), whole), torch.autograd.grad(own.sum(), part)
    torch.testing.assert_close(gradient[:6], expected)
    assert gradient[6:].abs().max() < 1e-12


def test_a_one_hot_score_weighs_edges_as_the_subset_does() -> None:
    xyz, uv, score = noise(POINTS, 3), noise(1, POINTS, 2, seed=3), one_hot()[1:2]
    edges = torch.tensor([[0, 1], [2, 5], [5, 6], [7, 8]])  # inside, inside, across, outside
    lengths = (xyz[edges[:, 0]] - xyz[edges[:, 1]]).norm(dim=1)
    gap = edge_gap(uv, edges, lengths)
    assert edge_score(score, edges).tolist() == [[1.0, 1.0, 0.5, 0.0]]
    inside = gap[0, :2].sum() + 0.5 * gap[0, 2]
    torch.testing.assert_close(len(edges) * weighted_mean(gap, edge_score(score, edges)), inside)


# ── the sum ───────────────────────────────────────────────────────────────────────────────────────────────────────────


def test_the_total_weighs_each_term_by_its_name() -> None:
    terms = {"cycle": torch.tensor(2.0), "wrap": torch.tensor(3.0)}
    assert weighted_total(terms, {"wrap": 10.0, "cycle": 1.0, "unwrap": 5.0}).item() == 32.0


def test_a_term_without_a_weight_is_no_silent_zero() -> None:
    with pytest.raises(KeyError, match="cycel"):
        weighted_total({"cycel": torch.tensor(2.0)}, {"cycle": 1.0})
