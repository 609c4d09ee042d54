"""Batches: the whole input where it fits, else distinct points that hold whole triangles; bad input is named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from flexpara.runtime.errors import MeshError, ShapeError
from flexpara.runtime.samples import make_sample
from flexpara.train.paper.batches import BatchSource, PaperInput, cloud_edges
from flexpara.train.paper.config import PaperConfig
from flexpara.train.paper.losses import corner_angles
from flexpara.train.paper.neighbours import Neighbourhood, _by_blocks, chart_neighbours, own_neighbours

CPU = torch.device("cpu")
CONFIG = PaperConfig(points=100, device="cpu")


def sphere() -> PaperInput:
    vertices, faces = make_sample("sphere", resolution=16)
    return PaperInput(vertices, vertices, faces)


def test_a_small_input_is_the_batch() -> None:
    samples = sphere()
    source = BatchSource(samples, replace(CONFIG, points=10_000), CPU)
    generator = torch.Generator().manual_seed(0)
    before = generator.get_state()
    batch = source.draw(generator)
    assert torch.equal(generator.get_state(), before)
    assert batch.triangles is not None
    assert samples.faces is not None
    np.testing.assert_array_equal(batch.triangles.numpy(), samples.faces)
    np.testing.assert_allclose(batch.xyz.numpy(), samples.points, atol=1e-6)
    assert (len(batch.all_xyz), batch.edge_total) == (len(samples.points), 3 * len(samples.faces))


def test_a_drawn_batch_has_distinct_points_and_whole_triangles() -> None:
    samples = sphere()
    batch = BatchSource(samples, CONFIG, CPU).draw(torch.Generator().manual_seed(0))
    assert batch.xyz.shape == (100, 3)
    assert len(torch.unique(batch.xyz, dim=0)) == 100
    assert batch.triangles is not None
    assert batch.angles is not None
    assert batch.triangles.shape == (33, 3)
    torch.testing.assert_close(corner_angles(batch.xyz[batch.triangles]), batch.angles, atol=1e-4, rtol=0.0)
    assert batch.edges.shape == (99, 2)
    assert samples.faces is not None
    sides = {frozenset(map(tuple, np.round(samples.points[f], 5).tolist())) for f in samples.faces}
    drawn = [frozenset(map(tuple, np.round(t, 5).tolist())) for t in batch.xyz[batch.triangles].double().numpy()]
    assert all(any(_close(one, other) for other in sides) for one in drawn[:5])


def _close(one: frozenset[tuple[float, ...]], other: frozenset[tuple[float, ...]]) -> bool:
    return bool(np.allclose(sorted(one), sorted(other), atol=1e-4))


def test_lengths_and_angles_are_those_of_the_surface() -> None:
    batch = BatchSource(sphere(), CONFIG, CPU).draw(torch.Generator().manual_seed(0))
    ends = batch.xyz[batch.edges]
    torch.testing.assert_close(batch.lengths, (ends[:, 0] - ends[:, 1]).norm(dim=1))
    assert batch.angles is not None
    torch.testing.assert_close(batch.angles.sum(dim=1), torch.full((33,), torch.pi), atol=1e-4, rtol=0.0)


def test_each_draw_is_another_and_the_seed_decides() -> None:
    source = BatchSource(sphere(), CONFIG, CPU)
    generator = torch.Generator().manual_seed(0)
    first, second = source.draw(generator), source.draw(generator)
    again = source.draw(torch.Generator().manual_seed(0))
    assert not torch.equal(first.xyz, second.xyz)
    assert torch.equal(first.xyz, again.xyz)


def test_the_lattice_of_the_whole_input_spans_the_square() -> None:
    source = BatchSource(sphere(), replace(CONFIG, points=10_000), CPU)
    lattice = source.draw(torch.Generator()).lattice
    assert lattice.shape == (12**2, 2)
    assert lattice.min(dim=0).values.tolist() == [-1.0, -1.0]
    assert lattice.max(dim=0).values.tolist() == [1.0, 1.0]


def test_a_drawn_lattice_is_regular_moves_and_stays_inside() -> None:
    source, generator = BatchSource(sphere(), replace(CONFIG, points=110), CPU), torch.Generator().manual_seed(0)
    lattices = torch.stack([source.draw(generator).lattice for _ in range(40)])
    assert lattices.shape == (40, 100, 2)
    steps = lattices[0, :10, 1].diff()
    torch.testing.assert_close(steps, torch.full((9,), 0.2))
    assert lattices.abs().max() <= 1.0
    assert lattices.std(dim=0).min() > 0.02


def test_edges_of_a_cloud_join_near_points() -> None:
    points = torch.arange(20.0)[:, None] * torch.tensor([[1.0, 0.0, 0.0]])
    edges = cloud_edges(points, 2)
    assert edges.shape == (40, 2)
    inner = edges[(edges[:, 0] > 0) & (edges[:, 0] < 19)]
    assert (inner[:, 0] - inner[:, 1]).abs().tolist() == [1] * len(inner)


def test_neighbours_are_those_of_all_distances() -> None:
    points = torch.randn(200, 2, generator=torch.Generator().manual_seed(0))
    distance = torch.cdist(points, points)
    expected = distance.topk(6, largest=False).indices[:, 1:]
    assert torch.equal(own_neighbours(points, 5), expected)
    assert torch.equal(_by_blocks(points, points, 6)[:, 1:], expected)
    charts = points.view(4, 50, 2)
    each = torch.stack([own_neighbours(chart, 5) for chart in charts])
    assert torch.equal(chart_neighbours(charts, 5), each)
    assert torch.equal(_by_blocks(charts, charts, 6)[..., 1:], each)
    assert torch.equal(Neighbourhood(points).nearest(points[:7], 1)[:, 0], torch.arange(7))


def test_few_points_have_fewer_neighbours() -> None:
    assert own_neighbours(torch.eye(3), 8).shape == (3, 2)


def test_the_digest_tells_inputs_apart() -> None:
    samples = sphere()
    cloud = PaperInput(samples.points, samples.normals)
    moved = PaperInput(samples.points + 1e-9, samples.normals, samples.faces)
    assert len({samples.sha256(), cloud.sha256(), PaperInput(samples.points).sha256(), moved.sha256()}) == 4
    assert samples.sha256() == sphere().sha256()


def test_bad_input_is_named() -> None:
    points = np.zeros((20, 3))
    with pytest.raises(ShapeError, match=r"expected \(n, 3\)"):
        PaperInput(points.T)
    with pytest.raises(MeshError, match="at least 16"):
        PaperInput(points[:3])
    with pytest.raises(MeshError, match="finite"):
        PaperInput(np.full((20, 3), np.nan))
    with pytest.raises(ShapeError, match="normals"):
        PaperInput(points, points[:5])
    with pytest.raises(MeshError, match="names a point outside"):
        PaperInput(points, faces=np.array([[0, 1, 20]]))
    with pytest.raises(ShapeError, match="faces"):
        PaperInput(points, faces=np.zeros((0, 3), dtype=np.int64))
