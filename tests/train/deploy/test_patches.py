"""Patches: conflicts of four points by hand, sheets that need none, and tubes, folds and ears that do."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components, dijkstra

from flexpara.runtime.mesh import Frame, Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.config import FinishConfig, PatchConfig
from flexpara.train.deploy.patches import Probes, joined_faces, probe_piece, split_into_patches, worst_conflict
from flexpara.train.finish.pieces import Piece, make_piece
from flexpara.train.finish.relief import Flat

if TYPE_CHECKING:
    from numpy.typing import NDArray

CONFIG = PatchConfig(largest=np.inf)  # tears alone; the limit on area has a test of its own


def grid_faces(columns: int, rows: int) -> NDArray[np.int64]:
    """Two triangles per cell of (columns, rows) vertices."""
    corner = np.arange(columns * rows).reshape(columns, rows)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)


def rolled(curve: NDArray[np.float64], rows: int, height: float) -> tuple[Surface, NDArray[np.float64]]:
    """The sheet that a plane curve (c, 2) sweeps along z, and its isometric uv (v, 2): arc length against height."""
    z = np.linspace(-height / 2.0, height / 2.0, rows)
    along = np.append(0.0, np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1)))
    xyz = np.concatenate([np.repeat(curve, rows, axis=0), np.tile(z, len(curve))[:, None]], axis=1)
    uv = np.stack([np.repeat(along, rows), np.tile(z, len(curve))], axis=1)
    return Surface(xyz, grid_faces(len(curve), rows)), uv


def arc(angle: float, columns: int, radius: float = 0.5) -> NDArray[np.float64]:
    turn = np.linspace(0.0, angle, columns)
    return radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)


def fold(gap: float, step: float) -> NDArray[np.float64]:
    """Two parallel lines of length 1, ``gap`` apart, joined at one end."""
    line = np.arange(-0.5, 0.5 + step / 2.0, step)
    below = np.stack([line, np.full_like(line, -gap / 2.0)], axis=1)
    return np.concatenate([below, below[::-1] * [1.0, -1.0]])


def patches_of(surface: Surface, uv: NDArray[np.float64], config: PatchConfig = CONFIG) -> NDArray[np.int64]:
    """Patches of a sheet that is one flattened piece."""
    piece = Piece(np.arange(len(surface.faces)), Flat(surface, uv, {}), 0.0, 0.0)
    return split_into_patches(piece, config)


def tears(
    xyz: NDArray[np.float64], uv: NDArray[np.float64], patch: NDArray[np.int64], config: PatchConfig = CONFIG
) -> int:
    """Pairs of faces of one patch that are close in space and too far apart in uv: the slow twin, all pairs."""
    apart = np.linalg.norm(xyz[:, None] - xyz, axis=2)
    flat = np.linalg.norm(uv[:, None] - uv, axis=2)
    torn = (apart < config.reach) & (flat > config.stretch * apart + config.gap) & (patch[:, None] == patch)
    return int(torn.sum()) // 2


def tears_of(surface: Surface, uv: NDArray[np.float64], patch: NDArray[np.int64]) -> int:
    return tears(surface.triangles.mean(axis=1), uv[surface.faces].mean(axis=1), patch)


def assert_connected(faces: NDArray[np.int64], patch: NDArray[np.int64]) -> None:
    """Patches are numbered without gaps, and each is one part of the flattened piece."""
    assert np.unique(patch).tolist() == list(range(int(patch.max()) + 1))
    links = joined_faces(faces, np.zeros((len(faces), 3)))
    for number in range(int(patch.max()) + 1):
        members = np.flatnonzero(patch == number)
        assert connected_components(links[members][:, members], directed=False)[0] == 1


def test_two_triangles_are_joined_by_the_distance_of_their_centroids() -> None:
    centroids = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]])
    links = joined_faces(np.array([[0, 1, 2], [0, 2, 3]]), centroids)
    np.testing.assert_allclose(links.toarray(), [[0.0, 5.0], [5.0, 0.0]])


def test_triangles_on_two_sides_of_a_slit_are_not_joined() -> None:
    assert joined_faces(np.array([[0, 1, 2], [3, 4, 5]]), np.zeros((2, 3))).nnz == 0


def test_distances_over_rings_go_almost_straight() -> None:
    surface, _ = rolled(np.stack([np.linspace(0.0, 1.0, 31), np.zeros(31)], axis=1), 31, 1.0)
    centroids = surface.triangles.mean(axis=1)
    straight = np.linalg.norm(centroids - centroids[0], axis=1)[100:]
    excess = [
        (dijkstra(joined_faces(surface.faces, centroids, rings=rings), indices=0)[100:] / straight).max()
        for rings in (1, 3)
    ]
    assert excess[0] > 1.25
    assert 1.0 <= excess[1] < 1.1


def test_every_inner_edge_of_a_sheet_joins() -> None:
    faces = grid_faces(4, 5)
    assert joined_faces(faces, np.zeros((len(faces), 3))).nnz == 2 * (3 * 4 + 2 * 4 + 3 * 3)


def probes(x: list[float], u: list[float], face: list[int]) -> Probes:
    """Points on the x axis with uv on the u axis."""
    zero = np.zeros(len(x))
    return Probes(np.stack([x, zero, zero], axis=1), np.stack([u, zero], axis=1), np.array(face))


def test_the_widest_tear_is_found_by_hand() -> None:
    points = probes([0.0, 0.01, 0.5, 0.51, 0.9], [0.0, 0.2, 0.0, 0.7, 9.0], [4, 5, 6, 7, 8])
    conflict = worst_conflict(points, CONFIG)
    assert conflict is not None
    assert {conflict.first, conflict.second} == {6, 7}


@pytest.mark.parametrize(("apart", "torn"), [(0.049, False), (0.051, True)])
def test_a_tear_is_more_than_stretch_and_gap_allow(apart: float, torn: bool) -> None:
    assert (worst_conflict(probes([0.0, 0.01], [0.0, apart], [0, 1]), CONFIG) is not None) == torn


def test_points_out_of_reach_are_no_conflict() -> None:
    assert worst_conflict(probes([0.0, 0.5, 1.0], [0.0, 50.0, 100.0], [0, 1, 2]), CONFIG) is None


def test_one_face_is_never_torn() -> None:
    assert worst_conflict(probes([0.0, 0.01], [0.0, 50.0], [3, 3]), CONFIG) is None


def test_probes_lie_on_their_faces_with_their_uv() -> None:
    surface, uv = rolled(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), 3, 2.0)
    found = probe_piece(Piece(np.arange(8), Flat(surface, uv, {}), 0.0, 0.0), CONFIG)
    np.testing.assert_allclose(found.uv, found.xyz[:, [0, 2]], atol=1e-12)
    inside = surface.triangles[found.face]
    assert (inside.min(axis=1) - 1e-12 <= found.xyz).all()
    assert (found.xyz <= inside.max(axis=1) + 1e-12).all()


def test_probes_lie_as_dense_as_two_layers_need() -> None:
    surface, uv = rolled(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), 3, 2.0)
    found = probe_piece(Piece(np.arange(8), Flat(surface, uv, {}), 0.0, 0.0), CONFIG)
    assert 2.0 * np.pi * CONFIG.reach**2 * len(found.xyz) / 4.0 == pytest.approx(CONFIG.neighbours, rel=0.05)


def test_one_triangle_is_one_patch() -> None:
    surface = Surface(np.eye(3), np.array([[0, 1, 2]]))
    assert patches_of(surface, np.eye(3, 2)).tolist() == [0]


def test_a_flat_sheet_is_one_patch() -> None:
    surface, uv = rolled(np.stack([np.linspace(-0.7, 0.7, 20), np.zeros(20)], axis=1), 20, 1.4)
    assert not patches_of(surface, uv).any()


def test_an_open_cloth_is_one_patch() -> None:
    vertices, faces = make_sample("cloth", resolution=24)
    surface = Surface(Frame.of(vertices).apply(vertices), faces)
    assert not patches_of(surface, surface.vertices[:, :2].copy()).any()


def test_a_wide_open_half_cylinder_is_one_patch() -> None:
    assert not patches_of(*rolled(arc(np.pi, 30), 20, 1.0)).any()


def test_a_slit_tube_is_halved_so_that_no_tear_stays() -> None:
    surface, uv = rolled(arc(2.0 * np.pi, 48), 24, 1.6)
    assert tears_of(surface, uv, np.zeros(len(surface.faces), dtype=np.int64)) > 0
    patch = patches_of(surface, uv)
    assert patch.max() == 1
    assert tears_of(surface, uv, patch) == 0
    assert_connected(surface.faces, patch)


def test_the_halves_of_a_slit_tube_have_the_slit_between_them() -> None:
    surface, uv = rolled(arc(2.0 * np.pi, 48), 24, 1.6)
    patch = patches_of(surface, uv).reshape(47, -1)
    assert not (patch[0] == patch[-1]).any()
    assert 0.3 < (patch == 0).mean() < 0.7


def test_an_almost_closed_cylinder_is_divided_too() -> None:
    surface, uv = rolled(arc(1.97 * np.pi, 48), 24, 1.6)
    patch = patches_of(surface, uv)
    assert patch.max() >= 1
    assert tears_of(surface, uv, patch) == 0


def test_two_parallel_sheets_joined_at_an_edge_are_two_patches() -> None:
    surface, uv = rolled(fold(0.05, 0.04), 20, 0.8)
    patch = patches_of(surface, uv)
    assert tears_of(surface, uv, patch) == 0
    assert patch.max() == 1
    x, y, _ = surface.triangles.mean(axis=1).T
    for side, far in ((y < 0.0, x < 0.4), (y > 0.0, x < 0.4)):
        assert np.unique(patch[side & far]).size == 1
    assert patch[0] != patch[-1]
    assert_connected(surface.faces, patch)


def test_two_sheets_far_apart_stay_one_patch() -> None:
    assert not patches_of(*rolled(fold(0.2, 0.04), 20, 0.8)).any()


def test_an_accordion_gets_a_patch_for_each_sheet() -> None:
    lines = [np.stack([np.linspace(-0.5, 0.5, 26), np.full(26, 0.05 * i)], axis=1)[:: (-1) ** i] for i in range(4)]
    surface, uv = rolled(np.concatenate(lines), 20, 0.8)
    patch = patches_of(surface, uv)
    assert patch.max() == 3
    assert tears_of(surface, uv, patch) == 0
    assert_connected(surface.faces, patch)


@pytest.mark.parametrize("most", [1, 2, 3])
def test_no_more_patches_than_allowed(most: int) -> None:
    lines = [np.stack([np.linspace(-0.5, 0.5, 26), np.full(26, 0.02 * i)], axis=1)[:: (-1) ** i] for i in range(8)]
    surface, uv = rolled(np.concatenate(lines), 10, 0.8)
    patch = patches_of(surface, uv, replace(CONFIG, most=most))
    assert patch.max() + 1 == most


def test_a_finer_mesh_is_divided_as_a_coarse_one() -> None:
    for step in (0.2, 0.04, 0.01):
        surface, uv = rolled(fold(0.05, step), round(0.8 / step), 0.8)
        assert patches_of(surface, uv).max() == 1, f"edges of {step}"


@pytest.mark.parametrize("columns", [8, 16, 32])
def test_a_slit_tube_of_few_faces_is_halved_too(columns: int) -> None:
    patch = patches_of(*rolled(arc(2.0 * np.pi, columns), columns // 2, 1.6))
    assert patch.max() == 1
    patch = patch.reshape(columns - 1, -1)
    assert not (patch[0] == patch[-1]).any()


@pytest.mark.parametrize("name", ["tube", "torus", "cone"])
def test_solids_that_were_slit_have_no_tear_within_a_patch(name: str) -> None:
    vertices, faces = make_sample(name, resolution=32)
    surface = Surface(Frame.of(vertices).apply(vertices), faces)
    piece = make_piece(surface, np.arange(len(faces)), float(surface.face_areas().sum()), FinishConfig())
    if piece is None:
        pytest.fail(f"{name} could not be flattened")
    patch = split_into_patches(piece, CONFIG)
    xyz, uv = surface.triangles.mean(axis=1), piece.flat.uv[piece.flat.surface.faces].mean(axis=1)
    assert patch.shape == (len(faces),)
    assert tears(xyz[piece.ids], uv, patch) == 0
    assert_connected(piece.flat.surface.faces, patch)


def test_a_patch_larger_than_the_limit_is_halved_until_none_is() -> None:
    side = np.linspace(0.0, 2.0, 21)
    x, y = np.meshgrid(side, side, indexing="ij")
    xyz = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], axis=1)
    corner = (np.arange(20)[:, None] * 21 + np.arange(20)).ravel()
    faces = np.concatenate(
        [np.stack([corner, corner + 21, corner + 22], 1), np.stack([corner, corner + 22, corner + 1], 1)]
    )
    patch = patches_of(Surface(xyz, faces), xyz[:, :2].copy(), PatchConfig(largest=1.5))
    assert 3 <= patch.max() + 1 <= 6
    assert (np.bincount(patch) * (4.0 / len(faces)) <= 1.5).all()
