"""Ways to open a piece, and cuts repeated on another mesh of the same shape."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.overlap import flipped_triangles, overlapping_pairs
from flexpara.runtime.geometry.topology import (
    boundary_loops,
    components,
    euler_characteristic,
    is_manifold,
)
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.config import SlitConfig
from flexpara.train.finish.contact import boundary_edges, excess_energy
from flexpara.train.finish.flatten import flatten
from flexpara.train.finish.openings import openings, slit_along
from flexpara.train.finish.pieces import extract
from flexpara.train.finish.slits import (
    Flat,
    Slit,
    slit_where_it_pays,
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


def test_a_disk_opens_as_it_is() -> None:
    cone = sample("cone", 16)
    (only,) = openings(cone, SeamPrices())
    assert only.disk is cone
    assert only.cuts == ()


def test_a_ring_opens_as_it_is_or_cut_through() -> None:
    tube = sample("tube", 16)
    kept, cut = openings(tube, SeamPrices())
    assert kept.disk is tube
    assert euler_characteristic(cut.disk.faces) == 1
    assert border_length(cut.disk) == pytest.approx(border_length(tube) + 2.0 * 2.0)


@pytest.mark.parametrize("name", ["sphere", "torus", "gyroid"])
def test_a_closed_surface_opens_in_one_way(name: str) -> None:
    if name == "gyroid":
        pytest.importorskip("manifold3d")
    (cut,) = openings(sample(name, 24), SeamPrices())
    assert euler_characteristic(cut.disk.faces) == 1
    assert len(boundary_loops(cut.disk.faces)) == 1


def test_a_handle_with_a_hole_is_cut() -> None:
    torus = sample("torus", 24)
    pierced = extract(torus, np.flatnonzero(np.linalg.norm(torus.triangles.mean(axis=1) - [1.0, 0, 0], axis=1) > 0.2))
    (cut,) = openings(pierced, SeamPrices())
    assert euler_characteristic(cut.disk.faces) == 1


@pytest.mark.parametrize("name", ["tube", "sphere", "torus"])
def test_the_cuts_that_open_a_surface_open_it_again(name: str) -> None:
    surface = sample(name, 24)
    *_, opening = openings(surface, SeamPrices())
    again = slit_along(surface, opening.cuts, CONFIG)
    assert all(cut.through for cut in opening.cuts)
    assert euler_characteristic(again.faces) == 1
    assert border_length(again) == pytest.approx(border_length(opening.disk), rel=0.05)


def test_the_cut_of_a_tube_opens_a_finer_one() -> None:
    *_, opening = openings(sample("tube", 16), SeamPrices())
    fine = sample("tube", 40)
    again = slit_along(fine, opening.cuts, CONFIG)
    assert euler_characteristic(again.faces) == 1
    assert border_length(again) == pytest.approx(border_length(fine) + 2.0 * 2.0, rel=0.05)


def test_a_cut_that_would_leave_two_pieces_is_left_out() -> None:
    cloth = flat_sheet(16)
    across = Slit(np.array([[-1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), through=True)
    assert slit_along(cloth, (across,), CONFIG) is cloth


def test_a_slit_of_another_place_is_left_out() -> None:
    cone = sample("cone", 24)
    away = Slit(np.array([[9.0, 0.0, 0.0], [9.0, 0.1, 0.0], [9.0, 0.2, 0.0]]))
    assert slit_along(cone, (away,), CONFIG) is cone


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


@pytest.mark.parametrize("target", [[0.5, 0.0, 0.0], [-0.5, 0.0, 0.0]])
def test_slitting_along_nothing_or_the_border_changes_nothing(target: list[float]) -> None:
    cone = sample("cone", 24)
    start = [0.5, 0.0, 0.0]
    assert np.array_equal(slit_along(cone, (), CONFIG).faces, cone.faces)
    assert np.array_equal(slit_along(cone, (Slit(np.array([start, target])),), CONFIG).faces, cone.faces)


def test_a_slit_that_would_run_along_the_border_leaves_it_where_it_must() -> None:
    """From one end of a ribbon to the other, just inside its rim: the shortest way is the rim itself."""
    cloth = flat_sheet(16)
    ribbon = Surface(cloth.vertices * [1.0, 0.2, 0.0], cloth.faces)
    slit = slit_along(ribbon, (Slit(np.array([[-1.0, -0.2, 0.0], [0.8, -0.16, 0.0]])),), CONFIG)
    assert euler_characteristic(slit.faces) == 1
    assert components(slit.faces).max() == 0
    assert border_length(ribbon) < border_length(slit) < border_length(ribbon) + 2.0 * 1.9
