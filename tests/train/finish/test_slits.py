"""Slits: cones in closed form, flat sheets, caps, waves and socks (a tube closed by half a sphere)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import (
    EdgeTable,
    boundary_loops,
    edge_table,
    euler_characteristic,
    is_manifold,
)
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.config import SlitConfig
from flexpara.train.finish.contact import boundary_edges, excess_energy
from flexpara.train.finish.flatten import flatten
from flexpara.train.finish.openings import slit_along
from flexpara.train.finish.slits import (
    Flat,
    Slit,
    best_slit,
    border_paths,
    candidate_paths,
    most_stressed,
    path_length,
    slit_to,
    slit_where_it_pays,
    stress,
)

CONFIG = SlitConfig()
APEX = np.array([0.0, 0.0, 1.0])


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def flat_sheet(resolution: int) -> Surface:
    cloth = sample("cloth", resolution)
    return Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces)


def sock(around: int, length: float) -> Surface:
    """A cylinder of radius ½ and this length, open below and closed by half a sphere above."""
    rise = np.linspace(0.0, length, max(2, round(length * around / np.pi)) + 1)
    bend = np.linspace(0.0, np.pi / 2.0, around // 4 + 1)[1:-1]
    radius = np.concatenate([np.full(len(rise), 0.5), 0.5 * np.cos(bend)])
    height = np.concatenate([rise, length + 0.5 * np.sin(bend)])
    turn = np.linspace(0.0, 2.0 * np.pi, around, endpoint=False)[:, None]
    ring = np.stack([radius * np.cos(turn), radius * np.sin(turn), np.tile(height, (around, 1))], axis=-1)
    corner = np.arange(ring[..., 0].size).reshape(around, len(radius))
    right = np.roll(corner, -1, axis=0)
    a, b, c, d = (part.ravel() for part in (corner[:, :-1], right[:, :-1], right[:, 1:], corner[:, 1:]))
    top = np.stack([corner[:, -1], right[:, -1], np.full(around, corner.size)], axis=1)
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1), top])
    return Surface(np.concatenate([ring.reshape(-1, 3), [[0.0, 0.0, length + 0.5]]]), faces)


def flattened(surface: Surface) -> Flat:
    return Flat(surface, flatten(surface, 30), {})


def excess(flat: Flat) -> float:
    """Mean excess energy: 0 = isometric."""
    return excess_energy(flat.surface, flat.uv) / float(flat.surface.face_areas().sum())


def slit_further(flat: Flat, config: SlitConfig = CONFIG) -> tuple[Flat, tuple[Slit, ...]]:
    return slit_where_it_pays(flat, float(flat.surface.face_areas().sum()), config)


def border_length(surface: Surface) -> float:
    ends = surface.vertices[boundary_edges(surface.faces)]
    return float(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1).sum())


def assert_valid(flat: Flat) -> None:
    corners = flat.uv[flat.surface.faces]
    assert not flipped_triangles(corners).any()
    assert len(overlapping_pairs(corners)) == 0
    assert euler_characteristic(flat.surface.faces) == 1
    assert len(boundary_loops(flat.surface.faces)) == 1
    assert is_manifold(flat.surface.faces)


def nearest(surface: Surface, point: np.ndarray) -> int:
    return int(np.linalg.norm(surface.vertices - point, axis=1).argmin())


def border_of(table: EdgeTable) -> np.ndarray:
    return np.unique(table.edges[table.boundary])


def way_to_the_apex(cone: Surface) -> list[int]:
    (path,) = candidate_paths(cone, edge_table(cone.faces), nearest(cone, APEX), CONFIG)
    return path


def test_border_paths_lead_straight_up_a_cone() -> None:
    cone = sample("cone", 24)
    table = edge_table(cone.faces)
    paths = border_paths(cone, table, border_of(table), replace(CONFIG, seams=SeamPrices(crease_discount=0.0)))
    slant = np.hypot(0.5, 1.0)
    assert paths.distance == pytest.approx(slant * cone.vertices[:, 2], abs=1e-9)


def test_a_path_is_as_long_as_its_steps() -> None:
    triangle = Surface(np.array([[0.0, 0, 0], [3, 0, 0], [3, 0, 4]]), np.array([[0, 1, 2]]))
    assert path_length(triangle, [0, 1, 2]) == pytest.approx(7.0)
    assert path_length(triangle, [1]) == 0.0


def test_a_slit_doubles_its_path_and_leaves_triangles_and_uv_as_they_were() -> None:
    flat = flattened(sample("cone", 24))
    path = way_to_the_apex(flat.surface)
    slit = slit_to(flat, path, edge_table(flat.surface.faces))
    assert len(slit.surface.vertices) == len(flat.surface.vertices) + len(path) - 1  # all but the apex
    assert np.array_equal(slit.surface.triangles, flat.surface.triangles)
    assert np.array_equal(slit.uv[slit.surface.faces], flat.uv[flat.surface.faces])
    assert border_length(slit.surface) == pytest.approx(border_length(flat.surface) + 2.0 * np.hypot(0.5, 1.0))
    assert euler_characteristic(slit.surface.faces) == 1


def test_a_slit_keeps_the_pins_on_both_of_its_sides() -> None:
    plain = flattened(sample("cone", 24))
    path, place = way_to_the_apex(plain.surface), np.array([3.0, 4.0])
    slit = slit_to(plain._replace(pins={path[1]: place}), path, edge_table(plain.surface.faces))
    assert len(slit.pins) == 2
    for vertex, pinned in slit.pins.items():
        assert np.array_equal(slit.surface.vertices[vertex], plain.surface.vertices[path[1]])
        assert np.array_equal(pinned, place)


@pytest.mark.parametrize("ways", [1, 2, 3])
@pytest.mark.parametrize("name", ["cone", "cloth", "sock", "ribbon"])
def test_no_way_to_a_vertex_touches_the_border_but_where_it_starts(name: str, ways: int) -> None:
    """Else the slit would cut the piece in two."""
    if name == "sock":
        surface = sock(16, 1.0)
    else:
        surface = flat_sheet(12) if name == "ribbon" else sample(name, 16)
        surface = Surface(surface.vertices * ([1.0, 0.1, 1.0] if name == "ribbon" else 1.0), surface.faces)
    table = edge_table(surface.faces)
    for target in np.setdiff1d(np.arange(len(surface.vertices)), border_of(table))[::7].tolist():
        for path in candidate_paths(surface, table, target, replace(CONFIG, ways=ways)):
            assert path[0] == target
            assert np.isin(path, border_of(table)).tolist() == [False] * (len(path) - 1) + [True]


def test_a_second_way_starts_elsewhere() -> None:
    cone = sample("cone", 24)
    config = replace(CONFIG, ways=2)
    first, second = candidate_paths(cone, edge_table(cone.faces), nearest(cone, APEX), config)
    apart = np.linalg.norm(cone.vertices[first[-1]] - cone.vertices[second[-1]])
    assert apart > config.apart * path_length(cone, first)
    assert path_length(cone, second) >= path_length(cone, first) - 1e-9


def test_a_flat_sheet_has_no_stress() -> None:
    sheet = flat_sheet(12)
    flat = Flat(sheet, sheet.vertices[:, :2].copy(), {})
    assert stress(flat, edge_table(sheet.faces), 0.2, CONFIG.rings) == pytest.approx(0.0, abs=1e-9)


def test_stress_is_greatest_at_the_apex_of_a_cone() -> None:
    flat = flattened(sample("cone", 24))
    pressure = stress(flat, edge_table(flat.surface.faces), 0.1, CONFIG.rings)
    assert np.linalg.norm(flat.surface.vertices[pressure.argmax()] - APEX) < 0.2


def test_stretched_faces_alone_are_no_stress_for_a_slit() -> None:
    sheet = flat_sheet(12)
    for factor, expected in ((2.0, 0.0), (0.5, 17.0 / 8.0 - 1.0)):
        flat = Flat(sheet, factor * sheet.vertices[:, :2], {})
        assert stress(flat, edge_table(sheet.faces), 0.2, CONFIG.rings) == pytest.approx(expected)


def target_of(flat: Flat, spared: list[np.ndarray], reach: float = 0.1, near: float = 0.1) -> int | None:
    table = edge_table(flat.surface.faces)
    distance = border_paths(flat.surface, table, border_of(table), CONFIG).distance
    return most_stressed(flat, table, distance, spared, 1.0, replace(CONFIG, radius=reach, near=near))


def test_no_slit_is_proposed_where_nothing_is_squeezed() -> None:
    sheet = flat_sheet(12)
    assert target_of(Flat(sheet, 1.5 * sheet.vertices[:, :2], {}), []) is None


def test_no_slit_leads_near_a_spared_point_or_the_border() -> None:
    flat = flattened(sample("cone", 24))
    first = target_of(flat, [])
    assert first is not None
    second = target_of(flat, [flat.surface.vertices[first]])
    assert second is not None
    assert np.linalg.norm(flat.surface.vertices[second] - flat.surface.vertices[first]) >= 0.2
    assert flat.surface.vertices[second][2] > 0.05
    assert target_of(flat, [], near=2.0) is None


@pytest.mark.parametrize(("price", "pays"), [(0.05, True), (1.0, False)])
def test_a_slit_pays_where_it_saves_more_than_it_costs(price: float, pays: bool) -> None:
    """To the apex of a cone: 0.2 saved, for a length of √(1.25 / area)."""
    flat = flattened(sample("cone", 32))
    area = float(flat.surface.face_areas().sum())
    assert excess(flat) == pytest.approx(0.2, abs=0.05)
    table, apex = edge_table(flat.surface.faces), nearest(flat.surface, APEX)
    found = best_slit(flat, table, apex, excess(flat), area, replace(CONFIG, price=price))
    assert (found is not None) == pays
    if found is not None:
        assert np.array_equal(found[1].points[-1], flat.surface.vertices[apex])
        assert found[1].points[0][2] == 0.0
        assert excess(found[0]) < excess(flat) - price * np.sqrt(1.25 / area)


def test_a_cone_is_slit_to_its_apex_and_becomes_flat() -> None:
    flat = flattened(sample("cone", 32))
    assert excess(flat) > 0.1
    open_, slits = slit_further(flat, replace(CONFIG, contact=replace(CONFIG.contact, block=5, still=0.04)))
    assert len(slits) == 1
    assert slits[0].points[-1] == pytest.approx(APEX, abs=0.1)
    assert slits[0].points[0][2] == 0.0
    assert excess(open_) < 1e-4  # a search, which has less patience, leaves 0.0019
    assert_valid(open_)


@pytest.mark.parametrize("length", [0.5, 1.5])
def test_a_sock_is_slit_and_its_energy_falls(length: float) -> None:
    flat = flattened(sock(24, length))
    open_, slits = slit_further(flat)
    assert len(slits) >= 1
    assert excess(open_) < 0.05 * excess(flat)
    assert_valid(open_)


def test_half_a_sphere_is_slit_where_that_pays() -> None:
    sphere = sample("sphere", 48)
    used, index = np.unique(sphere.faces[sphere.triangles.mean(axis=1)[:, 2] > 0.0], return_inverse=True)
    flat = flattened(Surface(sphere.vertices[used], index.reshape(-1, 3).astype(np.int64)))
    open_, slits = slit_further(flat)
    added = border_length(open_.surface) - border_length(flat.surface)
    unit = float(np.sqrt(flat.surface.face_areas().sum()))
    assert 1 <= len(slits) <= CONFIG.most
    assert excess(flat) - excess(open_) > CONFIG.price * added / 2.0 / unit
    assert_valid(open_)


def test_a_flat_disk_gets_no_slit() -> None:
    flat = flattened(flat_sheet(16))
    same, slits = slit_further(flat)
    assert slits == ()
    assert same is flat


def test_gentle_waves_get_no_slit() -> None:
    flat = flattened(sample("cloth", 16))
    assert slit_further(flat)[0] is flat


@pytest.mark.parametrize("price", [0.03, 0.3])
def test_dearer_slits_are_fewer(price: float) -> None:
    flat = flattened(sock(24, 1.0))
    assert len(slit_further(flat, replace(CONFIG, price=price))[1]) < len(slit_further(flat)[1])


def test_no_more_slits_than_allowed() -> None:
    flat = flattened(sock(24, 1.0))
    assert len(slit_further(flat)[1]) > 1
    assert len(slit_further(flat, replace(CONFIG, most=1))[1]) == 1


def test_slits_keep_the_triangles_in_place() -> None:
    flat = flattened(sock(24, 1.0))
    before = flat.uv.copy()
    open_, _ = slit_further(flat)
    assert np.array_equal(open_.surface.triangles, flat.surface.triangles)
    assert np.array_equal(flat.uv, before)


def test_size_does_not_matter() -> None:
    """Lengths are shares: a sock of a hundredth of the size gets the same slits."""
    small = sock(24, 1.0)
    small = Surface(0.01 * small.vertices, small.faces)
    open_, slits = slit_further(flattened(small))
    assert len(slits) == len(slit_further(flattened(sock(24, 1.0)))[1])
    assert_valid(open_)


def test_slits_repeat_on_a_finer_mesh_of_the_same_shape() -> None:
    coarse = flattened(sock(20, 1.0))
    open_, slits = slit_further(coarse)
    assert len(slits) > 1
    assert border_length(slit_along(coarse.surface, slits, CONFIG)) == pytest.approx(border_length(open_.surface))
    fine = sock(40, 1.0)
    again = slit_along(fine, slits, CONFIG)
    assert np.array_equal(again.triangles, fine.triangles)
    assert euler_characteristic(again.faces) == 1
    assert len(boundary_loops(again.faces)) == 1
    assert border_length(again) - border_length(fine) == pytest.approx(
        border_length(open_.surface) - border_length(coarse.surface), rel=0.2
    )
    assert excess(flattened(again)) < 0.1 * excess(flattened(fine))
