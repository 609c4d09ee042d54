"""The deployed networks of whole atlases: flat and round charts, slits, thin plates, many parts, a real mesh."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh

from flexpara.runtime.geometry.triangles import signed_areas
from flexpara.runtime.mesh import Charts, Frame, Surface
from flexpara.train.deploy.config import FitConfig, SampleConfig
from flexpara.train.deploy.fit import fit_networks
from flexpara.train.deploy.gated import GatedExperts
from flexpara.train.sampling import sample_surface

Cut = tuple[Surface, Charts]
QUICK = FitConfig(samples=SampleConfig(even=20_000, beside=20_000))


def fitted(cut: Cut, config: FitConfig = QUICK, seed: int = 0) -> GatedExperts:
    return fit_networks(*cut, config, seed)


def judged(networks: GatedExperts, cut: Cut, count: int = 5000) -> tuple[float, float]:
    """Share of surface points that get the right chart, and rms of uv there as a share of √(total uv area)."""
    surface, charts = cut
    samples = sample_surface(surface, count, np.random.default_rng(99))
    truth = np.einsum("nc,ncd->nd", samples.barycentric, charts.corner_uv[samples.face])
    answer = networks(samples.xyz.astype(np.float32))
    right = answer.label == charts.face_chart[samples.face]
    error = np.linalg.norm(answer.value - truth, axis=1)[right]
    extent = np.sqrt(np.abs(signed_areas(charts.corner_uv)).sum())
    return float(right.mean()), float(np.sqrt((error**2).mean()) / extent)


def charts_of(face_chart: np.ndarray, corner_uv: np.ndarray) -> Charts:
    count = int(face_chart.max()) + 1
    return Charts(face_chart, corner_uv, face_chart, np.arange(count), ("slim",) * count)


def test_flat_charts_are_exact(two_halves: Cut, six_sides: Cut) -> None:
    for cut in (two_halves, six_sides):
        right, rms = judged(fitted(cut), cut)
        assert right > 0.999
        assert rms < 1e-6


def test_flat_charts_need_few_experts(two_halves: Cut, six_sides: Cut) -> None:
    assert len(fitted(two_halves).label) < 200
    assert len(fitted(six_sides).label) < 600


def rolled(slit: float) -> Cut:
    """A tube about z, unrolled from an edge that starts at the angle ``slit``: one chart with a slit along the tube."""
    around, rows = 60, 20
    i, j = np.meshgrid(np.arange(around), np.arange(rows + 1), indexing="ij")
    angle = slit + 2.0 * np.pi * i / around
    vertices = np.stack([0.5 * np.cos(angle), 0.5 * np.sin(angle), 1.6 * j / rows - 0.8], axis=-1).reshape(-1, 3)
    corner = np.arange(around * (rows + 1)).reshape(around, rows + 1)
    after = np.roll(corner, -1, axis=0)
    quad = np.stack([corner[:, :-1], after[:, :-1], after[:, 1:], corner[:, 1:]], axis=-1).reshape(-1, 4)
    faces = quad[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    unrolled = np.stack([np.pi * i / around, 1.6 * j / rows], axis=-1).reshape(-1, 2)
    uv = unrolled[faces]
    uv[..., 0] = np.where(uv[..., 0] < np.ptp(unrolled[:, 0]) / 2.0, uv[..., 0], uv[..., 0])
    last = np.repeat(np.arange(around) == around - 1, rows * 2)
    uv[last, :, 0] = np.where(uv[last, :, 0] < 1.0, np.pi, uv[last, :, 0])
    return Surface(vertices, faces), charts_of(np.zeros(len(faces), np.int64), uv)


@pytest.mark.parametrize("slit", [0.0, 1.234])
def test_a_slit_is_followed(slit: float) -> None:
    cut = rolled(slit)
    right, rms = judged(fitted(cut), cut)
    assert right == 1.0
    assert rms < 5e-4


def plate(thickness: float) -> Cut:
    """Both large sides of a plate, 2 × 0.4; the upper side's uv is turned and moved."""
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 19), np.linspace(-0.2, 0.2, 5), indexing="ij")
    corner = np.arange(x.size).reshape(x.shape)
    quad = np.stack([corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]], axis=-1).reshape(-1, 4)
    faces = quad[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    flat = np.stack([x.ravel(), y.ravel()], axis=1)
    sides = [np.column_stack([flat, np.full(len(flat), z)]) for z in (-0.5 * thickness, 0.5 * thickness)]
    vertices, both = np.concatenate(sides), np.concatenate([faces[:, ::-1], faces + len(flat)])
    uv = np.concatenate([flat, np.column_stack([3.0 + flat[:, 1], flat[:, 0]])])
    return Surface(vertices, both), charts_of(np.repeat([0, 1], len(faces)), uv[both])


@pytest.mark.parametrize("thickness", [0.1, 1e-3, 1e-5])
def test_both_sides_of_a_thin_plate_are_told_apart(thickness: float) -> None:
    cut = plate(thickness)
    right, rms = judged(fitted(cut), cut)
    assert right == 1.0
    assert rms < 1e-6


def leaves(count: int) -> Cut:
    """Separate squares all over the unit ball, turned at random, each a chart."""
    rng = np.random.default_rng(5)
    axes = np.linalg.qr(rng.normal(size=(count, 3, 3)))[0][:, :2]
    size = 0.7 / np.cbrt(count)
    square = size * (np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]) - 0.5)
    centre = 0.55 * rng.uniform(-1.0, 1.0, (count, 3))
    vertices = (centre[:, None] + np.einsum("ca,kad->kcd", square, axes)).reshape(-1, 3)
    faces = (4 * np.arange(count)[:, None] + [0, 1, 2, 0, 2, 3]).reshape(-1, 3)
    uv = np.tile(square[[[0, 1, 2], [0, 2, 3]]], (count, 1, 1))
    return Surface(vertices, faces), charts_of(np.repeat(np.arange(count), 2), uv)


