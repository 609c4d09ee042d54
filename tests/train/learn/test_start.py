"""The geometric start: points by hand, clusters that lie apart, planes flattened onto themselves; solids."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import StartConfig
from flexpara.train.learn.start import cluster, farthest_points, plane_projection
from flexpara.train.sampling import Samples, sample_surface

if TYPE_CHECKING:
    from numpy.typing import NDArray

CONFIG = StartConfig()


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def samples_of(name: str, count: int = 2000) -> Samples:
    vertices, faces = make_sample(name, resolution=24)
    return sample_surface(Surface(Frame.of(vertices).apply(vertices), faces), count, rng())


def blobs() -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Two far balls of points with equal normals, interleaved: xyz, normal, and which ball."""
    which = np.arange(200) % 2
    xyz = 0.1 * rng().normal(size=(200, 3)) + np.outer(which, [5.0, 0.0, 0.0])
    return xyz, np.tile([0.0, 0.0, 1.0], (200, 1)), which


def test_farthest_points_on_a_line_by_hand() -> None:
    line = np.array([[0.0], [1.0], [4.0], [10.0]])
    assert farthest_points(line, 4, 1).tolist() == [1, 3, 2, 0]


def test_farthest_points_spread_at_least_as_far_as_any_point_is_from_them() -> None:
    xyz = samples_of("sphere").xyz
    chosen = xyz[farthest_points(xyz, 12, 0)]
    apart = np.linalg.norm(chosen[:, None] - chosen, axis=2) + 10.0 * np.eye(12)
    cover = np.linalg.norm(xyz[:, None] - chosen, axis=2).min(axis=1).max()
    assert apart.min() >= cover


@pytest.mark.parametrize("seed", range(5))
def test_two_far_clusters_are_told_apart(seed: int) -> None:
    xyz, normal, which = blobs()
    label = cluster(xyz, normal, 2, CONFIG, rng(seed))
    assert label.dtype == np.int64
    assert np.array_equal(label, which) or np.array_equal(label, 1 - which)


def test_one_cluster_takes_all() -> None:
    xyz, normal, _ = blobs()
    assert not cluster(xyz, normal, 1, CONFIG, rng()).any()


def test_the_two_sides_of_a_sheet_are_told_apart_by_their_normals() -> None:
    xyz = np.append(rng().uniform(-0.3, 0.3, size=(400, 2)), np.zeros((400, 1)), axis=1)
    up = np.arange(400) % 2
    normal = np.outer(2.0 * up - 1.0, [0.0, 0.0, 1.0])
    label = cluster(xyz, normal, 2, replace(CONFIG, normal_weight=1.0), rng())
    assert np.array_equal(label, up) or np.array_equal(label, 1 - up)
    blind = cluster(xyz, normal, 2, replace(CONFIG, normal_weight=0.0), rng())
    assert 0.3 < (blind == up).mean() < 0.7


def test_labels_follow_from_the_seed() -> None:
    samples = samples_of("torus")
    first, again = (cluster(samples.xyz, samples.normal, 8, CONFIG, rng(3)) for _ in range(2))
    np.testing.assert_array_equal(first, again)
    other = cluster(samples.xyz, samples.normal, 8, CONFIG, rng(4))
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("name", ["sphere", "torus", "tube", "cone", "cube", "cloth"])
def test_every_cluster_of_a_solid_has_a_fair_share(name: str) -> None:
    samples = samples_of(name)
    share = np.bincount(cluster(samples.xyz, samples.normal, 8, CONFIG, rng()), minlength=8) / len(samples.xyz)
    assert len(share) == 8
    assert share.min() > 0.02


def test_six_clusters_of_a_cube_are_its_sides() -> None:
    samples = samples_of("cube")
    label = cluster(samples.xyz, samples.normal, 6, replace(CONFIG, normal_weight=2.0), rng())
    side = np.abs(samples.normal).argmax(axis=1) * 2 + (samples.normal.sum(axis=1) > 0.0)
    assert len(np.unique(label * 6 + side)) == 6


