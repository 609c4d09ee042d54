"""Seams: a jump between points by hand, a sheet that tears nowhere, unrolled tubes and tori, steep bands."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from flexpara.runtime.errors import ShapeError
from flexpara.runtime.geometry.topology import boundary_loops, components, edge_table, euler_characteristic, is_manifold
from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.disks import cut_open
from flexpara.train.paper.learnedseams import SeamConfig, cut_points, seam_edges, tears

if TYPE_CHECKING:
    from numpy.typing import NDArray


CONFIG = SeamConfig()


def sample(name: str, resolution: int) -> Surface:
    vertices, faces = make_sample(name, resolution=resolution)
    return Surface(Frame.of(vertices).apply(vertices), faces)


def angle_around(surface: Surface) -> NDArray[np.float64]:
    """Azimuth (v,) in (−π, π]: it jumps at the negative x axis."""
    return np.arctan2(surface.vertices[:, 1], surface.vertices[:, 0])


def banded(angle: NDArray[np.float64], width: float) -> NDArray[np.float64]:
    """The angle as a network would have it: continuous, with a steep way back within ``width`` of its jump."""
    return angle * np.tanh((np.pi - np.abs(angle)) / width)


def unrolled_tube(width: float) -> tuple[Surface, NDArray[np.float64]]:
    tube = sample("tube", 48)
    angle = angle_around(tube)
    radius = float(np.hypot(*tube.vertices[0, :2]))
    return tube, np.stack([radius * (banded(angle, width) if width else angle), tube.vertices[:, 2]], axis=1)


def torus_angles(torus: Surface) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    ring = np.hypot(*torus.vertices[:, :2].T)
    return angle_around(torus), np.arctan2(torus.vertices[:, 2], ring - (ring.max() + ring.min()) / 2.0)


def seam_of(surface: Surface, uv: NDArray[np.float64], config: SeamConfig = CONFIG) -> NDArray[np.int64]:
    """Ends (s, 2) of the seam's edges; opening them leaves one disk."""
    table = edge_table(surface.faces)
    mask = seam_edges(surface, uv, config)
    opened = cut_open(surface.faces, mask, table)[0]
    assert components(opened).max() == 0
    assert euler_characteristic(opened) == 1
    assert len(boundary_loops(opened)) == 1
    assert is_manifold(opened)
    return table.edges[mask]


def length_of(surface: Surface, ends: NDArray[np.int64]) -> float:
    points = surface.vertices[ends]
    return float(np.linalg.norm(points[:, 1] - points[:, 0], axis=1).sum())


def test_points_beside_a_jump_are_cut_points() -> None:
    line = np.arange(10.0)
    points = np.stack([line, np.zeros(10), np.zeros(10)], axis=1)
    uv = np.stack([line + 100.0 * (line >= 5.0), np.zeros(10)], axis=1)
    assert np.flatnonzero(cut_points(points, uv, neighbours=2, share=0.1)).tolist() == [4, 5]
    assert not cut_points(points, points[:, :2], neighbours=2, share=0.3).any()


def test_the_threshold_is_a_share_of_the_longer_side_of_the_box() -> None:
    points = np.stack([np.arange(11.0), np.zeros(11), np.zeros(11)], axis=1)
    uv = points[:, :2] * 7.0  # steps of 7 in a box of 70
    assert not cut_points(points, uv, neighbours=1, share=0.1001).any()
    assert cut_points(points, uv, neighbours=1, share=0.0999).all()


def test_one_point_has_no_neighbour_to_be_cut_from() -> None:
    assert cut_points(np.zeros((1, 3)), np.zeros((1, 2))).tolist() == [False]


def test_uv_of_another_number_of_points_are_refused() -> None:
    with pytest.raises(ShapeError, match=r"uv \(n, 2\)"):
        cut_points(np.zeros((5, 3)), np.zeros((4, 2)))


