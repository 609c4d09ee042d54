"""Samples the networks are fitted to: patches and seams of a cut sheet by hand, then of a cube."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from flexpara.runtime.mesh import Charts, Surface
from flexpara.train.deploy.fit import sample_patches, sample_seams, seam_halfedges

Cut = tuple[Surface, Charts]


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def charts_by(face_chart: NDArray[np.int64], corner_uv: NDArray[np.float64]) -> Charts:
    """Charts of one patch each."""
    count = int(face_chart.max()) + 1
    return Charts(face_chart, corner_uv, face_chart, np.arange(count), ("slim",) * count)


def test_patch_samples_bring_back_their_chart_uv(two_halves: Cut) -> None:
    surface, charts = two_halves
    samples = sample_patches(surface, charts, 200, rng())
    assert samples.xyz.shape == (2, 200, 3)
    assert samples.uv.shape == (2, 200, 2)
    assert samples.centre.shape == (2, 1, 2)
    assert samples.scale.shape == (2, 1, 1)
    left, right = (samples.uv * samples.scale + samples.centre).numpy()
    np.testing.assert_allclose(left, samples.xyz[0, :, :2].numpy(), atol=1e-6)
    x, y, _ = samples.xyz[1].numpy().T
    np.testing.assert_allclose(right, np.stack([5.0 - y, x - 3.0], axis=1), atol=1e-5)


def test_patch_samples_are_centred_and_fill_the_unit_square(two_halves: Cut) -> None:
    samples = sample_patches(*two_halves, 500, rng())
    np.testing.assert_allclose(samples.uv.mean(dim=1).numpy(), 0.0, atol=1e-5)
    np.testing.assert_allclose(samples.uv.abs().amax(dim=(1, 2)).numpy(), 1.0, atol=1e-5)


def test_patch_samples_lie_on_their_own_patch(two_halves: Cut) -> None:
    samples = sample_patches(*two_halves, 500, rng())
    assert samples.xyz[0, :, 0].max().item() <= 0.0
    assert samples.xyz[1, :, 0].min().item() >= 0.0


def test_one_shared_edge_is_a_seam_of_two_half_edges() -> None:
    surface = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    charts = charts_by(np.array([0, 1]), surface.triangles[..., :2])
    assert sorted(seam_halfedges(surface, charts).tolist()) == [2, 3]
    joined = charts_by(np.array([0, 0]), surface.triangles[..., :2])
    assert seam_halfedges(surface, joined).tolist() == []


@pytest.mark.parametrize("divided", [True, False])
def test_a_slit_is_a_seam_where_it_divides_two_patches(two_halves: Cut, divided: bool) -> None:
    surface, cut = two_halves
    patch = cut.face_patch if divided else np.zeros_like(cut.face_patch)
    one = np.zeros_like(cut.face_chart)
    charts = Charts(one, cut.corner_uv, patch, np.zeros(patch.max() + 1, np.int64), ("slit",))
    assert len(seam_halfedges(surface, charts)) == (20 if divided else 0)


def test_a_smooth_border_between_two_patches_is_no_seam(two_halves: Cut) -> None:
    surface, cut = two_halves
    uv = surface.triangles[..., :2].copy()
    charts = Charts(np.zeros_like(cut.face_chart), uv, cut.face_patch, np.zeros(2, np.int64), ("slim",))
    assert seam_halfedges(surface, charts).tolist() == []


def test_the_seams_of_a_cube_are_its_edges(six_sides: Cut) -> None:
    surface, charts = six_sides
    half = seam_halfedges(surface, charts)
    face, corner = half // 3, half % 3
    ends = np.stack([surface.faces[face, corner], surface.faces[face, (corner + 1) % 3]], axis=1)
    side = np.abs(surface.vertices).max()
    assert len(half) == 2 * 12 * 6
    assert (np.isclose(np.abs(surface.vertices[ends]), side).all(axis=1).sum(axis=1) >= 2).all()


def seam_points(
    surface: Surface, charts: Charts, count: int, reach: float
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """The samples as points (n, 3) and faces (n,)."""
    face, barycentric = sample_seams(surface, charts, count, reach, rng())
    return np.einsum("nc,ncd->nd", barycentric, surface.triangles[face]), face


def test_seam_samples_lie_in_their_faces_at_all_distances_up_to_the_reach(two_halves: Cut) -> None:
    surface, charts = two_halves
    points, face = seam_points(surface, charts, 4000, 0.02)
    low, high = surface.triangles[face].min(axis=1), surface.triangles[face].max(axis=1)
    assert (points >= low - 1e-12).all()
    assert (points <= high + 1e-12).all()
    assert (np.sign(points[:, 0]) == 2.0 * charts.face_chart[face] - 1.0).mean() > 0.999
    np.testing.assert_allclose(np.histogram(np.abs(points[:, 0]), 5, (0.0, 0.02))[0], 4000 / 5, rtol=0.15)
    assert 0.45 < (face % 2).mean() < 0.55
    np.testing.assert_allclose(np.histogram(points[:, 1], 7, (-0.7, 0.7))[0], 4000 / 7, rtol=0.2)


def test_a_seam_three_times_as_long_gets_three_times_the_samples() -> None:
    xyz = np.array([[0.0, 0, 0], [3, 0, 0], [0, 1, 0], [0, -2, 0], [-2, 0, 0]])
    surface = Surface(xyz, np.array([[0, 1, 2], [1, 0, 3], [0, 2, 4]]))
    charts = charts_by(np.arange(3), surface.triangles[..., :2])
    points, face = seam_points(surface, charts, 4000, 0.01)
    assert (np.abs(points[:, 1]) < np.abs(points[:, 0])).mean() == pytest.approx(0.75, abs=0.02)
    assert (face == 0).mean() == pytest.approx(0.5, abs=0.03)


def test_without_a_seam_there_are_no_seam_samples(sheet: Surface) -> None:
    points, face = seam_points(sheet, charts_by(np.zeros(200, np.int64), sheet.triangles[..., :2]), 50, 0.02)
    assert points.shape == (0, 3)
    assert face.shape == (0,)


def test_seam_samples_do_not_leave_small_faces(six_sides: Cut) -> None:
    surface, charts = six_sides
    points, face = seam_points(surface, charts, 2000, 10.0)
    _, barycentric = sample_seams(surface, charts, 2000, 10.0, rng())
    assert points.shape == (2000, 3)
    assert len(face) == 2000
    assert barycentric.min() >= 0.0
    np.testing.assert_allclose(barycentric.sum(axis=1), 1.0, atol=1e-12)