def test_more_rounds_narrow_the_clusters() -> None:
    samples = samples_of("torus")
    feature = np.concatenate([samples.xyz, CONFIG.normal_weight * samples.normal], axis=1)
    spread = []
    for rounds in (1, 2, 4, 12):
        label = cluster(samples.xyz, samples.normal, 8, replace(CONFIG, rounds=rounds), rng())
        spread.append(sum(((feature[label == k] - feature[label == k].mean(axis=0)) ** 2).sum() for k in range(8)))
    assert (np.diff(spread) < 0.0).all()


def tilted_plane() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points (300, 3) of a plane far from the origin, and its normal for each."""
    axes, _ = np.linalg.qr(rng(5).normal(size=(3, 3)))
    axes[:, 2] *= np.linalg.det(axes)
    flat = rng(6).uniform(-1.0, 1.0, size=(300, 2)) * [2.0, 0.5]
    return flat @ axes[:, :2].T + [3.0, -2.0, 1.0], np.tile(axes[:, 2], (300, 1))


def test_the_projection_of_a_plane_is_an_isometry() -> None:
    xyz, normal = tilted_plane()
    (uv,) = plane_projection(xyz, normal, np.zeros(300, dtype=np.int64), 1)
    np.testing.assert_allclose(uv.mean(axis=0), 0.0, atol=1e-12)
    apart = np.linalg.norm(xyz[:, None] - xyz, axis=2)
    np.testing.assert_allclose(np.linalg.norm(uv[:, None] - uv, axis=2), apart, atol=1e-12)


def test_the_projection_looks_from_outside() -> None:
    xyz, normal = tilted_plane()
    (uv,) = plane_projection(xyz, normal, np.zeros(300, dtype=np.int64), 1)
    turn = np.cross(xyz[1] - xyz[0], xyz[2] - xyz[0]) @ normal[0]
    assert np.linalg.det(uv[1:3] - uv[0]) == pytest.approx(turn, abs=1e-12)
    (behind,) = plane_projection(xyz, -normal, np.zeros(300, dtype=np.int64), 1)
    assert np.linalg.det(behind[1:3] - behind[0]) == pytest.approx(-turn, abs=1e-12)


def test_the_longest_direction_of_a_cluster_becomes_u() -> None:
    xyz, normal = tilted_plane()
    (uv,) = plane_projection(xyz, normal, np.zeros(300, dtype=np.int64), 1)
    assert uv[:, 0].std() > 3.0 * uv[:, 1].std()
    assert (uv[:, 0] * uv[:, 1]).mean() == pytest.approx(0.0, abs=1e-10)


def test_every_point_is_projected_onto_every_plane() -> None:
    xyz, normal, which = blobs()
    uv = plane_projection(xyz, normal, which, 2)
    assert uv.shape == (2, 200, 2)
    for k in range(2):
        np.testing.assert_allclose(uv[k, which == k].mean(axis=0), 0.0, atol=1e-12)
        assert np.linalg.norm(uv[k, which != k], axis=1).min() > 4.0


def test_a_cluster_without_points_projects_to_zero() -> None:
    xyz, normal, which = blobs()
    uv = plane_projection(xyz, normal, 2 * which, 3)
    assert not uv[1].any()
    assert uv[0].any()
    assert uv[2].any()


@pytest.mark.parametrize("name", ["sphere", "torus", "cone", "cube"])
def test_the_projection_never_lengthens(name: str) -> None:
    samples = samples_of(name, 400)
    label = cluster(samples.xyz, samples.normal, 4, CONFIG, rng())
    uv = plane_projection(samples.xyz, samples.normal, label, 4)
    apart = np.linalg.norm(samples.xyz[:, None] - samples.xyz, axis=2)
    for flat in uv:
        assert (np.linalg.norm(flat[:, None] - flat, axis=2) <= apart + 1e-12).all()


def test_a_closed_cluster_whose_normals_cancel_is_projected_all_the_same() -> None:
    xyz = samples_of("sphere", 400).xyz
    both = np.concatenate([xyz, -xyz])
    (uv,) = plane_projection(both, both, np.zeros(800, dtype=np.int64), 1)
    assert np.isfinite(uv).all()
    assert (uv.std(axis=0) > 0.1).all()