def test_cut_points_of_a_tube_lie_along_its_jump() -> None:
    tube, uv = unrolled_tube(0.0)
    cut = cut_points(tube.vertices, uv, share=0.2)
    assert cut.any()
    assert (np.abs(angle_around(tube)[cut]) > np.pi - 0.3).all()


def test_a_similarity_tears_nowhere() -> None:
    sheet = sample("cloth", 24)
    flat = Surface(sheet.vertices * [1.0, 1.0, 0.0], sheet.faces)
    turned = flat.vertices[:, :2] @ np.array([[0.0, 5.0], [-5.0, 0.0]])
    torn = tears(flat, turned, CONFIG)
    inside = edge_table(flat.faces).manifold
    # across a diagonal the way from face to face over the edge's middle is the straight one, elsewhere it is longer
    assert torn.edge[inside].max() == pytest.approx(1.0)
    assert torn.edge[inside].min() > 0.7
    assert (torn.edge[~inside] == 0.0).all()
    assert not torn.band.any()


def test_slow_growth_of_a_conformal_map_is_no_tear() -> None:
    """The map z → exp(z) over a strip of length 4: the scale grows by e⁴, fifty times."""
    sheet = sample("cloth", 96)
    z = 2.0 * (sheet.vertices[:, 0] + 1j * sheet.vertices[:, 1]) / np.abs(sheet.vertices[:, 0]).max()
    flat = Surface(np.stack([z.real, z.imag, np.zeros(len(z))], axis=1), sheet.faces)
    image = np.exp(z)
    assert not tears(flat, np.stack([image.real, image.imag], axis=1), CONFIG).band.any()


def test_a_disk_that_is_not_torn_is_not_cut() -> None:
    sheet = sample("cloth", 24)
    assert len(seam_of(sheet, sheet.vertices[:, :2])) == 0


def test_a_tube_opens_along_the_jump_of_its_angle() -> None:
    tube, uv = unrolled_tube(0.0)
    seam = seam_of(tube, uv)  # either side of the torn strip will do, and a diagonal leads from one to the other
    assert length_of(tube, seam) == pytest.approx(np.ptp(tube.vertices[:, 2]), rel=0.05)
    assert (np.abs(angle_around(tube)[seam]) > np.pi - 2.0 * np.pi / 48 - 1e-9).all()


@pytest.mark.parametrize("width", [0.1, 0.2, 0.4])
def test_a_tube_opens_in_the_steepest_part_of_a_band(width: float) -> None:
    tube, uv = unrolled_tube(width)
    seam = seam_of(tube, uv)
    assert length_of(tube, seam) == pytest.approx(np.ptp(tube.vertices[:, 2]))
    assert (np.abs(angle_around(tube)[seam]) > np.pi - 2.0 * np.pi / 48 - 1e-9).all()


def test_a_turned_band_turns_the_seam() -> None:
    tube, _ = unrolled_tube(0.0)
    angle = np.angle(np.exp(1j * (angle_around(tube) - 2.0)))
    seam = seam_of(tube, np.stack([0.45 * banded(angle, 0.2), tube.vertices[:, 2]], axis=1))
    assert (np.abs(angle[seam]) > np.pi - 0.3).all()


@pytest.mark.parametrize("width", [0.0, 0.2])
def test_a_torus_opens_along_both_of_its_jumps(width: float) -> None:
    torus = sample("torus", 64)
    around, across = torus_angles(torus)
    u, v = (banded(a, width) if width else a for a in (around, across))
    seam = seam_of(torus, np.stack([0.7 * u, 0.3 * v], axis=1))
    on_jump = (np.abs(around[seam]) > np.pi - 0.2).all(axis=1) | (np.abs(across[seam]) > np.pi - 0.4).all(axis=1)
    assert on_jump.all()
    assert 0.9 < length_of(torus, seam) / (2.0 * np.pi * (0.3 + 0.4)) < 1.1


