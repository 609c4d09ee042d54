"""Slits that curvature asks for before anything is flattened: a cone in closed form, a flat sheet, a bowl."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

pytest.importorskip("igl")

from flexpara.runtime.geometry.topology import boundary_loops, edge_table, euler_characteristic
from flexpara.runtime.mesh import Surface
from flexpara.runtime.samples import make_sample
from flexpara.train.finish.config import SlitConfig
from flexpara.train.finish.contact import excess_energy
from flexpara.train.finish.curvature import Curvature
from flexpara.train.finish.flatten import flatten
from flexpara.train.finish.pieces import border_length
from flexpara.train.finish.slits import Slit, border_of, foreseen_slits, lowest_factor

CONFIG = SlitConfig()
APEX = np.array([0.0, 0.0, 1.0])


def sample(name: str, resolution: int) -> Surface:
    return Surface(*make_sample(name, resolution=resolution))


def flat_sheet(resolution: int) -> Surface:
    cloth = sample("cloth", resolution)
    return Surface(cloth.vertices * [1.0, 1.0, 0.0], cloth.faces)


def excess(surface: Surface) -> float:
    """Mean excess energy once flattened: 0 = isometric."""
    return excess_energy(surface, flatten(surface, 30)) / float(surface.face_areas().sum())


def foreseen(surface: Surface, config: SlitConfig = CONFIG) -> tuple[Surface, tuple[Slit, ...]]:
    return foreseen_slits(Curvature.of(surface, config.contact.cotangents), float(surface.face_areas().sum()), config)


def test_the_border_is_known_by_its_vertices() -> None:
    cone = sample("cone", 24)
    assert np.array_equal(border_of(edge_table(cone.faces), len(cone.vertices)), cone.vertices[:, 2] == 0.0)


def test_the_curvature_of_a_cone_asks_for_one_slit_to_its_apex() -> None:
    cone = sample("cone", 32)
    slit, slits = foreseen(cone)
    assert len(slits) == 1
    assert slits[0].points[-1] == pytest.approx(APEX)
    assert slits[0].points[0][2] == 0.0
    assert slits[0].length == pytest.approx(np.hypot(0.5, 1.0), rel=0.01)
    assert border_length(slit) == pytest.approx(border_length(cone) + 2.0 * slits[0].length)
    assert excess(slit) < 1e-4


def test_curvature_asks_for_no_slit_where_nothing_is_curved() -> None:
    sheet = flat_sheet(12)
    same, slits = foreseen(sheet)
    assert same is sheet
    assert slits == ()


def test_a_foreseen_slit_has_to_be_worth_its_length() -> None:
    cone = sample("cone", 32)
    assert foreseen(cone, replace(CONFIG, price=1.0))[1] == ()
    assert foreseen(cone, replace(CONFIG, foreseen=0))[1] == ()


def test_foreseen_slits_open_a_bowl_and_leave_one_disk() -> None:
    sphere = sample("sphere", 32)
    used, index = np.unique(sphere.faces[sphere.triangles.mean(axis=1)[:, 2] > -0.6], return_inverse=True)
    bowl = Surface(sphere.vertices[used], index.reshape(-1, 3).astype(np.int64))
    slit, slits = foreseen(bowl)
    assert 1 <= len(slits) <= CONFIG.foreseen
    assert np.array_equal(slit.triangles, bowl.triangles)
    assert euler_characteristic(slit.faces) == 1
    assert len(boundary_loops(slit.faces)) == 1
    assert excess(slit) < 0.5 * excess(bowl)


def test_the_tip_is_the_most_squeezed_vertex_that_is_neither_spared_nor_near_the_border() -> None:
    cone = sample("cone", 24)
    u, distance = -cone.vertices[:, 2], cone.vertices[:, 2]
    apex = int(cone.vertices[:, 2].argmax())
    assert lowest_factor(cone, u, distance, [], 0.1) == apex
    second = lowest_factor(cone, u, distance, [APEX], 0.1)
    assert second is not None
    assert np.linalg.norm(cone.vertices[second] - APEX) >= 0.2
    assert lowest_factor(cone, u, distance, [], 2.0) is None
    assert lowest_factor(cone, -u, distance, [], 0.1) is None
