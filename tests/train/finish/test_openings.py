"""Ways to open a piece, and cuts repeated on another mesh of the same shape."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.cutgraph import SeamPrices
from flexpara.runtime.geometry.topology import (
    boundary_loops,
    components,
    euler_characteristic,
)
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.config import SlitConfig
from flexpara.train.finish.openings import openings, slit_along
from flexpara.train.finish.pieces import border_length, extract
from flexpara.train.finish.slits import Slit

CONFIG = SlitConfig()


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def flat_sheet(resolution: int) -> Surface:
    cloth = sample("cloth", resolution)
    return Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces)


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


@pytest.mark.parametrize("name", ["tube", "torus", "cloth"])
def test_a_slit_is_the_same_whether_it_is_sought_near_by_or_everywhere(name: str) -> None:
    coarse, fine = sample(name, 12), sample(name, 48)
    *_, opening = openings(coarse, SeamPrices())
    middle = coarse.vertices[np.linalg.norm(coarse.vertices - coarse.vertices.mean(axis=0), axis=1).argmin()]
    rim = opening.disk.vertices[boundary_loops(opening.disk.faces)[0][0]]
    short = Slit(np.linspace(rim, rim + 0.4 * (middle - rim), 5))
    slits = (*opening.cuts, short)
    found, expected = (slit_along(fine, slits, SlitConfig(reach=reach)) for reach in (12.0, np.inf))
    assert border_length(found) > border_length(fine)
    np.testing.assert_array_equal(found.faces, expected.faces)
    np.testing.assert_array_equal(found.vertices, expected.vertices)


def test_where_nothing_near_a_slit_leads_to_its_end_all_of_the_piece_is_looked_at() -> None:
    """A ribbon bent to a hairpin: the slit crosses the gap between its arms, the way goes round the bend."""
    flat = flat_sheet(48)
    turn = np.pi * (flat.vertices[:, 0] + 1.0) / 2.0
    radius = 1.0 + 0.3 * flat.vertices[:, 1]
    hairpin = Surface(np.stack([radius * np.cos(turn), 3.0 * radius * np.sin(turn), 0.0 * turn], axis=1), flat.faces)
    ends = [int(np.abs(flat.vertices - place).sum(axis=1).argmin()) for place in ([-1.0, 0, 0], [0.9, 0, 0])]
    slit = Slit(np.linspace(hairpin.vertices[ends[0]], hairpin.vertices[ends[1]], 120))
    found = slit_along(hairpin, (slit,), SlitConfig(astray=50.0))
    assert border_length(found) > border_length(hairpin) + 0.1