def test_a_torus_that_the_network_left_whole_is_cut_along_short_loops() -> None:
    torus = sample("torus", 32)
    assert length_of(torus, seam_of(torus, torus.vertices[:, :2])) < 2.0 * np.pi * 1.3


def test_a_sphere_opens_along_the_meridian_of_its_jump() -> None:
    sphere = sample("sphere", 40)
    turn, height = angle_around(sphere), np.arcsin(sphere.vertices[:, 2])
    seam = seam_of(sphere, np.stack([banded(turn, 0.2) * np.cos(height), height], axis=1))
    middle = np.abs(height[seam]).max(axis=1) < 1.0
    assert (np.abs(turn[seam[middle]]) > np.pi - 0.4).all()
    assert 0.6 * np.pi < length_of(sphere, seam) < 1.15 * np.pi


def test_a_sphere_without_a_band_is_slit_all_the_same() -> None:
    sphere = sample("sphere", 24)
    assert length_of(sphere, seam_of(sphere, np.zeros((len(sphere.vertices), 2)))) > 2.0


def slit_sheet(length: float) -> tuple[Surface, NDArray[np.float64]]:
    """A sheet torn from its right edge, y = 0, inwards: above the slit u and v run on, 0.8 higher."""
    sheet = sample("cloth", 64)
    extent = np.abs(sheet.vertices[:, 0]).max()
    xy = sheet.vertices[:, :2] / extent
    gap = 0.8 * np.clip((xy[:, 0] - (1.0 - length)) / 0.3, 0.0, 1.0) * (xy[:, 1] > 0.0)
    return Surface(np.concatenate([xy, np.zeros((len(xy), 1))], axis=1), sheet.faces), xy + np.outer(gap, [0.0, 1.0])


def test_a_long_branch_of_the_band_stays_a_slit() -> None:
    sheet, uv = slit_sheet(1.2)
    ends = sheet.vertices[seam_of(sheet, uv)]
    assert np.abs(ends[..., 1]).max() < 0.06
    assert 0.8 < np.ptp(ends[..., 0]) <= 1.2
    assert ends[..., 0].max() == pytest.approx(1.0)


def test_a_short_branch_of_the_band_is_pruned() -> None:
    sheet, uv = slit_sheet(1.2)
    assert len(seam_of(sheet, uv, SeamConfig(shortest=0.7))) == 0
    sheet, uv = slit_sheet(0.25)
    assert len(seam_of(sheet, uv)) == 0


def test_a_trefoil_tube_opens_along_a_band_and_no_farther() -> None:
    """Torn along and around the tube: the vertices of the sample are numbered along first."""
    trefoil = sample("trefoil", 48)
    along = 3 * 48
    around = len(trefoil.vertices) // along
    t, v = np.divmod(np.arange(len(trefoil.vertices)), around)
    t, v = (2.0 * np.pi * t / along - np.pi, 2.0 * np.pi * v / around - np.pi)
    seam = seam_of(trefoil, np.stack([2.0 * banded(t, 0.1), 0.14 * banded(v, 0.3)], axis=1))
    lines = (np.abs(t[seam]) > np.pi - 0.15).all(axis=1) | (np.abs(v[seam]) > np.pi - 1.1).all(axis=1)
    assert lines.all()


def test_more_faces_than_fit_into_32_bits_of_pairs() -> None:
    """Pairs of faces are numbered i · f + j: from 46,341 faces on, 32 bits don't hold them."""
    sphere = sample("sphere", 256)
    assert len(sphere.faces) > 46_341
    assert 2.5 < length_of(sphere, seam_of(sphere, np.zeros((len(sphere.vertices), 2)))) < 1.2 * np.pi


def test_the_smallest_closed_surface_becomes_a_disk() -> None:
    corners = np.array([[1.0, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    tetrahedron = Surface(corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]]))
    seam_of(tetrahedron, corners[:, :2])
