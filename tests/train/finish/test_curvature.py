"""Curvature: angles by hand, Gauss–Bonnet, and the conformal factor of a hemisphere and a cone in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from flexpara.runtime.geometry.overlap import flipped_triangles
from flexpara.runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.config import CotangentConfig
from flexpara.train.finish.curvature import (
    Curvature,
    border_first,
    closed_polygon,
    corner_cotangents,
    factorize,
    foretold_energies,
)
from flexpara.train.finish.flatten import jacobians
from flexpara.train.finish.slits import border_of

CONFIG = CotangentConfig()
RIGHT = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def flat_sheet(resolution: int) -> Surface:
    cloth = sample("cloth", resolution)
    return Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces)


def hemisphere(rings: int) -> Surface:
    """Half of the unit sphere: rings of 4·rings vertices at equal latitudes, the equator first, and the pole last."""
    around = 4 * rings
    latitude = np.linspace(0.0, np.pi / 2.0, rings + 1)[:-1]
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)
    b, a = np.meshgrid(latitude, turn, indexing="ij")
    ring = np.stack([np.cos(b) * np.cos(a), np.cos(b) * np.sin(a), np.sin(b)], axis=-1).reshape(-1, 3)
    corner = np.arange(len(ring)).reshape(rings, around)
    ahead = np.roll(corner, -1, axis=1)
    p, q, r, s = (part.ravel() for part in (corner[:-1], ahead[:-1], ahead[1:], corner[1:]))
    top = np.stack([corner[-1], ahead[-1], np.full(around, len(ring))], axis=1)
    faces = np.concatenate([np.stack([p, q, r], axis=1), np.stack([p, r, s], axis=1), top])
    return Surface(np.concatenate([ring, [[0.0, 0.0, 1.0]]]), faces)


def rim_of(surface: Surface) -> np.ndarray:
    return border_of(edge_table(surface.faces), len(surface.vertices))


def test_a_right_triangle_has_its_cotangents() -> None:
    assert corner_cotangents(RIGHT.triangles)[0] == pytest.approx([0.0, 1.0, 1.0])


def test_a_face_without_area_has_finite_cotangents_and_a_curvature() -> None:
    flat = Surface(np.array([[0.0, 0, 0], [2, 0, 0], [1, 0, 0]]), np.array([[0, 1, 2]]))
    assert np.isfinite(corner_cotangents(flat.triangles)).all()
    assert Curvature.of(flat, CONFIG).turn == pytest.approx([0.0, 0.0, np.pi])


@pytest.mark.parametrize("name", ["sphere", "torus", "trefoil", "cube"])
def test_the_curvature_of_a_closed_surface_adds_up_to_its_topology(name: str) -> None:
    """Gauss–Bonnet: Σ (2π − angles) = 2π χ."""
    surface = sample(name, 24)
    defect = 2.0 * np.pi - Curvature.of(surface, CONFIG).turn
    assert defect.sum() == pytest.approx(2.0 * np.pi * euler_characteristic(surface.faces), abs=1e-8)


@pytest.mark.parametrize("name", ["cone", "cloth", "hemisphere"])
def test_the_bend_of_a_flattened_border_adds_up_to_a_full_turn(name: str) -> None:
    """Σ of the exterior angles, once the curvature inside has been moved to the border, is 2π."""
    surface = hemisphere(8) if name == "hemisphere" else sample(name, 16)
    curvature, rim = Curvature.of(surface, CONFIG), rim_of(surface)
    bend = np.pi - curvature.turn[rim] + (curvature.laplacian @ curvature.factor(rim))[rim]
    assert bend.sum() == pytest.approx(2.0 * np.pi, abs=1e-6)


def test_the_laplacian_is_symmetric_has_no_constant_part_and_measures_a_plane_exactly() -> None:
    """The Dirichlet energy of x over a flat square of side 2 is half its area, times two: xᵀLx = 4."""
    sheet = flat_sheet(12)
    laplacian = Curvature.of(sheet, CONFIG).laplacian
    assert abs(laplacian - laplacian.T).max() < 1e-12
    assert np.abs(laplacian @ np.ones(len(sheet.vertices))).max() < 1e-12
    x = sheet.vertices[:, 0]
    assert x @ laplacian @ x == pytest.approx(4.0, rel=0.01)  # weights of the right angles are raised a little above 0


def test_a_flat_sheet_keeps_its_scale() -> None:
    sheet = flat_sheet(12)
    assert Curvature.of(sheet, CONFIG).factor(rim_of(sheet)) == pytest.approx(0.0, abs=1e-9)


def test_the_scale_of_a_hemisphere_that_keeps_its_equator_is_known_at_the_pole_and_between() -> None:
    """Stereographic projection from the other pole: scale 1 / (1 + sin latitude), so u = −ln 2 at the pole."""
    half = hemisphere(24)
    u = Curvature.of(half, CONFIG).factor(rim_of(half))
    assert u[-1] == pytest.approx(-np.log(2.0), abs=0.01)
    assert u == pytest.approx(-np.log1p(half.vertices[:, 2]), abs=0.01)


def test_a_closed_surface_and_one_that_is_all_border_keep_their_scale() -> None:
    sphere = sample("sphere", 12)
    curvature = Curvature.of(sphere, CONFIG)
    assert not curvature.factor(np.zeros(len(sphere.vertices), dtype=bool)).any()
    assert not curvature.factor(np.ones(len(sphere.vertices), dtype=bool)).any()


def test_size_does_not_change_the_scale_factor() -> None:
    half = hemisphere(8)
    small = Surface(1e-3 * half.vertices, half.faces)
    assert Curvature.of(small, CONFIG).factor(rim_of(small)) == pytest.approx(
        Curvature.of(half, CONFIG).factor(rim_of(half))
    )


def test_the_energy_foretold_is_that_of_a_similarity_and_capped() -> None:
    """e^u in both directions: (2 e^2u + 2 e^−2u) / 4 − 1 = cosh 2u − 1."""
    u = np.full(3, np.log(2.0))
    assert foretold_energies(RIGHT.faces, np.array([3.0]), u) == pytest.approx([3.0 * ((4.0 + 0.25) / 2.0 - 1.0)])
    assert foretold_energies(RIGHT.faces, np.array([3.0]), -u) == pytest.approx([3.0 * ((4.0 + 0.25) / 2.0 - 1.0)])
    assert foretold_energies(RIGHT.faces, np.array([3.0]), 0.0 * u) == pytest.approx([0.0])
    assert foretold_energies(RIGHT.faces, np.array([3.0]), 100.0 * u) == pytest.approx([30.0])
    assert foretold_energies(RIGHT.faces, RIGHT.face_areas(), u).sum() == pytest.approx(0.5 * 1.125)


def test_the_energy_foretold_orders_caps_of_a_sphere_by_how_much_they_cover() -> None:
    sphere = sample("sphere", 48)
    energy = []
    for height in (0.8, 0.4, 0.0, -0.4):
        used, index = np.unique(sphere.faces[sphere.triangles.mean(axis=1)[:, 2] > height], return_inverse=True)
        cap = Surface(sphere.vertices[used], index.reshape(-1, 3).astype(np.int64))
        factor = Curvature.of(cap, CONFIG).factor(rim_of(cap))
        energy.append(foretold_energies(cap.faces, cap.face_areas(), factor).sum())
    assert energy == sorted(energy)
    assert energy[0] < 0.01 * energy[-1]


def test_a_flat_disk_laid_out_by_its_border_is_isometric() -> None:
    sheet = flat_sheet(12)
    uv = border_first(sheet, boundary_loops(sheet.faces)[0], CONFIG)
    sigma = np.linalg.svd(jacobians(sheet, uv), compute_uv=False)
    assert sigma == pytest.approx(1.0, abs=1e-6)
    assert not flipped_triangles(uv[sheet.faces]).any()


def test_a_hemisphere_laid_out_by_its_border_is_a_round_disk_of_its_equator() -> None:
    half = hemisphere(16)
    uv = border_first(half, boundary_loops(half.faces)[0], CONFIG)
    rim = rim_of(half)
    radius = np.linalg.norm(uv[rim] - uv[rim].mean(axis=0), axis=1)
    assert radius == pytest.approx(1.0, abs=0.01)
    assert uv[-1] == pytest.approx(uv[rim].mean(axis=0), abs=1e-6)
    assert not flipped_triangles(uv[half.faces]).any()


@pytest.mark.parametrize("sides", [3, 4, 7])
def test_a_regular_polygon_closes_as_it_is(sides: int) -> None:
    corners = closed_polygon(np.ones(sides), np.full(sides, 2.0 * np.pi / sides))
    step = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    assert step == pytest.approx(1.0, abs=1e-9)
    centre = corners - corners.mean(axis=0)
    assert np.linalg.norm(centre, axis=1) == pytest.approx(0.5 / np.sin(np.pi / sides))


def test_sides_that_do_not_close_are_changed_as_little_as_closing_asks() -> None:
    corners = closed_polygon(np.array([1.0, 1.0, 1.0, 1.2]), np.full(4, np.pi / 2.0))
    step = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    assert step == pytest.approx([1.0, 1.0909, 1.0, 1.0909], abs=1e-3)


def test_a_row_that_nothing_fixes_is_solved_all_the_same() -> None:
    from scipy import sparse

    singular = sparse.csr_array(np.array([[1.0, -1.0], [-1.0, 1.0]]))
    assert np.isfinite(factorize(singular).solve(np.array([1.0, -1.0]))).all()