def test_hundreds_of_parts_keep_their_charts_and_the_networks_stay_small() -> None:
    cut = leaves(400)
    networks = fitted(cut, replace(QUICK, samples=SampleConfig(per_face=100, even=40_000)))
    right, rms = judged(networks, cut)
    assert right > 0.98  # the squares run through each other
    assert rms < 1e-4
    assert len(networks.label) < 5000


def test_a_tiny_part_beside_a_large_one_is_known() -> None:
    """Both sides of the same plate, and of one a thousand times as small beside it."""
    surface, charts = plate(0.1)
    small = 1e-3 * surface.vertices + [0.0, 0.5, 0.0]
    both = Surface(
        np.concatenate([surface.vertices, small]),
        np.concatenate([surface.faces, surface.faces + len(surface.vertices)]),
    )
    chart = np.concatenate([charts.face_chart, charts.face_chart + 2])
    cut = both, charts_of(chart, np.concatenate([charts.corner_uv, 1e-3 * charts.corner_uv]))
    networks = fitted(cut)
    answer = networks(small[surface.faces].mean(axis=1).astype(np.float32))
    assert (answer.label == charts.face_chart + 2).mean() > 0.95


def test_points_off_the_surface_are_less_sure_the_farther_they_are(six_sides: Cut) -> None:
    networks = fitted(six_sides)
    surface = six_sides[0]
    points = sample_surface(surface, 500, np.random.default_rng(1))
    score = [networks((points.xyz + h * points.normal).astype(np.float32)).score.mean() for h in (0.0, 0.3, 1.0, 10.0)]
    assert score[0] > 0.99
    assert score == sorted(score, reverse=True)
    assert score[3] < 0.02


def test_the_same_seed_gives_the_same_networks(two_halves: Cut) -> None:
    first, again, other = (fitted(two_halves, seed=seed) for seed in (5, 5, 6))
    assert np.array_equal(first.weights, again.weights)
    assert np.array_equal(first.start, again.start)
    assert not np.array_equal(first.centre, other.centre)


def test_a_real_mesh_in_charts_by_direction(models: Path) -> None:
    mesh = trimesh.load_mesh(models / "spot.obj", process=False, skip_materials=True)
    vertices, inverse = np.unique(np.asarray(mesh.vertices), axis=0, return_inverse=True)
    surface = Surface(Frame.of(vertices).apply(vertices), inverse.reshape(-1)[np.asarray(mesh.faces)])
    normal = surface.face_normals()
    axis = np.abs(normal).argmax(axis=1)
    chart = 2 * axis + (normal[np.arange(len(axis)), axis] > 0.0)
    other = np.array([[1, 2], [0, 2], [0, 1]])[axis]
    uv = np.take_along_axis(surface.triangles, other[:, None, :].repeat(3, axis=1), axis=2)
    cut = surface, charts_of(chart, uv)
    right, rms = judged(fitted(cut, FitConfig()), cut)
    assert right > 0.995
    assert rms < 5e-4
